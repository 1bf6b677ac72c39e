"""What people read about a run: Markdown for panels, rows for tables, values for JSON.

narration   what each step did
comparison  how several runs differ
summary     the scores of runs
diagnosis   what is wrong with a recording, the evidence, and how to fix it
"""
