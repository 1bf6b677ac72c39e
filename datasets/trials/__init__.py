"""Trials: many runs over drives, filters and seeds, and what they show.

* `plan`: what is to be run, as TOML; `plans/` come along
* `drives`, `stretches`, `runs`: one drive or a part of a recorded one, all filters on it, also those that are
  given something wrong, a row for each run
* `rows`, `engine`: rows on disk; runs on the cores of one machine, or on many machines
* `tally`: what a row tells of a run, and of the truth along its drive
* `statistics`, `table`: intervals, survival curves, grouped figures, paired differences
* `folder`: the run behind a row; `atlas`, `budget`: where runs go wrong, and what each part costs
* `recognition`: how often a drive's pictures find the right reference

The drawings and pages of what trials show are in `maurice_viz`; the thesis's figures in `benchmarks/thesis`.
"""
