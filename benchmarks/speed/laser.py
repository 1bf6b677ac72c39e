"""One update of a laser: ours beside AMCL's C++ and MRPT, over the same drive and map, in turn.

An update is motion, field, weights, estimate and resampling. Times are processor time of one thread, medians
over the updates of a drive; ratios are within a round. The drive is a simulated one in the office, or with
LASER_LOG a recorded one with scans and true poses, on a map of its own scans.
"""

from __future__ import annotations

import os
import tempfile
from functools import partial
from itertools import islice
from pathlib import Path
from time import thread_time
from typing import Any

import numpy as np

from maurice_datasets.sessions import simulate, simulation_plan
from maurice_datasets.trials.drives import Drive, open_drive
from maurice_datasets.trials.plan import SessionSpec

from .laser_peers import Peer, built, write_drive
from .measure import Table, Times, Work, interleaved, ratio

PARTICLES = (2000, 5000)
BEAMS, UPDATES, ROUNDS = 60, 150, 3
MODELS = {"AMCL": ("field", "prob", "beam"), "MRPT": ("field",)}


def laser(quick: bool) -> Table:
    """Return the time of an update by each filter and number of particles."""
    with tempfile.TemporaryDirectory() as folder:
        return _table(Path(folder), *((60, 1) if quick else (UPDATES, ROUNDS)))


def _table(folder: Path, updates: int, rounds: int) -> Table:
    path = os.environ.get("LASER_LOG", "")
    if not path:
        path = str(
            simulate(
                simulation_plan("tracking", world="office", updates=updates // 2, laser=True),
                folder / "drive",
            ).session  # each movement makes two updates or three
        )
    drive = open_drive(SessionSpec("laser", path=path, mapped="all"), 0)
    moments = list(drive.session.moments())[:updates]
    assert drive.start is not None
    write_drive(folder / "drive.bin", drive.bench.library, moments, drive.start, BEAMS)
    peers = built()
    rows = []
    for particles in PARTICLES:
        works: dict[str, Work] = {"ours": partial(_ours, drive, updates, particles, {})}
        beam = {"sensor.laser.model": "beam"}
        works["ours, ray casting"] = partial(_ours, drive, updates, particles, beam)
        for peer in (peer for peer in peers if peer.program is not None):
            for model in MODELS[peer.name]:
                works[f"{peer.name}, {model}"] = partial(_peer, peer, folder / "drive.bin", model, particles)
        times = interleaved(works, rounds)
        for name, took in times.items():
            base = times["ours, ray casting" if name == "AMCL, beam" else "ours"]
            rows.append(_row(name, particles, took, base))
    notes = [f"{peer.name} is missing: {peer.problem}." for peer in peers if peer.program is None]
    notes.append("The time of ray casting is compared with ours by ray casting, the others with our default.")
    return Table(
        "laser",
        f"One update of a laser, {BEAMS} beams",
        ("filter", "particles", "ms an update", "times ours"),
        rows,
        notes,
    )


def _row(name: str, particles: int, took: Times, base: Times) -> list[str]:
    return [name, f"{particles:,}", f"{1e3 * took.median:.2f}", "1" if took is base else ratio(took, base)]


def _ours(drive: Drive, updates: int, particles: int, settings: dict[str, Any]) -> float:
    """Return the median processor time of an update, in seconds."""
    localizer = drive.bench.localizer({"preset": "laser", "particles": particles, **settings})
    localizer = localizer.of_session(drive.session)
    state, took = localizer.initialize(drive.start), []
    for moment in islice(drive.session.moments(), updates):
        began = thread_time()
        state = localizer.step(state, moment.frame)[0]
        took.append(thread_time() - began)
    return float(np.median(took))


def _peer(peer: Peer, drive: Path, model: str, particles: int) -> float:
    return float(np.median(peer.times(drive, model, particles)[0]))
