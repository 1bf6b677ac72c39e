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
from maurice_mcl.arrays import F32
from maurice_mcl.filter.localizer import Localizer
from maurice_mcl.sensor.ahead import Compared
from maurice_mcl.session import Moment
from maurice_viz.playback import FilterRun, run_together

from .measure import Table, Work, interleaved

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
    """Measure updates a second, from pictures and from descriptors that were measured before."""
    paths = demo_paths()
    library, session, rows = ml.build_library(paths.survey), ml.open_session(paths.session), []
    for size_name, size in SIZES.items():
        stored = Stored.of(session, size)
        for name, (feature, particles) in FILTERS.items():
            localizer = mcl.make_localizer(library, feature=feature, particles=particles).of_session(session)
            described = [localizer.sensor.measure(moment.frame.image) for moment in stored.moments()]
            works: dict[str, Work] = {
                "pictures": partial(_from_pictures, localizer, stored, session),
                "descriptors": partial(_from_descriptors, localizer, stored, described, session),
            }
            took = interleaved(works, 2 if quick else 9)
            rows.append(
                [size_name, name, *(f"{len(described) / times.median:,.0f}" for times in took.values())]
            )
    return Table(
        "replays",
        "A replay without the viewer, updates a second",
        ["pictures", "feature, particles", "from pictures", "from cached descriptors"],
        rows,
    )


def _from_pictures(localizer: Localizer, stored: Stored, session: mcl.Session) -> None:
    run = FilterRun("run", localizer, session.info.start)
    for _ in run_together([run], stored.moments()):
        pass


def _from_descriptors(
    localizer: Localizer, stored: Stored, described: Sequence[dict[str, F32]], session: mcl.Session
) -> None:
    state = localizer.initialize(session.info.start)
    for moment, descriptors in zip(stored.moments_, described, strict=True):
        compared = Compared(localizer.sensor.compare(descriptors), 0.0)
        state, _ = localizer.step(state, moment.frame, compared)


COMMANDS = {
    "--help": ["--help"],
    "replay of the demo's drive, blended, 2,000, into a file": ["SESSION", "--rrd", "OUT", "--force"],
    "the same, --detail light": ["SESSION", "--rrd", "OUT", "--force", "--detail", "light"],
    "the same without a recording": ["SESSION", "--rrd", "none"],
    "demo, from a warm cache": ["demo", "--rrd", "OUT", "--force"],
}


def commands(quick: bool) -> Table:
    """Measure whole commands, from typing to the end, each in a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        places = {"SESSION": str(demo_paths().session), "OUT": str(Path(folder) / "out.rrd")}
        works: dict[str, Work] = {
            name: partial(_run, [places.get(word, word) for word in words])
            for name, words in COMMANDS.items()
        }
        took = interleaved(works, 1 if quick else 5)
    rows = [[name, f"{times.median:.1f}"] for name, times in took.items()]
    return Table("commands", "Commands, from typing to the end, seconds", ["command", "seconds"], rows)


def _run(words: Sequence[str]) -> None:
    command = Path(sys.executable).with_name("maurice-replay")
    subprocess.run([str(command), *words], check=True, capture_output=True)
