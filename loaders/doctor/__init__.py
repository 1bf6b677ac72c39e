"""What a recording holds, and what is wrong with it.

* `inspection`: counts, rates and gaps of a recording, as `inspect` shows them
* `examination`: goes through a recording and reports errors, with the options that fix them
* `findings`: errors as codes and numbers; `odometry`, `mast` (a camera off the robot's center), `pictures`,
  `scans`, `plausibility`: what computes them
"""
