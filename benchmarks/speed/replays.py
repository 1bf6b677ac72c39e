"""Whole replays without the viewer, and what a user waits for."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import cv2
import numpy as np

import maurice_loaders as ml
import maurice_mcl as mcl
from maurice_datasets.demos import demo_paths
from maurice_loaders.libraries.measured import MeasuredPictures
from maurice_mcl.filter.localizer import Localizer
from maurice_mcl.sensor.ahead import compared_ahead
from maurice_mcl.values.arrays import F64
from maurice_mcl.values.session import Moment

from .measure import Table, Work, interleaved, ratio

UPDATES = 100
FILTERS = {
    "color, 5,000": ("color", 5000),
    "blended, 5,000": ("blended", 5000),
    "best, 1,000": ("best", 1000),
}
SIZES = {"176 x 144": (176, 144), "640 x 480": (640, 480)}


@dataclass(frozen=True, slots=True)
class Stored:
    """A drive whose pictures are held as JPEG, and decoded as they are asked for."""

    moments_: Sequence[Moment]
    pictures: Sequence[bytes]

    @classmethod
    def of(cls, session: mcl.Session, size: tuple[int, int]) -> Stored:
        """Hold the first pictures of a session at a size (width, height)."""
        some = [moment for moment, _ in zip(session.moments(), range(UPDATES), strict=False)]
        images = [cv2.resize(moment.frame.image, size) for moment in some]
        return cls(some, [cv2.imencode(".jpg", image)[1].tobytes() for image in images])

    def moments(self) -> Iterator[Moment]:
        """Yield the moments, each with its picture decoded."""
        for moment, picture in zip(self.moments_, self.pictures, strict=True):
            image = cv2.imdecode(np.frombuffer(picture, np.uint8), cv2.IMREAD_COLOR)
            yield replace(moment, frame=replace(moment.frame, image=np.asarray(image, np.uint8)))


def replays(quick: bool) -> Table:
    """Measure updates a second, the first time and again, from the descriptors that are kept in between."""
    paths = demo_paths()
    library, session, rows = ml.build_library(paths.survey), ml.open_session(paths.session), []
    with tempfile.TemporaryDirectory() as folder:
        for size_name, size in SIZES.items():
            stored = Stored.of(session, size)
            for name, (feature, particles) in FILTERS.items():
                filter_ = mcl.make_localizer(library, feature=feature, particles=particles)
                replay = partial(_replay, filter_.of_session(session), stored, session.info.start)
                file = Path(folder) / f"{size_name} {name}"
                replay(file)
                works: dict[str, Work] = {"first": partial(replay, None), "again": partial(replay, file)}
                took = interleaved(works, 2 if quick else 9)
                speeds = [f"{len(stored.pictures) / times.median:,.0f}" for times in took.values()]
                rows.append([size_name, name, *speeds, ratio(took["first"], took["again"])])
    return Table(
        "replays",
        "A replay without the viewer, updates a second",
        ["pictures", "feature, particles", "from pictures", "from kept descriptors", "kept / pictures"],
        rows,
    )


def _replay(localizer: Localizer, stored: Stored, start: F64 | None, file: Path | None) -> None:
    known, state = None if file is None else MeasuredPictures(file), localizer.initialize(start)
    for moment, (picture,) in compared_ahead([localizer.sensor], stored.moments(), known):
        state, _ = localizer.step(state, moment.frame, picture)


COMMANDS = {
    "--help": ["--help"],
    "replay of the demo's drive, blended, 2,000, into a file": ["SESSION", "-o", "OUT", "--force"],
    "the same, --detail light": ["SESSION", "-o", "OUT", "--force", "--detail", "light"],
    "the same without a recording": ["SESSION", "-o", "none"],
    "demo, from a warm cache": ["demo", "-o", "OUT", "--force"],
}


def commands(quick: bool) -> Table:
    """Measure whole commands, from typing to the end, each in a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        places = {"SESSION": str(demo_paths().session), "OUT": str(Path(folder) / "out.rrd")}
        works: dict[str, Work] = {
            name: partial(run, [places.get(word, word) for word in words]) for name, words in COMMANDS.items()
        }
        took = interleaved(works, 1 if quick else 5)
    rows = [[name, f"{times.median:.1f}"] for name, times in took.items()]
    return Table("commands", "Commands, from typing to the end, seconds", ["command", "seconds"], rows)


def run(words: Sequence[str]) -> None:
    """Run our command."""
    command = Path(sys.executable).with_name("maurice-replay")
    subprocess.run([str(command), *words], check=True, capture_output=True)
