"""How good a run is, in numbers: computed from its records, never fed back into the filter.

Why it was so is in `reasons`.

- `metrics`: definitions of localized, lost and converged; scores of a step, a run, and many runs as arrays;
  the thesis's success
- `episodes`: when a run was lost, searching, wrong and confident
- `events`: the steps that a person wants to look at
- `lost_signal`: how likely it is that a run is lost, without the truth
- `near_truth`: what became of the particles at the true place
- `modes`: modes of the belief, followed from step to step, and the ancestry of particles
- `comparison`: how much better one run is than another, with intervals; `dead_reckoning`: than odometry alone
- `demands`: what `check` may demand
"""
