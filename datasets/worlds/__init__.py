"""Worlds: from a plan (TOML, docs/simulate.md) and a seed to rooms with walls, furniture and textures.

- `plan`, `read_plan`, `toml_table`: a world file and its checks; `build`, `world`: the world of a plan
- `shell`, `openings`, `solids`: walls, doors, windows, boxes
- `furniture`, `hangings`, `wall_pictures`: what is in the rooms
- `textures`, `palettes`: paints; `draw`: drawing them; `rearrange`: furniture moved after the survey, rooms
  that are twins
"""
