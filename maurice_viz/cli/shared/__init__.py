"""What all commands share. What a single group of commands needs stays in the file of that group.

options  options by name, and sets of them that go together, such as those of the filter
live_options  the same of commands that listen to a live source
values   words that are typed, as values: lengths, steps, reading options
console  what is printed, and where progress is shown
visible  control characters as visible marks
errors   errors in one line, with their exit status
startup  what makes commands start sooner
"""
