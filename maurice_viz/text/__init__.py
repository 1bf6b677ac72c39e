"""What people read about a run: Markdown for panels, rows for tables, values for JSON.

Words and tables only: what they tell is computed in `maurice_mcl`.

phases             what each step did; and one phase of it, in two sentences
verdict            what happened to one run, or to several, with all numbers
tour               the first screen: the same in two lines, and where to look, moment by moment
lesson             what a step teaches: does its picture know the place, and are dots there
comparison         who is closer over the drive; what a branch or a remedy changed
side_by_side       which of several runs is closer at a step, what each phase did to each cloud, and why
causes             causes of failures and incidents as clauses, and the evidence that decided
laser              what a scan says of a pose, and why a robot with a laser was lost
explanation        why the best reference wins, in sentences
explanation_table  the figures of all references as Markdown and as JSON
sensors            what pose sensors read
summary            the scores of runs as a table and as JSON, how several differ, and the names of trials
findings           what is wrong with a recording, the evidence, and how to fix it
library            what its own pictures say about a library, and those of a drive through it
"""
