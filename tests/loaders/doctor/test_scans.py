"""What is wrong with scans, planted in a simulated drive and in real logs; healthy ones are left alone."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from maurice_datasets.sessions import write_simulation
from maurice_datasets.simulation import SimulationPlan
from maurice_datasets.tasks import TASKS
from maurice_loaders.doctor.examination import Examination, examine
from maurice_loaders.doctor.findings import Finding, RecordedScans
from maurice_loaders.doctor.gathering import gather
from maurice_loaders.doctor.map_at_truth import ScansAtTruth
from maurice_loaders.formats.registry import open_session
from maurice_loaders.libraries.store import open_library
from maurice_loaders.reading.options import Reading
from maurice_mcl.sensor.map_places import map_library
from maurice_mcl.values import OCCUPIED, Library, OccupancyMap
from maurice_viz.text.findings import describe

LOGS = Path(os.environ.get("MAURICE_DATA", "../shared/data")) / "logs"
USUAL = Reading()


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Library]:
    folder = tmp_path_factory.mktemp("scans") / "s"
    plan = SimulationPlan(TASKS["tracking"], world="office", arena_seed=2, seed=3, updates=60, laser=True)
    written = write_simulation(folder, plan)
    return written.session, open_library(written.survey)


def broken(log: Path, to: Path, change: Callable[[dict[str, Any]], None]) -> Path:
    lines = []
    for line in log.read_text(encoding="utf-8").splitlines():
        record = json.loads(line) if line.startswith("{") else {}
        if "scan" in record:
            change(record["scan"])
            line = json.dumps(record)
        lines.append(line)
    to.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return to


def codes(found: Examination) -> list[str]:
    return [finding.code for finding in found.findings]


def test_a_healthy_drive_has_nothing_wrong(drive: tuple[Path, Library]) -> None:
    found = examine(drive[0], USUAL, drive[1])
    assert codes(found) == []
    log = open_session(drive[0], min_distance_m=0.0)
    assert found.scans == sum(1 for _ in log.moments()) > 200
    assert any("scans against the map" in check for check in found.checks)


@pytest.mark.parametrize("yaw_deg", [20, -90])
def test_a_laser_turned_on_the_robot_is_found_and_put_right(
    drive: tuple[Path, Library], tmp_path: Path, yaw_deg: float
) -> None:
    def turned(scan: dict[str, Any]) -> None:
        scan["start_rad"] += np.radians(yaw_deg)

    log = broken(drive[0], tmp_path / "turned.log", turned)
    found = examine(log, USUAL, None)
    assert codes(found) == ["scan-yaw"]
    fixed = np.degrees(found.fixed.scan_yaw_rad)
    assert abs((fixed + yaw_deg + 180) % 360 - 180) <= 4
    assert codes(examine(log, found.fixed, drive[1])) == []


@pytest.mark.parametrize("place_m", [(0.2, 0.0), (-0.15, 0.1)])
def test_a_laser_elsewhere_on_the_robot_is_found(
    drive: tuple[Path, Library], tmp_path: Path, place_m: tuple[float, float]
) -> None:
    def moved(scan: dict[str, Any]) -> None:
        x, y, heading = scan.get("mount", [0.0, 0.0, 0.0])
        scan["mount"] = [x - place_m[0], y - place_m[1], heading]

    found = examine(broken(drive[0], tmp_path / "p.log", moved), USUAL, None)
    assert codes(found) == ["scan-place"]
    numbers = found.findings[0].numbers
    assert [numbers["ahead_m"], numbers["left_m"]] == pytest.approx(place_m, abs=0.06)


@pytest.mark.parametrize("place_m", [(0.4, 0.0), (-0.2, 0.3)])
def test_true_poses_and_a_map_tell_where_the_laser_is_but_not_of_a_map_that_is_moved(
    drive: tuple[Path, Library], place_m: tuple[float, float]
) -> None:
    gathered, occupancy = gather(drive[0], USUAL), drive[1].occupancy
    assert occupancy is not None
    truth = gathered.drive.truth.t_s, gathered.drive.truth.poses

    def elsewhere(scans: RecordedScans, grid: OccupancyMap) -> list[Finding]:
        there = ScansAtTruth.of(scans, grid, truth)
        assert there is not None
        return there.laser_elsewhere()

    assert elsewhere(gathered.scans, occupancy) == []
    mounts = [scan.mount - [*place_m, 0.0] for scan in gathered.scans.scans]
    pairs = zip(gathered.scans.scans, mounts, strict=True)
    wrong = replace(gathered.scans, scans=tuple(replace(scan, mount=mount) for scan, mount in pairs))
    (finding,) = elsewhere(wrong, occupancy)
    assert finding.code == "scan-place"
    assert [finding.numbers["ahead_m"], finding.numbers["left_m"]] == pytest.approx(place_m, abs=0.06)
    moved = replace(occupancy, corner=occupancy.corner + np.array([*place_m]))
    assert elsewhere(gathered.scans, moved) == []


def test_scans_that_say_nothing_are_named_with_the_reason(
    drive: tuple[Path, Library], tmp_path: Path
) -> None:
    def empty(scan: dict[str, Any]) -> None:
        kept = [beam for beam, range_m in enumerate(scan["ranges_m"]) if range_m != "inf"][:4]
        scan["ranges_m"] = [r if beam in kept else "inf" for beam, r in enumerate(scan["ranges_m"])]

    found = examine(broken(drive[0], tmp_path / "e.log", empty), USUAL, None)
    assert codes(found) == ["scans-unused"]
    assert "8 beams" in describe(found.findings[0])


def test_odometry_of_another_clock_is_told_of_scans(drive: tuple[Path, Library], tmp_path: Path) -> None:
    records = [json.loads(line) for line in drive[0].read_text(encoding="utf-8").splitlines()]
    scans = [record | {"t": record["t"] + 1e6} for record in records if "scan" in record]
    others = [record for record in records if "scan" not in record]
    log = tmp_path / "clock.log"
    log.write_text("\n".join(map(json.dumps, [*others, *scans])) + "\n", encoding="utf-8")
    found = examine(log, USUAL, None)
    said = {finding.code: describe(finding) for finding in found.findings}
    assert said["odometry-clock"] == "scans and odometry have no time in common"


def test_scans_that_are_mirrored_are_found(drive: tuple[Path, Library], tmp_path: Path) -> None:
    def mirrored(scan: dict[str, Any]) -> None:
        scan["start_rad"], scan["step_rad"] = -scan["start_rad"], -scan["step_rad"]

    assert codes(examine(broken(drive[0], tmp_path / "m.log", mirrored), USUAL, None)) == ["scan-mirrored"]


def test_a_reach_that_is_taken_for_a_hit_is_found(drive: tuple[Path, Library], tmp_path: Path) -> None:
    def capped(scan: dict[str, Any]) -> None:
        far = [5.5 if r == "inf" or (r is not None and r > 2.5) else r for r in scan["ranges_m"]]
        scan["ranges_m"] = far

    found = examine(broken(drive[0], tmp_path / "c.log", capped), USUAL, None)
    assert codes(found)[0] == "max-range"
    assert found.findings[0].numbers["range_m"] == 5.5


@pytest.mark.parametrize("noise_m", [0.0, 0.01])
def test_beams_that_see_the_robot_itself_are_found_and_no_map_is_blamed(
    drive: tuple[Path, Library], tmp_path: Path, noise_m: float
) -> None:
    rng = np.random.default_rng(0)

    def seeing_itself(scan: dict[str, Any]) -> None:
        count = len(scan["ranges_m"]) // 5
        scan["ranges_m"][:count] = (0.2 + noise_m * rng.normal(size=count)).tolist()

    found = examine(broken(drive[0], tmp_path / "b.log", seeing_itself), USUAL, drive[1])
    assert codes(found) == ["own-body"]
    assert found.findings[0].numbers["share"] == pytest.approx(0.2, abs=0.02)
    assert found.findings[0].numbers["range_m"] == pytest.approx(0.26, abs=0.03)


def test_ranges_in_millimeters_are_scans_that_say_nothing(
    drive: tuple[Path, Library], tmp_path: Path
) -> None:
    def in_millimeters(scan: dict[str, Any]) -> None:
        scan["ranges_m"] = [r if r in (None, "inf") else 1000 * r for r in scan["ranges_m"]]
        scan["max_m"] *= 1000

    found = examine(broken(drive[0], tmp_path / "mm.log", in_millimeters), USUAL, None)
    assert codes(found) == ["scans-unused"]


@pytest.mark.parametrize(
    ("how", "flip"),
    [
        ("mirrored left to right", np.s_[:, ::-1]),
        ("mirrored upside down", np.s_[::-1]),
        ("turned by 180 deg", np.s_[::-1, ::-1]),
    ],
)
def test_a_map_that_is_mirrored_is_found_at_true_poses(
    drive: tuple[Path, Library], how: str, flip: Any
) -> None:
    log, library = drive
    grid = library.occupancy
    assert grid is not None
    found = examine(log, USUAL, map_library(replace(grid, cells=grid.cells[flip].copy()), "mirrored"))
    assert codes(found) == ["map-mirrored"]
    assert found.findings[0].details["how"] == how
    seen = found.findings[0].evidence[0].values
    assert 2 * float(seen["after"]) < float(seen["before"])


@pytest.mark.parametrize("scale", [0.95, 1.04, 1.1])
def test_a_map_that_is_scaled_a_little_is_found_at_true_poses(
    drive: tuple[Path, Library], scale: float
) -> None:
    log, library = drive
    grid = library.occupancy
    assert grid is not None
    found = examine(log, USUAL, map_library(replace(grid, cell_m=grid.cell_m * scale), "scaled"))
    assert codes(found) == ["map-scale"]
    assert found.findings[0].numbers["cell_m"] == pytest.approx(grid.cell_m, rel=0.011)


def test_a_map_of_another_scale_or_place_is_found(drive: tuple[Path, Library]) -> None:
    log, library = drive
    grid = library.occupancy
    assert grid is not None
    found = examine(log, USUAL, map_library(replace(grid, cell_m=grid.cell_m * 1.25), "scaled"))
    assert codes(found) == ["map-scale"]
    assert found.findings[0].numbers["scale"] == 0.8
    turned = replace(grid, cells=np.rot90(grid.cells).copy(), corner=grid.corner + 3.0)
    assert codes(examine(log, USUAL, map_library(turned, "turned"))) == ["map-frame"]
    changed, rng = grid.cells.copy(), np.random.default_rng(3)
    side = round(0.6 / grid.cell_m)
    for row, column in rng.integers(0, np.array(changed.shape) - side, (20, 2)):
        changed[row : row + side, column : column + side] = OCCUPIED
    found = examine(log, USUAL, map_library(replace(grid, cells=changed), "changed"))
    assert codes(found) == ["map-changed"]
    assert found.findings[0].numbers["beyond"] > found.findings[0].numbers["short"]
    cells = np.random.default_rng(1).permutation(grid.cells.reshape(-1)).reshape(grid.cells.shape)
    assert codes(examine(log, USUAL, map_library(replace(grid, cells=cells), "noise"))) == ["map-place"]


@pytest.mark.parametrize(
    ("name", "wrong"),
    [
        ("intel", []),
        ("aces", []),
        pytest.param("freiburg-079", [], marks=pytest.mark.slow),
        ("orebro", ["odometry-is-truth"]),
    ],
)
def test_real_logs_are_clean_but_for_what_is_wrong(name: str, wrong: list[str]) -> None:
    log = LOGS / "carmen" / f"{name}-corrected.log.gz"
    if not log.exists():
        pytest.skip(f"no log at {log}")
    assert codes(examine(log, USUAL, None)) == wrong


def test_a_clock_that_is_off_is_found_in_a_real_log() -> None:
    """Its own clock is a twentieth of a second off, which is no finding: what is told is the sum of both."""
    log = LOGS / "carmen" / "aces-corrected.log.gz"
    if not log.exists():
        pytest.skip(f"no log at {log}")
    late = [examine(log, Reading(picture_offset_s=offset_s), None) for offset_s in (0.3, -0.4)]
    assert [codes(found) for found in late] == [["scan-delay"]] * 2
    after, before = (found.findings[0].numbers["delay_s"] for found in late)
    assert after - before == pytest.approx(0.7, abs=0.1)


def test_the_mount_of_a_real_bag_is_right_as_its_transforms_have_it() -> None:
    bag = LOGS / "rosbag2" / "macfirst_floor_take_2"
    if not bag.exists():
        pytest.skip(f"no bag at {bag}")
    assert codes(examine(bag, USUAL, None)) == []
    for yaw_deg in (-90, 90):
        found = examine(bag, Reading(scan_yaw_rad=float(np.radians(yaw_deg))), None)
        assert codes(found) == ["scan-yaw"]
        assert found.fixed.scan_yaw_rad == pytest.approx(0, abs=np.radians(8))
