"""The viewer's process and what it shows.

open_viewers  starting viewers, and moving their time cursor
sinks         where a recording goes: a file, a viewer, or a file and every viewer that connects
snapshot      pictures of the viewer without a screen
movie         movies made of them
web           a page for browsers
"""
