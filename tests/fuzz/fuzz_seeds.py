"""Inputs that are right, from which wrong ones are made: session logs, survey logs, CMUcam dumps."""

from __future__ import annotations

import base64
import json
from typing import Any

import numpy as np

from maurice_loaders.pictures import encode_jpeg

HEADER: dict[str, Any] = {"format": "maurice-session-log", "version": 1, "kind": "session", "name": "drive"}
FULL: dict[str, Any] = HEADER | {
    "robot": {"name": "Maurice", "motion": {"gain": [1.0, 1.0], "noise": {"wood": [0.1, 0.2]}}},
    "cameras": {"front": {"width_px": 8, "height_px": 6, "horizontal_fov_rad": 1.0, "yaw_rad": 0.1}},
    "display_units": "in",
    "survey": "survey/survey.log",
    "start": [1, 2.5, 0.3],
    "map": {
        "bounds_m": [0, 0, 4, 3],
        "walls_m": [[0, 0, 4, 0], [4, 0, 4, 3]],
        "floors": [{"name": "wood", "polygon_m": [[0, 0], [4, 0], [4, 3]]}],
    },
    "notes": ["one", "two"],
}
JPEG = encode_jpeg(np.full((6, 8, 3), 90, np.uint8))
PICTURE = base64.b64encode(JPEG).decode()
ON_DISK = "a.jpg"  # beside every log that is tried


def line(value: object) -> bytes:
    return json.dumps(value).encode() + b"\n"


def records(times: list[float], image: object, **more: Any) -> list[bytes]:
    found = []
    for t in times:
        found += [{"t": t, "odometry": [0.1, 0, 0.2]}, {"t": t, "truth": [t % 10, 1, 0.5]}]
        found += [{"t": t, "image": image} | more, {"t": t, "event": "bump"}]
    return [line(one) for one in found]


INLINE = {"base64": PICTURE}
LOGS = [
    b"".join([line(HEADER), *records([0, 1, 2], INLINE)]),
    b"".join([line(FULL), *records([1e9, 1e9 + 0.5], INLINE, camera="front")]),
    b"".join([line(FULL), line({"t": 0, "odometry": [0, 0, 0], "encoders_m": [1, 1, 1, 1]})]),
    b"".join([line(HEADER), *records([-1, 0], ON_DISK, covered=False), *records([3], INLINE, covered=True)]),
    b"".join([line(HEADER | {"kind": "survey"}), *records([0, 1], ON_DISK, pose=[1, 2, 3])]),
    b"".join([line(FULL | {"kind": "survey"}), *records([0], INLINE, pose=[1, 2, 3], covered=True)]),
]
STREAMS = [one for one in LOGS if b'"survey", "name"' not in one]  # what a live source may say


def _rows(seed: int, width: int, height: int) -> list[bytes]:
    values = np.random.default_rng(seed).integers(16, 241, (height, 3 * width), dtype=np.uint8)
    return [row.tobytes() for row in values]


SIZE = bytes([5, 4])
FRAMES = [
    b"\1" + SIZE + b"".join(b"\2" + row for row in _rows(0, 5, 4)) + b"\3",
    b"\1" + SIZE + b"".join(_rows(1, 5, 4)) + b"\3",
    b"\1" + SIZE + b"\2".join(_rows(2, 5, 4)) + b"\3",
    b"\1" + b"".join(b"\2" + row for row in _rows(3, 4, 5)) + b"\3",
    b"\1" + SIZE + b"\2" + b"".join(_rows(4, 5, 4)) + b"\3",
]
DUMPS = [
    *FRAMES,
    b"CMUcam2 v1.00 c6\r:ACK\r" + b":ACK\r".join(FRAMES) + b":",
    b"\1" + b"".join(b"\2" + row for row in _rows(5, 87, 143)) + b"\3" + FRAMES[0],
]
