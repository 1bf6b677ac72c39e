"""Sessions of the simulator, broken on purpose: each way is named, and healthy ones are left alone."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from helpers.session_breaking import BREAKS, broken, late, odometry
from helpers.thymio import THYMIO, read_aligned
from maurice_datasets.sessions import write_simulation
from maurice_datasets.simulation import SimulationPlan
from maurice_datasets.tasks import TASKS
from maurice_loaders.doctor.examination import Examination, examine, odometry_advice
from maurice_loaders.doctor.findings import RecordedDrive, RecordedOdometry, RecordedTruth
from maurice_loaders.doctor.odometry import compared_with_truth
from maurice_loaders.errors import InputError
from maurice_loaders.formats.registry import open_session
from maurice_loaders.libraries.store import build_library
from maurice_loaders.reading.options import Reading
from maurice_mcl.values.library import Library

from ..conftest import WriteLog


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Library]:
    """Keep one simulated drive of 24 updates and its library for all tests here."""
    plan = SimulationPlan(TASKS["tracking"], seed=1, updates=24)
    written = write_simulation(tmp_path_factory.mktemp("doctor") / "s", plan)
    return written.session, build_library(written.survey, ["color", "edges"])


def codes(found: Examination) -> list[str]:
    return [one.code for one in found.findings]


def test_a_healthy_drive_has_nothing_wrong(drive: tuple[Path, Library], tmp_path: Path) -> None:
    log, library = drive
    for truth in (True, False):
        copy = broken(log, tmp_path / f"{truth}.log", None, truth=truth)
        for references in (library, None):
            assert codes(examine(copy, Reading(), references)) == []


@pytest.mark.parametrize("name", BREAKS)
def test_what_is_wrong_is_named_with_truth(name: str, drive: tuple[Path, Library], tmp_path: Path) -> None:
    code, how = BREAKS[name]
    found = examine(broken(drive[0], tmp_path / "b.log", how), Reading(), None)
    assert codes(found)[0] == code
    assert all(one.evidence and one.options for one in found.findings)


@pytest.mark.slow
@pytest.mark.parametrize("name", [*BREAKS, "pictures late", "truth clock"])
def test_reading_it_with_what_mends_it_leaves_nothing_wrong(
    name: str, drive: tuple[Path, Library], tmp_path: Path
) -> None:
    clocks = {"pictures late": late("image", 9.0), "truth clock": late("truth", 500.25)}
    log = broken(drive[0], tmp_path / "b.log", clocks.get(name) or BREAKS[name][1])
    found = examine(log, Reading(), drive[1])
    assert codes(examine(log, found.fixed, drive[1])) == []
    healthy, fixed = list(open_session(drive[0]).moments()), list(open_session(log, found.fixed).moments())
    assert len(fixed) == len(healthy) == 24
    for one, two in zip(fixed, healthy, strict=True):
        assert one.truth is not None
        assert two.truth is not None
        np.testing.assert_allclose(one.truth, two.truth, atol=1e-6)
        np.testing.assert_allclose(one.frame.motions, two.frame.motions, rtol=0.1, atol=0.03)


@pytest.mark.parametrize("degrees", [40, -60, 75])
def test_a_frame_that_is_turned_is_told_by_itself(
    degrees: int, drive: tuple[Path, Library], tmp_path: Path
) -> None:
    cos, sin = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    turned = odometry(lambda f, s, t: (f * cos - s * sin, f * sin + s * cos, t))
    log = broken(drive[0], tmp_path / "b.log", turned, truth=False)
    (finding,) = examine(log, Reading(), None).findings
    assert finding.code == ("frame-swapped" if degrees == 75 else "frame-turned")
    assert finding.numbers["offset_deg"] == pytest.approx(-degrees, abs=5)


def test_the_numbers_are_right(drive: tuple[Path, Library], tmp_path: Path) -> None:
    def numbers(name: str) -> dict[str, float]:
        log = broken(drive[0], tmp_path / f"{name}.log", BREAKS[name][1])
        return dict(examine(log, Reading(), None).findings[0].numbers)

    assert numbers("millimeters")["scale"] == pytest.approx(0.001, rel=0.15)
    assert numbers("swapped")["offset_deg"] == pytest.approx(-90, abs=5)
    assert numbers("nanoseconds")["per_s"] == 1e9
    assert numbers("gain")["gain"] == pytest.approx(0.73 / 2, rel=0.1)


def test_late_pictures_are_found(drive: tuple[Path, Library], tmp_path: Path) -> None:
    log = broken(drive[0], tmp_path / "b.log", late("image", 9.0))
    found = examine(log, Reading(), drive[1])
    assert codes(found) == ["picture-delay"]
    assert found.findings[0].numbers["delay_s"] == pytest.approx(9.0, abs=3.5)  # it stands while it looks


@pytest.mark.parametrize("degrees", [45, -90])
def test_a_camera_that_looks_aside_is_found_and_mended(degrees: int, drive: tuple[Path, Library]) -> None:
    """The library's headings are turned, which is the same as turning the camera."""
    log, library = drive
    poses = library.poses - [0, 0, np.radians(degrees)]
    poses[:, 2] = (poses[:, 2] + np.pi) % (2 * np.pi) - np.pi
    turned = replace(library, poses=poses)
    found = examine(log, Reading(), turned)
    assert codes(found) == ["camera-yaw"]
    assert found.findings[0].numbers["yaw_deg"] == pytest.approx(-degrees, abs=15)
    if degrees == 45:
        assert np.degrees(found.fixed.camera_yaw_rad) == pytest.approx(-45, abs=15)
        assert codes(examine(log, found.fixed, turned)) == []


@pytest.mark.parametrize(
    ("records", "told"),
    [
        ([(1, 0.1), (2, 0.1), (1.5, 0.1), (3, 0.1)], ["times-fall"]),
        ([(0, 1e12), (1, 0.1)], ["too-large"]),
        ([], []),
    ],
)
def test_times_that_fall_and_numbers_that_no_log_may_hold_are_told(
    records: list[tuple[float, float]], told: list[str], write_log: WriteLog
) -> None:
    log = write_log(*({"t": t, "odometry": [x, 0, 0]} for t, x in records))
    found = examine(log, Reading(), None)
    assert codes(found) == told
    assert (found.truth, found.pictures) == (0, 0)


def test_broken_lines_are_counted_and_what_is_no_session_is_refused(
    write_log: WriteLog, survey: Path, tmp_path: Path
) -> None:
    found = examine(write_log({"t": 0, "odometry": [0.1, 0, 0]}, "{broken", '{"t": 1}'), Reading(), None)
    assert codes(found) == ["broken"]
    assert found.odometry == 1
    with pytest.raises(InputError, match="survey"):
        examine(survey, Reading(), None)
    with pytest.raises(InputError, match="no such file"):
        examine(tmp_path / "gone.log", Reading(), None)


def test_a_motion_model_that_nobody_knows_is_one_line(
    write_log: WriteLog, pixel: dict[str, Any], drive: tuple[Path, Library]
) -> None:
    records = [{"t": t, key: [0.1 * t, 0, 0]} for t in range(4) for key in ("odometry", "truth")]
    log = write_log(*records, {"t": 3, "image": pixel}, robot={"motion": {"model": "hover"}})
    with pytest.raises(InputError, match=r"session.log:1: robot.motion.model is 'hover'; known are"):
        examine(log, Reading(), drive[1])


@pytest.mark.parametrize(("known", "lacking"), [("truth", "odometry"), ("odometry", "truth")])
def test_what_is_lacking_for_a_comparison_is_named(known: str, lacking: str, write_log: WriteLog) -> None:
    found = examine(write_log(*({"t": t, known: [0.1, 0, 0]} for t in range(3))), Reading(), None)
    assert f"{lacking}: there is none" in found.not_asked


def test_without_odometry_it_says_how_some_is_made(write_log: WriteLog, pixel: dict[str, Any]) -> None:
    pictures = [{"t": t, "image": pixel} for t in range(3)]
    truth = [{"t": t, "truth": [0.1 * t, 0, 0]} for t in range(3)]
    odometry = [{"t": t, "odometry": [0.1, 0, 0]} for t in range(3)]

    def said(*records: dict[str, Any]) -> list[str]:
        ordered = sorted(records, key=lambda one: float(one["t"]))
        advice = odometry_advice(examine(write_log(*ordered), Reading(), None))
        return [text.split("=")[0] for text in advice]

    from_truth = ["--reading odometry_from_truth"]
    assert said(*pictures, *truth) == said(*truth) == from_truth
    assert said(*pictures, *odometry) == []
    (given,) = said(*pictures)
    assert given.endswith("--reading odometry_topic")


SIZES = st.floats(allow_nan=False, allow_infinity=False)
NUMBERS = SIZES | st.floats(-5, 5) | st.sampled_from([0, 0.1, 1e18])
LINES = st.lists(
    st.tuples(NUMBERS, st.sampled_from(["odometry", "truth"]), st.lists(NUMBERS, min_size=3, max_size=3)),
    max_size=60,
)


@settings(max_examples=50, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(lines=LINES, ordered=st.booleans())
def test_no_numbers_bring_it_down(
    lines: list[tuple[float, str, list[float]]], ordered: bool, write_log: WriteLog
) -> None:
    rows = sorted(lines) if ordered else lines
    found = examine(write_log(*({"t": t, key: v} for t, key, v in rows)), Reading(), None)
    assert found.odometry + found.truth <= len(lines)


@pytest.mark.skipif(not THYMIO.is_dir(), reason="needs the recorded odometry of the thymio")
@pytest.mark.parametrize("name", ["forward_x_minus_slow_1", "random_1", "random_long"])
def test_real_odometry_beside_real_truth_is_healthy(name: str) -> None:
    rows = read_aligned(THYMIO / name)
    t_s = np.arange(len(rows.truth)) / 3.0
    track = RecordedTruth(t_s, rows.truth, np.zeros(len(t_s), np.int32))
    healthy = RecordedDrive(RecordedOdometry(t_s, rows.odometry, poses=True), track, t_s)
    assert compared_with_truth(healthy) == []
    if name.startswith("random"):
        mirrored = RecordedOdometry(t_s, rows.odometry * [1, 1, -1], poses=True)
        wrong = compared_with_truth(replace(healthy, odometry=mirrored))
        assert [one.code for one in wrong] == ["turn-clockwise"]
