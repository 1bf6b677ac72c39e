"""Small files as other programs write them, and what is read from them."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from helpers.recordings import read
from maurice_loaders.reading.options import Reading
from maurice_loaders.reading.recording import Picture

BEGIN_S = 1305031102.1753
BEGIN_NS = 1403636579763555584
STAMPS = [f"{BEGIN_S + 0.1 * k:.6f}" for k in range(3)]
QUARTER = math.sqrt(0.5)
COUNTS = {"Picture": 3, "TruthPose": 3}


def counts(path: Path, options: Reading | None = None) -> dict[str, int]:
    """Count the records, and decode every picture."""
    found, _ = read(path, options)
    assert all(one.read().shape == (4, 6, 3) for one in found if isinstance(one, Picture))
    return dict(Counter(type(one).__name__ for one in found))


def image(file: Path, value: int = 100, bits: int = 8) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    deep = np.full((4, 6), value * 256 + 99, np.uint16)
    cv2.imwrite(str(file), deep if bits == 16 else np.full((4, 6, 3), value, np.uint8))


def write(file: Path, *lines: str | bytes) -> Path:
    """Write lines, or one text or bytes as they are."""
    file.parent.mkdir(parents=True, exist_ok=True)
    data = [line if isinstance(line, bytes) else line.encode() for line in lines]
    file.write_bytes(data[0] if len(data) == 1 else b"\n".join(data) + b"\n")
    return file


def moving(file: Path, code: str = "MJPG", values: Sequence[int] = (0, 50, 100, 150)) -> Path:
    """Write a video of gray frames at 10 Hz."""
    video = cv2.VideoWriter(str(file), cv2.VideoWriter.fourcc(*code), 10, (64, 48))
    for value in values:
        video.write(np.full((48, 64, 3), value, np.uint8))
    video.release()
    return file


def poses(separator: str = " ", stamp: str = "{:.4f}") -> str:
    """Three poses a decimetre apart, looking along +y."""
    rows = [(stamp.format(BEGIN_S + 0.1 * k), 0.1 * k, 2, 0.5, 0, 0, QUARTER, QUARTER) for k in range(3)]
    return "\n".join(separator.join(map(str, row)) for row in rows) + "\n"
