"""Does the doctor name what was planted in a recording, and nothing in a healthy one?

    python -m benchmarks.studies.implausible [LOG ...]

Simulated drives (each task, with a camera and with a laser, three seeds) are examined as they are, with
library and truth; so are the recordings named, which are healthy. Then each kind of error is planted in three
drives with a laser, in three sizes, and what is found is counted: by the numbers alone, on the map at true
poses, by the reader of a bag, or by diagnosing a run. The table is in docs/doctor.md.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from rosbags.rosbag2 import Writer

import maurice_mcl as mcl
from maurice_datasets.sessions import write_simulation
from maurice_datasets.simulation import SimulationPlan
from maurice_datasets.tasks import TASKS
from maurice_datasets.trials.drives import RenderedSession
from maurice_datasets.trials.stretches import Stretches
from maurice_loaders.doctor.examination import examine
from maurice_loaders.doctor.findings import RecordedDrive, RecordedScans
from maurice_loaders.doctor.gathering import Gathered, gather
from maurice_loaders.doctor.plausibility import implausible
from maurice_loaders.doctor.scans import examine_scans
from maurice_loaders.doctor.scans_on_map import examine_map
from maurice_loaders.export.ros_messages import Messages, message_types
from maurice_loaders.formats.registry import open_session
from maurice_loaders.libraries.store import open_library
from maurice_loaders.reading.options import Reading
from maurice_mcl import make_localizer
from maurice_mcl.config.parameters import ALPHAS
from maurice_mcl.reasons.causes import START
from maurice_mcl.reasons.diagnosis import DiagnosisBuilder
from maurice_mcl.values import F64, LaserScan, Library, OccupancyMap

SEEDS, UPDATES, SIZES = (81, 82, 83), 40, 3
USUAL = Reading()
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


@dataclass(frozen=True)
class Case:
    """A healthy drive with a laser, in which something is planted."""

    session: Path
    library: Library
    gathered: Gathered


Named = Callable[[Case, int], Collection[str]]  # what is named of a drive with an error planted in it


def numbers_alone(plant: Callable[[Gathered, int], Planted]) -> Named:
    """Return what is named of a drive's numbers."""
    return lambda case, size: [finding.code for finding in implausible(*plant(case.gathered, size))]


def _on_map(case: Case, occupancy: OccupancyMap, scans: RecordedScans) -> Collection[str]:
    drive = replace(case.gathered.drive, picture_t_s=scans.t_s, sees="scans")
    scans, about, _ = examine_scans(scans, drive, USUAL.max_dt_s)
    return [finding.code for finding in [*about, *examine_map(scans, drive, occupancy, about)[0]]]


def misplaced(case: Case, size: int) -> Collection[str]:
    """The laser stands elsewhere than its transform."""
    away = np.array([((0.4, 0.0), (-0.2, 0.3), (0.2, -0.2))[size]])
    mounts = [scan.mount - np.append(away, 0.0) for scan in case.gathered.scans.scans]
    pairs = zip(case.gathered.scans.scans, mounts, strict=True)
    scans = tuple(replace(scan, mount=mount) for scan, mount in pairs)
    return _on_map(case, _grid(case), replace(case.gathered.scans, scans=scans))


def mirrored_map(case: Case, size: int) -> Collection[str]:
    """The map is mirrored, or turned by 180 degrees."""
    cells = _grid(case).cells[:: (1, -1, -1)[size], :: (-1, 1, -1)[size]].copy()
    return _on_map(case, replace(_grid(case), cells=cells), case.gathered.scans)


def scaled_map(case: Case, size: int) -> Collection[str]:
    """The map's cells have another size."""
    scaled = replace(_grid(case), cell_m=_grid(case).cell_m * (0.95, 1.03, 1.25)[size])
    return _on_map(case, scaled, case.gathered.scans)


def _grid(case: Case) -> OccupancyMap:
    assert case.library.occupancy is not None
    return case.library.occupancy


def turned_start(case: Case, size: int) -> Collection[str]:
    """AMCL begins at the place of the first scan, in another heading."""
    session = open_session(case.session)
    moments = Stretches.of(session.moments(), _grid(case)).of_run(0, 0, None)
    seen = RenderedSession(session.info, moments)
    # with Nav2's alphas a turn on the spot spreads the cloud over all headings, and a wrong one does no harm
    motion = {"model": "odometry", **dict.fromkeys(ALPHAS, 0.02)}
    settings = {"sensor.laser.model": "likelihood_field_prob", "motion": motion}
    localizer = make_localizer(case.library, preset="amcl", settings=settings).of_session(seen)
    builder, begin = DiagnosisBuilder(localizer), moments[0].truth
    assert begin is not None
    start = begin + np.array([0.0, 0.0, np.radians((180.0, 150.0, -120.0)[size])])
    for moment, record in mcl.run(localizer, seen, start):
        builder.add(moment, record)
    return [f.kind for f in builder.result()[:1] if f.kind != START or "start_turned_deg" in f.evidence]


def still_poses(case: Case, size: int) -> Collection[str]:
    """Odometry's poses never move, and its speeds do: in a bag of ROS 2."""
    store, speed_m_s = message_types(), (0.2, 0.5, 1.0)[size]
    t_s, path = case.gathered.drive.odometry.t_s, case.session.parent / f"still-{size}"
    vector, kinds = store.types["geometry_msgs/msg/Vector3"], ("nav_msgs/msg/Odometry", LASER_SCAN)
    with Writer(path, version=9) as writer:
        odom, scan = (
            writer.add_connection(topic, kind, typestore=store)
            for topic, kind in zip(("/odom", "/scan"), kinds, strict=True)
        )
        for number, at_s in enumerate(t_s):
            t_ns = 10**18 + round(at_s * 1e9)
            messages = Messages(store, t_ns)
            still = store.deserialize_cdr(messages.odometry("odom", "base_link", np.zeros(3)), kinds[0])
            still.twist.twist.linear = vector(speed_m_s, 0.0, 0.0)
            writer.write(odom, t_ns, store.serialize_cdr(still, kinds[0]))
            if number < case.gathered.scans.size:
                writer.write(scan, t_ns, messages.scan("base_link", case.gathered.scans.scans[number]))
    return ["added up"] if any("they are added up" in note for note in open_session(path).info.notes) else []


LASER_SCAN = "sensor_msgs/msg/LaserScan"
KINDS: dict[str, tuple[str, Named]] = {
    "odometry jumps 20, 100, 6553.6 m": ("odometry-jump", numbers_alone(jump)),
    "times alike for 10 s, 60 s, the drive": ("times-coarse", numbers_alone(few_digits)),
    "no-return readings 5 cm below the reach, noise 0, 1, 3 cm": ("max-range", numbers_alone(no_return)),
    "a third of the scans reads 0, NaN, infinity": ("scans-empty", numbers_alone(no_hits)),
    "the laser stands 0.4 m ahead, 0.36 and 0.28 m aslant": ("scan-place", misplaced),
    "the map is mirrored left to right, upside down, turned by 180 deg": ("map-mirrored", mirrored_map),
    "the map's cells are 0.95, 1.03, 1.25 times as large": ("map-scale", scaled_map),
    "AMCL begins turned by 180, 150, -120 deg": (START, turned_start),
    "poses that never move, with speeds of 0.2, 0.5, 1 m/s": ("added up", still_poses),
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
        lasers = [
            Case(session, open_library(library), gather(session, USUAL))
            for session, library in drives
            if "-laser-" in session.parent.name
        ]
        print("| planted | finding | named | others named |\n|---|---|---|---|")
        for what, (code, named_of) in KINDS.items():
            codes_of = [set(named_of(lasers[3 * k], size)) for k in range(3) for size in range(SIZES)]
            named = sum(code in codes for codes in codes_of)
            others = sum(bool(codes - {code}) for codes in codes_of)
            print(f"| {what} | `{code}` | {named} of {len(codes_of)} | {others} |", flush=True)


if __name__ == "__main__":
    main()
