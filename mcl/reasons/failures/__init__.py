"""Why a run went wrong, as facts.

- `causes`: what befell the robot or its camera during the drive
- `ambiguity`: two places that shared the weight
- `verdict`: what happened to a run, its troubles and their causes, and the step to look at
- `kinds`: the kinds of cause, and one failure with its evidence
- `diagnosis`: one cause for each time a run was lost
"""
