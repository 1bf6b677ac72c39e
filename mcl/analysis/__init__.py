"""What a run was like: computed from its records, never fed back into the filter.

- `metrics`: definitions of localized, lost and converged; scores of a step and a run; the thesis's success
- `events`: whether a run is localized, update by update; the updates that a person wants to look at
- `modes`: modes of the belief, followed from step to step, and the ancestry of particles
- `failures/`: why a run went wrong: its verdict, causes, and the particles at the true place
- `explanation`: why one reference is believed, and where another one loses
- `run_comparison`: how much better one run is than another, with confidence intervals
"""
