"""What a run was like: computed from its records, never fed back into the filter.

- `metrics`: the definitions of localized, lost and converged; scores of a step and of a run
- `success`: the thesis's own two readings of success
- `localization_status`: where "localized", "lost" and "recovered" are decided, update by update
- `events`: the updates that a person would want to look at; `watchers`: the detectors behind them
- `modes`: modes of the belief, followed from step to step
- `ancestry`: where particles come from, some updates back
- `explanation`: why one reference is believed, and where another one loses
- `run_comparison`: how much better one run is than another, with confidence intervals
"""
