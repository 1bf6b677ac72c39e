"""A world of one small room, which is surveyed in a second."""

from __future__ import annotations

from pathlib import Path

ROOM = """
format = 1
name = "closet"
units = "cm"
height = 220
[library]
anchor = [20, 20]
spacing = 40
headings = 4
clearance = 12
[style.any]
walls = [
  { texture = "wallpaper", color = "teal", other = "cream", size = 20 },
  { texture = "brick", color = "terracotta" },
  { texture = "plaster", color = "mustard" },
  { texture = "panelling", color = "oak" },
]
lamp = { brightness = 1.1, color = "neutral" }
ambient = 0.4
[[room]]
name = "closet"
rect = [0, 0, 200, 160]
style = "any"
[[floor]]
name = "wood"
paint = { texture = "planks", color = "oak", size = 12 }
"""


def write_small_room(folder: Path) -> Path:
    """Write the world into a folder and return its file."""
    file = folder / "closet.toml"
    file.write_text(ROOM)
    return file
