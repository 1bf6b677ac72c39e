"""What people read about a run: Markdown for panels, rows for tables, values for JSON.

narration          what each step did
explanation        why the best reference wins, in sentences
explanation_table  the figures of all references as Markdown and as JSON
verdict            what happened to one run, or to several, in one line
places             whether a library can tell its places apart
summary            the scores of runs as a table, and how several differ
score_json         the scores of runs as JSON
diagnosis          what is wrong with a recording, the evidence, and how to fix it
"""
