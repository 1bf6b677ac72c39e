"""Inputs that are right, and wrong ones out of them: bytes, lines and JSON values changed, by a seed."""

from __future__ import annotations

import base64
import json
from collections.abc import Callable, Sequence
from random import Random
from typing import Any

import numpy as np

from maurice_loaders.files.pictures import encode_jpeg

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


def json_line(value: object) -> bytes:
    return json.dumps(value).encode() + b"\n"


def records(times: list[float], image: object, **more: Any) -> list[bytes]:
    found = []
    for t in times:
        found += [{"t": t, "odometry": [0.1, 0, 0.2]}, {"t": t, "truth": [t % 10, 1, 0.5]}]
        found += [{"t": t, "image": image} | more, {"t": t, "event": "bump"}]
    return [json_line(one) for one in found]


INLINE = {"base64": PICTURE}
SCAN = {"ranges_m": [1.5, None, "inf", 8.5], "start_rad": -1, "step_rad": 0.5, "min_m": 0.1, "max_m": 8}
SCANS = [  # of a robot with a laser
    {"t": 0, "odometry_pose": [0, 0, 0]},
    {"t": 0, "scan": SCAN},
    {"t": 1, "odometry_pose": [0.4, 0, 0.1]},
    {"t": 1, "truth": [1, 1, 0]},
    {"t": 1, "scan": SCAN | {"mount": [0.1, 0, 3]}},
]
LOGS = [
    b"".join([json_line(HEADER), *records([0, 1, 2], INLINE)]),
    b"".join([json_line(FULL), *records([1e9, 1e9 + 0.5], INLINE, camera="front")]),
    b"".join([json_line(FULL), json_line({"t": 0, "odometry": [0, 0, 0], "encoders_m": [1, 1, 1, 1]})]),
    b"".join(
        [json_line(HEADER), *records([-1, 0], ON_DISK, covered=False), *records([3], INLINE, covered=True)]
    ),
    b"".join([json_line(HEADER), *map(json_line, SCANS)]),
    b"".join(
        [
            json_line(HEADER),
            *map(json_line, SCANS),
            *records([1, 1.05], INLINE),
            json_line(SCANS[-1] | {"t": 2}),
        ]
    ),
    b"".join([json_line(HEADER | {"kind": "survey"}), *records([0, 1], ON_DISK, pose=[1, 2, 3])]),
    b"".join([json_line(FULL | {"kind": "survey"}), *records([0], INLINE, pose=[1, 2, 3], covered=True)]),
]
STREAMS = [one for one in LOGS if b'"survey", "name"' not in one]  # what a live source may say


_POSES = "0.3 0 0.1 0.3 0 0.1"
CARMEN = [
    f"ODOM 0.1 0 0 0 0 0 1 h 1\nFLASER 3 1 nan 81.91 {_POSES} 1 h 1\nTRUEPOS {_POSES} 1 h 1\n",
    f"RLASER 2 1 2 {_POSES} 1 h 1\nODOM 0.3 0 0.1 0 0 0 0 h 0\nRLASER 2 1 2 {_POSES} 2 h 2\n",
    f"ROBOTLASER1 0 -1.57 3.14 1.57 80 0.01 0 3 1 2 3 0 {_POSES} 0 0 0.3 0.3 1e6 1 h 1\n" * 2,
]


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


MOST_BYTES = 200_000  # of a mutated input
TOKENS = [
    *b'NaN Infinity -1e999 1e400 null true "" {} [] { [ \\ud800'.split(),
    *(b"\0", b"\xff", b"\xef\xbb\xbf", b"\r", b"\n", b"\1", b"\2", b"\3", b"\xff\xd8\xff", b"\xe2\x80\xa8"),
    *(b'"t": 1e308, ', b'"image": "../a.jpg", ', b'"format": "maurice-session-log", ', b"9" * 5000),
    *(b"[" * 3000, b'{"a":' * 3000, b"\1\2\3" * 50),
]
VALUES: list[Any] = [
    *(None, True, False, 0, -1, 1, 0.5, 3, 255, 1e9, 4e9, 4.1e9, -4e9, 1e308, -1e308, 5e-324, 10**30, 2**64),
    *("", "a", "a.jpg", ".", "/", "../a.jpg", "NaN", "\0", "\ud800", "x" * 300, "session", "survey", "none"),
    *([], {}, [0, 0, 0], [1e9] * 3, [1, 2], [[]], [[0, 0], [1, 0], [1, 1]], [0, 0, 0, 0], ["a"], {"": {}}),
    *({"base64": ""}, {"base64": "AAAA"}, {"base64": "/9j/"}, {"base64": "####"}, {"base64": None}),
    *("jpeg", "h264", "rgb8", "bayer_rggb8", "/odom", "odom", "protobuf", "advertise", "foxglove.RawImage"),
]


def mutated(data: bytes, others: Sequence[bytes], random: Random) -> bytes:
    """Give a changed copy, by one to four changes."""
    for _ in range(random.choice((1, 1, 1, 2, 2, 4))):
        data = random.choice(CHANGES)(data, others, random)[:MOST_BYTES]
    return data


def _span(data: bytes, random: Random) -> tuple[int, int]:
    begin = random.randint(0, len(data))
    return begin, min(len(data), begin + random.choice((1, 1, 2, 4, 16, 100)))


def _flip(data: bytes, others: Sequence[bytes], random: Random) -> bytes:
    if not data:
        return data
    changed = bytearray(data)
    for _ in range(random.choice((1, 1, 3, 20))):
        changed[random.randrange(len(changed))] ^= 1 << random.randrange(8)
    return bytes(changed)


def _overwrite(data: bytes, others: Sequence[bytes], random: Random) -> bytes:
    begin, end = _span(data, random)
    return data[:begin] + random.randbytes(end - begin) + data[end:]


def _delete(data: bytes, others: Sequence[bytes], random: Random) -> bytes:
    begin, end = _span(data, random)
    return data[:begin] + data[end:]


def _insert(data: bytes, others: Sequence[bytes], random: Random) -> bytes:
    at = random.randint(0, len(data))
    return data[:at] + random.choice(TOKENS) + data[at:]


def _repeat(data: bytes, others: Sequence[bytes], random: Random) -> bytes:
    begin, end = _span(data, random)
    return data[:begin] + data[begin:end] * random.choice((2, 5, 100)) + data[end:]


def _cut(data: bytes, others: Sequence[bytes], random: Random) -> bytes:
    return data[: random.randint(0, len(data))]


def _splice(data: bytes, others: Sequence[bytes], random: Random) -> bytes:
    other = random.choice(others)
    return data[: random.randint(0, len(data))] + other[random.randint(0, len(other)) :]


def _shuffle_lines(data: bytes, others: Sequence[bytes], random: Random) -> bytes:
    lines = data.splitlines(keepends=True)
    if len(lines) < 2:
        return data
    one, other = random.randrange(len(lines)), random.randrange(len(lines))
    if random.random() < 0.5:
        lines[one], lines[other] = lines[other], lines[one]
    else:
        lines.insert(one, lines[other])
    return b"".join(lines)


def _value(data: bytes, others: Sequence[bytes], random: Random) -> bytes:
    """Put another value somewhere into the JSON of a line."""
    lines = data.splitlines(keepends=True) or [b"{}"]
    at = random.randrange(len(lines))
    try:
        found = json.loads(lines[at])
    except (ValueError, RecursionError):
        return _flip(data, others, random)
    lines[at] = json.dumps(_with_another_value(found, random)).encode() + b"\n"
    return b"".join(lines)


def _with_another_value(found: Any, random: Random) -> Any:
    if random.random() < 0.25 or not found or not isinstance(found, dict | list):
        return random.choice(VALUES)
    changed: Any = found.copy()
    if isinstance(changed, list):
        at = random.randrange(len(changed))
        changed[at] = _with_another_value(changed[at], random)
        return changed
    key = random.choice(list(changed))
    if random.random() < 0.1:
        del changed[key]
    else:
        changed[key] = _with_another_value(changed[key], random)
    return changed


Change = Callable[[bytes, Sequence[bytes], Random], bytes]
CHANGES: list[Change] = [_flip, _overwrite, _delete, _insert, _repeat, _cut, _splice, _shuffle_lines]
CHANGES += [_value] * 6
