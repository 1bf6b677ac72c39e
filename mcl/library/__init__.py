"""What a library of references can tell, before any filter runs. The value `Library` is in `values`.

Nothing here moves particles or reads files; constants that are fitted to a library belong in `fitting`.

- `quality`: what a library covers, and how well it distinguishes its own places; `advice`: what to add to it
- `drive_score`: whether a drive's pictures fit where they were taken
- `retrieval`: which references its pictures find, as place recognition is measured
- `left_out`: the table of its pictures, each compared with all other places, from which the others read
- `occupancy_building`: the map of a laser, from scans with known poses
"""
