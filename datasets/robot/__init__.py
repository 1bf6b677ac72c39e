"""How the simulated robot drives.

- `motion`: what wheels and encoders do, with slip and drift; `drive`: a drive, step by step
- `behaviors`, `planner`: where the robot wants to go; `recorded_path`: following a recorded path instead
- `segments`: what happens between two pictures, and how it is written to a log
"""
