"""What a library of references can tell, before any filter runs. The value `Library` is in `values`.

- `quality`: what a library covers, and how well it distinguishes its own places; `advice`: what to add to it
- `left_out`: whether it can tell its places apart, by leaving each place out
- `drive_score`: whether a drive's pictures fit where they were taken
"""
