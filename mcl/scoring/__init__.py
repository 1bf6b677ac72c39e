"""How good a run is, in numbers: computed from its records, never fed back into the filter.

Why it was so is in `reasons`.

- `table`: a run as a table, which all others read; `batch`: the tables of many runs with different seeds
- `metrics`: definitions of localized, lost and converged; scores of a step, a run, and many runs as arrays;
  the thesis's success
- `episodes`: when a run was lost, searching, wrong and confident
- `standing`: how a run stands now: localized, searching, lost
- `events`: the steps that a person wants to look at
- `lost_signal`: how likely it is that a run is lost, without the truth
- `rival_places`: where a robot may be as well
- `modes`: what became of the particles at the true place; modes, followed from step to step; ancestors
- `comparison`: how much better one run is than another, and than odometry alone, with intervals
- `demands`: what `check` may demand
"""
