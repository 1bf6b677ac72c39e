"""One view under each condition, docs/pictures/conditions.png: .venv/bin/python docs/make_conditions.py."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from maurice_datasets.render.camera_session import session_camera
from maurice_datasets.render.conditions import Conditions, parse_lights
from maurice_datasets.worlds.build import load_world

OUT = Path(__file__).parent / "pictures" / "conditions.png"
POSE = np.array([2.95, 2.49, -0.785])
LAST = 50  # the picture's number: everything has happened by then
COLUMNS, MARGIN, TITLE_PX, SCALE = 4, 6, 22, 2

CASES: dict[str, tuple[int, Conditions]] = {
    "as at the survey": (LAST, Conditions()),
    "dim@40": (LAST, Conditions(parse_lights("dim@40"))),
    "off:east room lamp@40": (LAST, Conditions(parse_lights("off:east room lamp@40"))),
    "daylight@20-50": (LAST, Conditions(parse_lights("daylight@20-50"))),
    "automatic gain": (LAST, Conditions(gain="auto")),
    "gain 20 % up, white balance 7 % off": (103, Conditions(drift=0.2, tint=0.2)),
    "half resolution": (LAST, Conditions(half_resolution=True)),
    "people in view": (47, Conditions(occluded=1.0)),
}


def tile(title: str, picture: np.ndarray) -> np.ndarray:
    """Enlarge a picture and write above it what it shows."""
    large = cv2.resize(picture, None, fx=SCALE, fy=SCALE, interpolation=cv2.INTER_NEAREST)
    framed = cv2.copyMakeBorder(
        large, TITLE_PX, MARGIN, MARGIN, MARGIN, cv2.BORDER_CONSTANT, value=(255,) * 3
    )
    cv2.putText(framed, title, (MARGIN, 15), cv2.FONT_HERSHEY_SIMPLEX, 0.45, (40, 40, 40), 1, cv2.LINE_AA)
    return framed


def main() -> None:
    world = load_world("two-rooms", 0)
    tiles = []
    for title, (number, conditions) in CASES.items():
        picture = session_camera(world, 0, conditions).take(number, POSE)
        tiles.append(tile(title, (picture // 16 * 16 + 8).astype(np.uint8)))  # 16 levels: noise packs badly
    rows = [np.hstack(tiles[k : k + COLUMNS]) for k in range(0, len(tiles), COLUMNS)]
    sheet = cv2.cvtColor(np.vstack(rows), cv2.COLOR_RGB2BGR)
    cv2.imwrite(str(OUT), sheet, [cv2.IMWRITE_PNG_COMPRESSION, 9])
    print(OUT, OUT.stat().st_size // 1000, "kB")


if __name__ == "__main__":
    main()
