"""Does the doctor name what was planted in a recording, and nothing in a healthy one?

    python -m benchmarks.studies.implausible [LOG ...]

Simulated drives (each task, with a camera and with a laser, three seeds) are examined as they are, with
library and truth; so are the recordings named, which are healthy. Then each kind of error is planted in three
drives with a laser, in three sizes, and what is found by the numbers alone is counted. The table is in
docs/doctor.md.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from maurice_datasets.sessions import write_simulation
from maurice_datasets.simulation import SimulationPlan
from maurice_datasets.tasks import TASKS
from maurice_loaders.doctor.examination import examine
from maurice_loaders.doctor.findings import RecordedDrive, RecordedScans
from maurice_loaders.doctor.gathering import Gathered, gather
from maurice_loaders.doctor.plausibility import implausible
from maurice_loaders.libraries.store import open_library
from maurice_loaders.reading.options import ReadingOptions
from maurice_mcl.values import F64, LaserScan

SEEDS, UPDATES, SIZES = (81, 82, 83), 40, 3
USUAL = ReadingOptions()
Planted = tuple[RecordedDrive, RecordedScans]


def _odometry(gathered: Gathered, change: Callable[[F64], None]) -> Planted:
    odometry = gathered.drive.odometry
    values = odometry.values.copy()
    change(values)
    return replace(gathered.drive, odometry=replace(odometry, values=values)), gathered.scans


def jump(gathered: Gathered, size: int) -> Planted:
    """Odometry jumps by some meters in one record."""

    def apart(values: F64) -> None:
        values[len(values) // 2, 0] += (20.0, 100.0, 6553.6)[size]

    return _odometry(gathered, apart)


def few_digits(gathered: Gathered, size: int) -> Planted:
    """Times have too few digits: ten seconds, a minute, or the whole drive are alike."""
    step_s, drive, scans = (10.0, 60.0, 1e6)[size], gathered.drive, gathered.scans
    odometry = replace(drive.odometry, t_s=np.floor(drive.odometry.t_s / step_s) * step_s)
    return replace(drive, odometry=odometry), replace(scans, t_s=np.floor(scans.t_s / step_s) * step_s)


def _scans(gathered: Gathered, change: Callable[[int, LaserScan], F64]) -> Planted:
    scans = tuple(
        replace(scan, ranges_m=change(number, scan).astype(np.float32))
        for number, scan in enumerate(gathered.scans.scans)
    )
    return gathered.drive, replace(gathered.scans, scans=scans)


def no_return(gathered: Gathered, size: int) -> Planted:
    """Beams that hit nothing, a tenth at least, read a range below the reach, in two sizes with noise."""
    rng = np.random.default_rng(size)

    def capped(_: int, scan: LaserScan) -> F64:
        nothing = ~scan.hits | (rng.random(scan.size) < 0.1)
        spread_m = (0.0, 0.01, 0.03)[size]
        return np.where(nothing, scan.max_m - 0.05 - rng.uniform(0, spread_m, scan.size), scan.ranges_m)

    return _scans(gathered, capped)


def no_hits(gathered: Gathered, size: int) -> Planted:
    """Scans in a row hit nothing: a third of the drive reads 0, no number, or infinity."""
    value, count = (0.0, np.nan, np.inf)[size], gathered.scans.size
    return _scans(
        gathered,
        lambda number, scan: (
            np.full(scan.size, value) if count // 3 <= number < 2 * count // 3 else np.array(scan.ranges_m)
        ),
    )


KINDS: dict[str, tuple[str, Callable[[Gathered, int], Planted]]] = {
    "odometry jumps 20, 100, 6553.6 m": ("odometry-jump", jump),
    "times alike for 10 s, 60 s, the drive": ("times-coarse", few_digits),
    "no-return readings 5 cm below the reach, noise 0, 1, 3 cm": ("max-range", no_return),
    "a third of the scans reads 0, NaN, infinity": ("scans-empty", no_hits),
}


def simulated(folder: Path) -> list[tuple[Path, Path]]:
    """Write the drives into a folder; return each session and its library."""
    written = []
    for task in TASKS:
        for laser in (False, True):
            for seed in SEEDS:
                plan = SimulationPlan(
                    TASKS[task], world="office", arena_seed=seed, seed=seed, updates=UPDATES, laser=laser
                )
                drive = write_simulation(folder / f"{task}-{'laser' if laser else 'camera'}-{seed}", plan)
                written.append((drive.session, drive.survey))
    return written


def main() -> None:
    """Print false alarms by drive, and a row for each kind."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.studies.implausible", description=__doc__)
    parser.add_argument("logs", nargs="*", type=Path, help="healthy recordings of your own")
    logs = parser.parse_args().logs
    with tempfile.TemporaryDirectory() as folder:
        drives = simulated(Path(folder))
        alarms = 0
        for session, library in [*drives, *((log, None) for log in logs)]:
            opened = None if library is None else open_library(library)
            codes = [finding.code for finding in examine(session, USUAL, opened).findings]
            alarms += bool(codes)
            name = session.parent.name if library is not None else session.name
            print(f"{name}: {', '.join(codes) or 'nothing'}")
        print(f"\n{alarms} of {len(drives) + len(logs)} healthy drives have a finding\n")
        lasers = [gather(session, USUAL) for session, _ in drives if "-laser-" in session.parent.name]
        print("| planted | finding | named | others named |\n|---|---|---|---|")
        for what, (code, plant) in KINDS.items():
            cases = [plant(lasers[3 * k], size) for k in range(3) for size in range(SIZES)]
            codes_of = [[finding.code for finding in implausible(*case)] for case in cases]
            named, others = (
                sum(code in codes for codes in codes_of),
                sum(bool(set(codes) - {code}) for codes in codes_of),
            )
            print(f"| {what} | `{code}` | {named} of {len(cases)} | {others} |")


if __name__ == "__main__":
    main()
