"""Constants fitted to data. What uses them while a filter runs is in `filter` and `sensor`.

- `motion`: motion constants from trials, turns and straights
- `odometry`: motion models to first order; `odometry_fit`: their constants, from any drives with truth
- `sensor`: the camera's noise floor (covered lens), and scales and weights of channels, by log score
- `belief`: how often the regions of a cloud hold the truth, and the exponent that makes them
- `statistics`: means, standard deviations and slopes with their confidence intervals
"""
