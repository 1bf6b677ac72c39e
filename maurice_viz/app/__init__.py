"""What the public functions do, without a console: open, run, score, draw, save, explain, export.

open and output prepare; run goes through the updates; replay, compare, drive and trials start it;
saved and saved_steps keep runs and restore them; understand/ answers questions about them; the
others are named after their functions.
"""
