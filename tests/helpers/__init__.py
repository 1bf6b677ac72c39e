"""What several tests share. Import it as `from helpers.step_records import made`.

- `bags`: small bags of every kind, by `rosbags` or byte by byte
- `commands`: the command in this process
- `filter_world`: a small two-room library, and a drive through it with its truth
- `foxglove_bridge`: a script that serves a drive as a Foxglove bridge
- `live_peers`: peers that send a live session what a test scripts
- `small_session`: a small session and survey on disk
- `step_records`: step records of a few particles, made by hand
"""
