"""What people read about a run: Markdown for panels, rows for tables, values for JSON.

Words and tables only: what they tell is computed in `maurice_mcl`.

narration          what each step did
phases             what one phase of a step did, in two sentences
verdict, headline  what happened to one run, or to several: with all numbers, and in two lines
comparison         who is closer at a step and why, and over the drive
causes             causes of failures and incidents as clauses, and the evidence that decided
laser              what a scan says of a pose, and why a robot with a laser was lost
tour               where to look, moment by moment
what_if            what a branch changed, which remedies help, which part of a filter costs most
explanation        why the best reference wins, in sentences
explanation_table  the figures of all references as Markdown and as JSON
sensors            what pose sensors read
places             whether a library can tell its places apart
summary            the scores of runs as a table, how several differ, and the names of trials
score_json         the scores of runs as JSON
findings           what is wrong with a recording, the evidence, and how to fix it
"""
