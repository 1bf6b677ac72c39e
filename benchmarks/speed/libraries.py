"""How long opening a library takes: the first time, and again when nothing has changed.

    python -m benchmarks libraries

The libraries have a small picture a reference and every channel, with random descriptors. Each is opened in a
process of its own; importing is not counted.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from maurice_loaders.files.pictures import encode_jpeg
from maurice_loaders.libraries.files import save_library
from maurice_mcl.sensor.descriptors.registry import CHANNELS, OUR_NAMES
from maurice_mcl.values.library import ChannelIndex, Library
from maurice_mcl.values.map import open_arena

from .measure import Table

SIZES = (624, 4272, 10_000)
LARGEST, FEW = 100_000, ("color", "edges")  # of few channels: all of them would be 600 MB
SETTLED_S = 2.1  # younger files are read again
OPEN = """
import sys, time
from pathlib import Path
import polars
from maurice_loaders.libraries.store import open_library
began = time.perf_counter()
open_library(Path(sys.argv[1]))
print(time.perf_counter() - began)
"""


def libraries(quick: bool) -> Table:
    """Measure seconds to open a library folder."""
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for size in SIZES if quick else (*SIZES, LARGEST):
            place = Path(folder) / str(size)
            names = FEW if size == LARGEST else OUR_NAMES
            save_library(random_library(size, Path(folder), names), place)
            time.sleep(SETTLED_S)
            first = _opened(place, Path(folder) / f"cache-{size}")
            again = [_opened(place, Path(folder) / f"cache-{size}") for _ in range(1 if quick else 5)]
            rows.append([f"{size:,}", f"{first:.3f}", f"{np.median(again):.3f}"])
    return Table(
        "libraries",
        f"Opening a library, seconds: of every channel, the largest of {len(FEW)}",
        ["references", "first time", "again"],
        rows,
    )


def random_library(size: int, folder: Path, names: Sequence[str] = OUR_NAMES) -> Library:
    """Return a library of random references in a square, eight at a place."""
    rng = np.random.default_rng(0)
    picture, image = folder / "picture.jpg", rng.integers(0, 256, (48, 64, 3), np.uint8)
    picture.write_bytes(encode_jpeg(image))
    side = int(np.ceil(np.sqrt(size / 8)))
    number = np.arange(size)
    place, heading = number // 8, (number % 8) * (np.pi / 4) - np.pi
    poses = np.column_stack([0.5 * (place % side), 0.5 * (place // side), heading])
    index = {}
    for name in names:
        length = len(CHANNELS[name].describe(image))
        rows = rng.random((size, length), np.float32)
        index[name] = ChannelIndex(rows, np.zeros(length, np.float32), rows.max(axis=0))
    return Library("random", poses, (picture,) * size, index, open_arena(poses))


def _opened(place: Path, cache: Path) -> float:
    printed = subprocess.run(
        [sys.executable, "-c", OPEN, str(place)],
        env=os.environ | {"MAURICE_CACHE": str(cache)},
        check=True,
        capture_output=True,
        text=True,
    )
    return float(printed.stdout)
