"""A run with a laser alone is drawn by its scans: by itself, at the estimate, at the truth, beam by beam."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

import maurice_mcl as mcl
from helpers import viz_recordings as recordings
from maurice_mcl.filter.localizer import run
from maurice_mcl.sensor.laser.rays import Rays
from maurice_mcl.sensor.map_places import map_library
from maurice_mcl.values.geometry import compose
from maurice_mcl.values.laser import OCCUPIED, UNKNOWN, LaserScan, OccupancyMap
from maurice_mcl.values.session import Frame, Moment, SessionInfo
from maurice_viz.layouts.registry import runs_blueprint, tabs_of
from maurice_viz.panels.laser.explanation import proposed
from maurice_viz.panels.laser.scan import NO_SCAN, TOO_FEW, PlacesOnMap
from maurice_viz.running.observer import RerunObserver
from maurice_viz.scene import RunView, Scene, numbered
from maurice_viz.viewer import sinks

START = np.array([1.0, 1.0, 0.3])
WITHOUT, EMPTY, STEPS = 4, 5, 6  # the step without a scan, the one whose beams hit nothing
BEAMS = 90


def hall():
    cells = np.zeros((80, 120), np.uint8)
    cells[:2] = cells[-2:] = OCCUPIED
    cells[:, :2] = cells[:, -2:] = OCCUPIED
    cells[2:30, 60:66] = OCCUPIED  # half a wall
    cells[60:, 100:] = UNKNOWN
    return OccupancyMap(cells, 0.05, np.zeros(2))


@dataclass(frozen=True)
class LaserDrive:
    """A straight drive in the hall; a box stands where the map has none."""

    info: SessionInfo
    has_truth: bool = True
    in_view: bool = False

    def moments(self):
        rays, pose = Rays.of(hall()), START.copy()
        angles = -np.pi + 2 * np.pi / BEAMS * np.arange(BEAMS)
        for step in range(1, STEPS + 1):
            pose = compose(pose, np.array([0.1, 0.0, 0.05]))
            ranges = rays.cast(pose[None], angles, 12.0)[0]
            if self.in_view:
                ranges[BEAMS // 2 : BEAMS // 2 + 10] = 0.5
            if step == EMPTY:
                ranges[:] = np.inf
            scan = None if step == WITHOUT else LaserScan(ranges, -np.pi, 2 * np.pi / BEAMS, 0.05, 12.0)
            image = np.zeros((24, 32, 3), np.uint8)
            frame = Frame(step, float(step), np.array([[0.1, 0.0, 0.05]]), image, "", scan=scan)
            yield Moment(frame, pose if self.has_truth else None, ())


LIBRARY = map_library(hall(), "hall")
INFO = SessionInfo("hall", "m", arena=LIBRARY.arena)


def drawn(path, labels=("laser",), **drive):
    session = LaserDrive(INFO, **drive)
    filters = {label: mcl.make_localizer(LIBRARY, preset="laser", particles=300, seed=3) for label in labels}
    views = numbered(RunView.of(label, localizer, START) for label, localizer in filters.items())
    scene = Scene(INFO, LIBRARY, session.has_truth)
    with sinks.to_file(path, "hall", runs_blueprint(views, scene)) as rec:
        for view in views:
            recordings.observe(
                RerunObserver(rec, view, scene), list(run(filters[view.label], session, START))
            )
    return views, scene


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    path = tmp_path_factory.mktemp("laser") / "hall.rrd"
    drawn(path, in_view=True)
    return path


def texts(path, part):
    values = [row.values for row in recordings.rows(path, f"/laser/explain/{part}")]
    return [value["TextDocument:text"][0] for value in values]


def test_every_step_has_the_scan_and_where_it_is_thought_to_be(recording):
    for part in ("seen", "here"):
        assert len({row.step for row in recordings.rows(recording, f"/laser/scan/{part}")}) == STEPS
    assert NO_SCAN != TOO_FEW


def test_the_beams_that_end_before_a_wall_are_told_with_how_far(recording):
    words, table = texts(recording, "words")[0], texts(recording, "table")[0]
    assert "before the wall: something stands there" in words
    assert "| end before a wall |" in table
    assert "at the truth" in table
    without = texts(recording, "words")[WITHOUT - 1]
    assert "agree" not in without  # nor is an earlier scan told


def test_without_truth_nothing_is_drawn_there(tmp_path):
    path = tmp_path / "without.rrd"
    drawn(path, has_truth=False)
    assert not recordings.rows(path, "/laser/explain/scan/truth")
    assert "at the truth" not in texts(path, "table")[0]


def test_runs_of_one_drive_share_the_scan(tmp_path):
    path = tmp_path / "two.rrd"
    views, scene = drawn(path, ("first", "second"))
    assert not recordings.rows(path, "/second/scan/seen")
    assert len(recordings.rows(path, "/second/scan/here")) == STEPS
    assert "explain" in tabs_of(views, scene)[1]
    assert "overview" not in tabs_of(views, scene)[1]


def test_likelihood_over_the_map_is_highest_where_the_scan_was_taken():
    laser = mcl.make_localizer(LIBRARY, preset="laser", particles=300).sensor.sensors["laser"]
    moment = next(iter(LaserDrive(INFO).moments()))
    nats = PlacesOnMap(LIBRARY).nats(laser, laser.read(moment.frame))
    assert nats.shape == (LIBRARY.size,)
    best = LIBRARY.poses[int(np.argmax(nats)), :2]
    assert np.hypot(*(best - moment.truth[:2])) < 0.5
    assert np.ptp(nats) > 5


def test_a_proposal_is_shown_only_where_the_filter_asked():
    sensor = mcl.make_localizer(LIBRARY, preset="laser", particles=300).sensor
    comparison = sensor.see(next(iter(LaserDrive(INFO).moments())).frame)
    assert proposed(comparison) is None
    asked = comparison.sensed[0].proposal
    assert proposed(comparison) is asked
