"""The vocabulary: values that all other rooms pass to each other. No algorithm of the filter belongs here.

- `arrays`, `geometry`, `randomness`: kinds of arrays, poses in the plane, addressed random numbers
- `setting_rules`: what values a setting may have, as annotations of its field
- `scan`, `occupancy`: a planar laser, and the map that it is compared with
- `map`, `session`, `library`: where the robot is, what it measured, the surveyed references
- `pose_sensor`: the seam for sensors of other packages
- `progress`: who hears how far a long work is
- `records`: the values of one step; `radii`: how near is near, for a library
"""
