"""Parts of recorded drives: where they begin, what they hold, and trials over them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from maurice_datasets.sessions import simulate, simulation_plan
from maurice_datasets.trials.drives import open_drive
from maurice_datasets.trials.engine import run_plan
from maurice_datasets.trials.plan import Part, Plan, SessionSpec, Variants, read_plan
from maurice_datasets.trials.rows import read_rows
from maurice_datasets.trials.stretches import CARRIED_M, Stretches, mapped_share
from maurice_loaders.errors import InputError
from maurice_loaders.formats.registry import open_session
from maurice_loaders.session_log.writer import SessionWriter
from maurice_mcl.values.laser import FREE, UNKNOWN, LaserScan, OccupancyMap
from maurice_mcl.values.session import NO_PICTURE, Frame, Moment, SessionInfo

SCAN = LaserScan(np.array([1.0, 1.0, 9.0], np.float32), 0.0, np.pi / 2, 0.1, 8.0)  # ahead, left, nothing
LEFT_UNKNOWN = OccupancyMap(
    np.repeat(np.array([[FREE], [UNKNOWN]], np.uint8), 10, axis=0).repeat(60, axis=1), 0.5, np.zeros(2)
)  # 30 m by 10 m, known up to y = 5 m


def drive(updates: int = 40) -> list[Moment]:
    """Return a drive along x, half a meter an update, at y = 2 m and from the middle on at y = 4.5 m."""
    moments = []
    for k in range(updates):
        frame = Frame(k + 1, 0.5 * k, np.array([[0.5, 0.0, 0.0]]), NO_PICTURE, "", scan=SCAN)
        moments.append(Moment(frame, np.array([0.5 * k + 1, 2.0 if k < updates // 2 else 4.5, 0.0])))
    return moments


@pytest.mark.parametrize(("y", "share"), [(2.0, 1.0), (4.5, 0.5), (7.0, 0.0)])
def test_beams_that_end_in_mapped_space_are_counted_among_those_that_hit(y: float, share: float) -> None:
    assert mapped_share(LEFT_UNKNOWN, SCAN, np.array([2.0, y, 0.0])) == share


def test_without_a_scan_or_a_truth_the_share_is_not_known() -> None:
    assert np.isnan(mapped_share(LEFT_UNKNOWN, None, np.zeros(3)))
    assert np.isnan(mapped_share(LEFT_UNKNOWN, SCAN, None))


def test_runs_begin_at_places_of_their_own_and_hold_the_drives_updates() -> None:
    stretches = Stretches.of(drive(), None)
    parts = [stretches.of_run(run, 5, None) for run in range(36)]
    begins = {part[0].truth[0] for part in parts if part[0].truth is not None}
    assert len(begins) == 36  # of 40 updates, 5 do not fit from the last four
    for part in parts:
        assert [moment.frame.step for moment in part] == [1, 2, 3, 4, 5]
        assert not len(part[0].frame.motions)
        assert all(len(moment.frame.motions) == 1 for moment in part[1:])


def test_stretches_begin_where_the_map_knows_half_of_what_the_laser_sees() -> None:
    beyond = [replace(moment, truth=np.array([2.0, 7.0, 0.0])) for moment in drive()]
    assert len(Stretches.of(drive(), LEFT_UNKNOWN).begins) == 40
    with pytest.raises(InputError, match="found no 5 updates in a row"):
        Stretches.of(beyond, LEFT_UNKNOWN).of_run(0, 5, None)


@pytest.mark.parametrize("run", range(8))
def test_a_robot_that_is_carried_goes_on_elsewhere_and_later(run: int) -> None:
    part = Stretches.of(drive(), None).of_run(run, 12, 5)
    assert [moment.kidnapped for moment in part] == [k == 4 for k in range(12)]
    places = np.array([moment.truth for moment in part])[:, :2]
    assert np.hypot(*(places[4] - places[3])) > CARRIED_M
    assert (np.diff([moment.frame.time_s for moment in part]) > 0).all()


def test_a_stretch_longer_than_the_drive_is_refused() -> None:
    with pytest.raises(InputError, match="found no 41 updates in a row"):
        Stretches.of(drive(), None).of_run(0, 41, None)


def test_a_plan_runs_over_parts_of_a_recording_on_a_map_of_its_scans(tmp_path: Path) -> None:
    path = str(simulate(simulation_plan("tracking", updates=15, laser=True), tmp_path / "drive").session)
    updates = sum(1 for _ in open_session(path).moments())
    whole = SessionSpec("second half", path=path, mapped="first half")
    anywhere = SessionSpec("anywhere", path=path, mapped="all", start="anywhere", stretch=5)
    too_long = SessionSpec("too long", path=path, mapped="all", stretch=1000)
    part = Part("laser", "laser", (whole, anywhere, too_long), Variants({"particles": 500}), 2)
    run_plan(Plan("laser", "laser", (part,)), tmp_path / "trials")
    rows = read_rows(tmp_path / "trials")
    assert rows.filter(pl.col("session") == "second half")["updates"].to_list() == 2 * [
        updates - updates // 2
    ]
    begun = rows.filter(pl.col("session") == "anywhere")
    assert [len(values) for values in begun["heading_error_rad"]] == [5, 5]
    assert all(share >= 0.5 for values in begun["mapped"] for share in values[:1])
    assert len({values[0] for values in begun["true_x_m"]}) == 2
    assert all("found no 1000 updates" in error for error in rows["error"].drop_nulls())
    assert rows["error"].is_null().sum() == 4


@pytest.mark.parametrize("apart_s", [1.0, 0.0])
def test_a_drive_is_halved_by_its_updates_whatever_their_times(apart_s: float, tmp_path: Path) -> None:
    with SessionWriter(tmp_path / "drive.log", SessionInfo("drive")) as log:
        for k in range(21):
            reach = np.full(180, 1.5 + 0.01 * k, np.float32)
            log.odometry_pose(k * apart_s, (float(k), 0.0, 0.0))
            log.truth(k * apart_s, (float(k), 0.0, 0.0))
            log.scan(k * apart_s, LaserScan(reach, 0.0, np.radians(2), 0.1, 8.0))
    path = str(tmp_path / "drive.log")
    drive = open_drive(SessionSpec("half", path=path, mapped="first half"), 0)
    assert next(moment.truth[0] for moment in drive.session.moments() if moment.truth is not None) == 10
    x_min, _, x_max, _ = drive.bench.library.arena.bounds
    assert (x_min, x_max) == pytest.approx((-1.5, 9 + 1.59), abs=0.1)


def test_a_session_has_a_library_or_a_map_of_its_scans(tmp_path: Path) -> None:
    (tmp_path / "plan.toml").write_text(
        '[[sessions]]\npath = "a.log"\nlibrary = "map.yaml"\nmapped = "all"\n[settings]\nparticles = 500\n'
    )
    with pytest.raises(InputError, match="found both library and mapped"):
        read_plan(tmp_path / "plan.toml")
