"""Trials: many runs over drives, filters and seeds, and what they show.

* `plan`: what is to be run, as TOML; `plans/` come along
* `drives`, `runs`: one drive, all filters on it, a row for each run
* `rows`, `engine`: rows on disk; runs on the cores of one machine, or on many machines
* `statistics`, `table`: intervals, survival curves, grouped figures, paired differences
* `timing`: what features and updates cost, in one process
"""
