"""Files of other programs as our session and survey logs: `pictures` with a `pose_table`."""
