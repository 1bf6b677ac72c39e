"""What several tests share. Import it as `from helpers.step_records import made`.

- `filter_world`: a small two-room library, and a drive through it with its truth
- `step_records`: step records of a few particles, made by hand
"""
