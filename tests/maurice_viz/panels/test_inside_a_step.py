"""What is drawn of the inside of an update, read back from recordings."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from helpers import viz_fakes as fakes
from helpers import viz_recordings as recordings
from maurice_mcl.scoring.events import RunEvent
from maurice_mcl.scoring.modes import Ancestry
from maurice_mcl.sensor.descriptors.registry import CHANNELS
from maurice_mcl.values.records import Belief, uniform_log_weights
from maurice_viz import entities
from maurice_viz.entities import Phase, RunPaths
from maurice_viz.panels.belief import sample, seen_whole
from maurice_viz.panels.inside import BOX_PX, DOTS, HEAVIEST, radii_of, some_of
from maurice_viz.panels.panel import StepUpdate
from maurice_viz.panels.population import BY_COPIES, BY_WEIGHT, outline, shares, shares_of
from maurice_viz.panels.references import map_names
from maurice_viz.panels.traces import (
    ANCESTORS,
    EVIDENCE,
    SPREAD,
    TRUTH_RANK,
    evidence_lines,
    round_top,
    top_path,
)
from maurice_viz.running.observer import UPDATES_AROUND, DetailFilter, expected_bytes, expected_seconds
from maurice_viz.scene import Detail

RUN = RunPaths("blended")
STEPS = 9


@pytest.fixture(scope="module")
def drawn(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, recordings.Played, Any]:
    folder = tmp_path_factory.mktemp("inside")
    session = fakes.make_session(fakes.make_library(folder), STEPS)
    (played,) = recordings.draw(folder / "run.rrd", session, ["blended"])
    return folder / "run.rrd", played, session.library


def test_headings_have_a_histogram():
    headings = np.radians([5.0, 5.0, 95.0, -5.0])
    poses = np.column_stack([np.zeros(4), np.zeros(4), headings]).astype(np.float32)
    belief = Belief(poses, np.log([0.1, 0.2, 0.3, 0.4]), np.zeros(2))
    share = shares(belief)
    assert share[[0, 9, 35]] == pytest.approx([0.3, 0.3, 0.4])
    assert share.sum() == pytest.approx(1)
    points = outline(belief)
    assert np.hypot(*points.T).max() == pytest.approx(1)
    # the heaviest sector, from -10 to 0 degrees, is drawn below the axis: y points down
    assert points[np.hypot(*points.T).argmax(), 1] >= 0
    belief = Belief(np.array([[0, 0, np.pi]], np.float32), uniform_log_weights(1), np.zeros(2))
    assert shares(belief).max() == pytest.approx(1)


def test_likelihood_maps_are_brightest_at_the_likeliest_reference(drawn):
    path, played, library = drawn
    for name in map_names(("color", "edges")):
        (row, *_) = recordings.rows(path, RUN.likelihood(name))
        image = np.array(Image.open(io.BytesIO(bytes(row.values["EncodedImage:blob"][0]))).convert("RGB"))
        assert image.shape[0] < image.shape[1] <= 120
        seen = played[0][1].sighting.comparison
        logs = {"all": seen.log_likelihood, "color": -seen.channel_cost[0], "edges": -seen.channel_cost[1]}
        x, y = library.poses[logs[name].argmax(), :2]
        x_min, y_min, x_max, y_max = library.arena.bounds
        column = int((x - x_min) / (x_max - x_min) * image.shape[1])
        line = int((y_max - y) / (y_max - y_min) * image.shape[0])
        assert image[line, column].astype(int).sum() == image.reshape(-1, 3).astype(int).sum(axis=1).max()


def test_detail_needs_room():
    light, some, full = (expected_bytes(d, 100, 5000, 2) for d in (Detail.LIGHT, Detail.EVENTS, Detail.FULL))
    assert light < some < full
    assert expected_bytes(Detail.FULL, 100, 10_000, 2) > full
    # a live camera of 2,000 particles takes 202 kB a step in full, and 58 light; a laser 162 and 56
    live = [expected_bytes(d, 1, 2000, 2, live=True) for d in (Detail.LIGHT, Detail.FULL)]
    assert live == pytest.approx([57_000, 190_000], rel=0.1)
    light_s, some_s, full_s = (
        expected_seconds(d, 100, 5000) for d in (Detail.LIGHT, Detail.EVENTS, Detail.FULL)
    )
    assert light_s < some_s < full_s < expected_seconds(Detail.FULL, 100, 10_000)
    lines = evidence_lines(tuple(CHANNELS))
    assert len({color for _, color, _ in lines}) == len(lines) == 1 + len(CHANNELS)
    assert map_names(("color",)) == ("all",)


def test_bars_hold_all_dots_and_all_weight():
    times = np.array([0.0, 0.1, 0.5, 1.0, 2.0, 40.0])
    for kind in (BY_WEIGHT, BY_COPIES):
        dots, held = shares_of(times, kind)
        assert dots.sum() == pytest.approx(1)
        assert held.sum() == pytest.approx(1)
        assert (dots[-1], held[-1]) == pytest.approx((1 / 6, 40 / 43.6))
    assert shares_of(np.zeros(3), BY_COPIES)[1].sum() == 0


def test_the_heaviest_dots_are_drawn_and_drawn_last():
    weights = np.random.default_rng(1).random(5000) ** 8
    some = some_of(weights)
    assert len(some) <= DOTS
    assert (np.diff(weights[some]) >= 0).all()
    assert set(np.argsort(weights)[-HEAVIEST:]) <= set(some.tolist())
    assert np.array_equal(np.sort(some_of(weights[:300])), np.arange(300))
    assert np.square(radii_of(np.array([4.0])) / radii_of(np.array([1.0]))) == pytest.approx(4, rel=0.15)


def test_the_mark_is_at_each_phase_and_nowhere_on_other_timelines(drawn):
    path, _, _ = drawn
    rows = recordings.rows(path, f"{entities.PHASES}/mark")
    lefts = {row.phase: row.values["Transform3D:translation"][0][0] for row in rows if row.phase}
    for step in range(1, STEPS + 1):
        at = [lefts[entities.phase_number(step, phase)] for phase in Phase]
        assert np.diff(at) == pytest.approx([BOX_PX] * 5)


def test_the_rank_of_the_true_place(drawn):
    path, played, library = drawn
    places = recordings.scene_with(library)
    ranks = recordings.rows(path, RUN.trace(TRUTH_RANK))
    assert len(ranks) == STEPS
    for row, (moment, record) in zip(ranks, played, strict=True):
        logs = record.sighting.comparison.log_likelihood
        entry = places.entry_at(moment.truth)
        assert row.values["Scalars:scalars"] == [1 + (logs > logs[entry]).sum()]


def test_evidence_and_ancestors_are_those_of_the_records(drawn):
    path, played, _ = drawn
    tree = Ancestry()
    found = recordings.rows(path, RUN.trace(ANCESTORS))
    for row, (_, record) in zip(found, played, strict=True):
        tree.see(record)
        assert row.values["Scalars:scalars"] == [pytest.approx(tree.distinct() / record.belief.size)]
    rows = recordings.rows(path, RUN.trace(EVIDENCE))
    for row, (_, record) in zip(rows, played, strict=True):
        expected = [record.calibrated_evidence, *record.channel_evidence]
        assert row.values["Scalars:scalars"] == pytest.approx(expected)
    path, played, _ = drawn
    (row,) = recordings.rows(path, top_path(RUN, SPREAD))
    widest = max(float(np.hypot(*record.mean_estimate.sd_m)) for _, record in played) / 0.0254
    assert row.step == STEPS
    assert row.values["Scalars:scalars"][0] >= widest * 0.999


@pytest.mark.parametrize("at", [1, 5, 9])
def test_around_events_everything_is_drawn_and_elsewhere_little(at):
    filter_, given = DetailFilter(Detail.EVENTS), []
    session = fakes.make_session(fakes.make_library(), 9)
    for moment, record in fakes.play(session, "color", 5):
        step = moment.frame.step
        events = [RunEvent(step, 0.0, "resampled", "")] + [RunEvent(step, 0.0, "lost", "")] * (step == at)
        given += filter_.see(StepUpdate(moment, record, tuple(events)))
    given += filter_.rest()
    assert [update.moment.frame.step for update in given] == list(range(1, 10))
    assert [u.moment.frame.step for u in given if u.whole] == [
        step for step in range(1, 10) if abs(step - at) <= UPDATES_AROUND
    ]


@pytest.mark.parametrize(("detail", "whole"), [(Detail.FULL, True), (Detail.LIGHT, False)])
def test_full_and_light_do_not_wait(detail, whole):
    session = fakes.make_session(fakes.make_library(), 1)
    ((moment, record),) = fakes.play(session, "color", 5)
    (update,) = DetailFilter(detail).see(StepUpdate(moment, record))
    assert update.whole is whole


@pytest.mark.parametrize(
    ("most", "top"),
    [(0.0, 0.0), (8.8, 11.5), (0.93, 1.15), (4.0, 4.0), (12.0, 12.0), (10.2, 11.5), (47.0, 115.0)],
)
def test_scales_reach_a_number_that_the_viewer_labels(most, top):
    assert round_top(most, 4.5) == pytest.approx(top)


def test_the_close_view_holds_the_truth_and_nearly_all_weight():
    rng = np.random.default_rng(3)
    poses = np.column_stack([rng.normal(size=(500, 2)) * (0.1, 0.4), np.zeros(500)]).astype(np.float32)
    weights = rng.random(500)
    belief = Belief(poses, np.log(weights / weights.sum()), np.array([10.0, 20.0]))
    for truth in (
        None,
        np.array([10.0, 20.0, 0.0]),
        np.array([14.0, 20.0, 0.0]),
        np.array([70.0, 20.0, 0.0]),
    ):
        middle, reach = seen_whole([sample(belief)], [] if truth is None else [truth])
        off = np.abs(belief.world_poses[:, :2] - middle).max(axis=1)
        assert belief.weights @ (off <= reach) > 0.93
        is_far = truth is not None and truth[0] == 70  # it would make the cloud too small, and is pointed to
        assert truth is None or (np.abs(truth[:2] - middle).max() < reach) != is_far
        assert reach < (3.5 if truth is not None and truth[0] == 14 else 1.6)
