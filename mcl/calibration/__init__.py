"""Constants fitted to data.

- `motion`: motion constants from turns and straights, and those from a drive with truth
- `noise`: the camera's noise floor, from pictures taken with the lens covered
- `tuning`: scales and weights of channels, by log score
- `statistics`: means, standard deviations and slopes with their confidence intervals
"""
