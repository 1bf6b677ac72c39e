"""What a recording holds, and what is wrong with it.

* `inspection`: counts, rates and gaps of a recording, as `inspect` shows them
* `gathering`: a recording as plain arrays, also while a replay reads it
* `examination`: goes through a recording and reports errors, with the options that fix them (`fixing`)
* `findings`: errors as codes and numbers. What computes them: `odometry`, `mast` (a camera off the robot's
  center), `pictures`, `scans` (beside each other), `scans_on_map`, `map_at_truth`, `plausibility` (what
  cannot be, asked before every replay)
"""
