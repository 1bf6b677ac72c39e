"""The parts that a report is made of: charts, paths on the map, the choice of pictures."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from helpers.step_records import at, made, moment
from maurice_mcl.scoring.events import KINDS, RunEvent
from maurice_mcl.scoring.table import TableRows
from maurice_mcl.values.library import USUAL
from maurice_viz.reports.charts import MAX_POINTS, px, templates, thin_chart, ticks
from maurice_viz.reports.make import _charts
from maurice_viz.reports.map import MAX_POINTS as MAX_PLACES
from maurice_viz.reports.map import thin_path, unbroken
from maurice_viz.reports.shots import MAX_PICTURES, ReportedEvent, choose, listed, step_ranges, worst_step
from maurice_viz.running.saved_steps import Collected, Track
from maurice_viz.style import UNITS, Scale

LOST_M = USUAL.lost_m
CHARTED = ("confidence", "knows", "effective_sample_size", "calibrated_evidence", "mass")


def test_text_is_escaped_in_tables_and_attributes():
    drawings = templates().get_template("drawings.html").module
    row = ("a < b & 'c'", '"q"')
    table = drawings.table('<b> "title"', [""], [row], 'x" y')  # type: ignore[attr-defined]  # a macro
    assert "<b>" not in table
    assert "a &lt; b &amp; &#39;c&#39;" in table
    assert 'class="x&#34; y"' in table


@pytest.mark.parametrize(
    ("value", "text"), [(1.0, "1"), (-0.001, "0"), (2.345, "2.35"), (10.5, "10.5"), (0, "0")]
)
def test_numbers_are_short(value, text):
    assert px(value) == text


@given(
    st.floats(-1e6, 1e6).flatmap(lambda low: st.tuples(st.just(low), st.floats(1e-3, 1e6))), st.integers(3, 9)
)
def test_ticks_are_round_within_the_axis_and_enough(span, most):
    low, high = span[0], span[0] + span[1]
    found = ticks(low, high, most)
    assert len(found) <= most + 1
    assert len(found) >= (most - 1) // 3
    slack = 1e-6 * max(abs(low), abs(high))
    assert all(low - slack <= value <= high + slack for value in found)


@given(st.integers(1, 4000), st.integers(0, 2**32 - 1))
def test_thinning_keeps_every_peak(size, seed):
    rng = np.random.default_rng(seed)
    x, y = np.arange(float(size)), rng.normal(size=size)
    y[rng.random(size) < 0.1] = np.nan
    few_x, few_y = thin_chart(x, y)
    assert len(few_x) <= MAX_POINTS
    assert (np.diff(few_x) > 0).all()
    assert all(np.array_equal(y[int(a)], b, equal_nan=True) for a, b in zip(few_x, few_y, strict=True))
    if np.isfinite(y).any():
        assert np.nanmax(few_y) == np.nanmax(y)
        assert np.nanmin(few_y) == np.nanmin(y)


def test_paths_are_broken_at_jumps_and_keep_their_ends():
    places = np.array([[0.0, 0], [0.3, 0], [5.0, 0], [5.2, 0], [np.nan, np.nan], [5.4, 0], [5.6, 0]])
    parts = unbroken(places, np.full(7, 0.3), LOST_M)
    assert [len(part) for part in parts] == [2, 2, 2]
    joined = unbroken(places[:4], np.full(4, 2.0), LOST_M)  # the robot itself measured two meters in a step
    assert [len(part) for part in joined] == [4]
    assert [len(part) for part in unbroken(np.zeros((1, 2)), np.zeros(1), LOST_M)] == [1]
    places = np.random.default_rng(0).normal(size=(20_000, 2))
    few = thin_path(places)
    assert len(few) == MAX_PLACES
    assert (few[[0, -1]] == places[[0, -1]]).all()
    assert len(thin_path(places[:50])) == 50


def track(label: str, errors: list[float], events: list[RunEvent] | None = None) -> Track:
    rows = TableRows()
    for step, error_m in enumerate(errors, start=1):
        record = made(at(0.0, 0.0, 1.0), step=step)
        truth = None if np.isnan(error_m) else (error_m, 0.0, 0.0)
        rows.add(moment(record, truth), record)
    return Track(label, rows.table(), events or ())


def collected(*tracks: Track) -> Collected:
    return Collected(tracks, (), None)


def happened(kind: str, *steps: int) -> list[ReportedEvent]:
    return [ReportedEvent(RunEvent(step, float(step), kind, "text"), ("a",)) for step in steps]


def test_every_kind_gets_a_picture_before_one_gets_two():
    events = sorted(
        happened("mode-switch", *range(10, 40)) + happened("lost", 41) + happened("session", 5, 6),
        key=lambda one: one.event.step,
    )
    scenes = choose(collected(track("a", [1.0] * 50)), events)
    steps = [scene.step for scene in scenes]
    assert len(steps) == MAX_PICTURES
    assert steps == sorted(steps)
    assert {1, 50, 41, 10, 5} <= set(steps)
    assert [scene.number for scene in scenes] == list(range(1, MAX_PICTURES + 1))
    assert "lost: text" in next(scene for scene in scenes if scene.step == 41).reasons


@pytest.mark.parametrize("kind", [name for name, kind in KINDS.items() if not kind.is_routine])
def test_no_kind_is_left_without_a_picture(kind):
    """A diagnosed cause, too, beside many events of another kind."""
    other = "reseeded" if kind != "reseeded" else "expanded"
    scenes = choose(collected(track("a", [1.0] * 50)), happened(other, *range(10, 40)) + happened(kind, 45))
    assert f"{kind}: text" in next(scene for scene in scenes if scene.step == 45).reasons


def test_quiet_runs_have_a_worst_and_a_last_step():
    (one,) = choose(collected(track("a", [3.0])), [])
    assert one.reasons == ("largest position error", "last step")
    assert [s.step for s in choose(collected(track("a", [1.0, 3.0, 2.0])), happened("resampled", 1))] == [
        2,
        3,
    ]
    assert worst_step(collected(track("a", [1, 5, 2]), track("b", [1, 2, 9]))) == 3
    assert worst_step(collected(track("a", [np.nan, 5, np.nan]))) == 2
    assert worst_step(collected(track("a", [np.nan, np.nan]))) == 1  # equally wide clouds: the first
    events = happened("resampled", 1) + happened("reseeded", *range(30)) + happened("lost", 4)
    assert [one.event.kind for one in listed(events)] == ["lost"]


@pytest.mark.parametrize(
    ("steps", "text"), [([], ""), ([3], "3"), ([4, 3, 3], "3, 4"), ([1, 2, 3, 7, 9, 10, 11], "1-3, 7, 9-11")]
)
def test_steps_are_written_as_ranges(steps, text):
    assert step_ranges(steps) == text


def test_every_chart_is_a_column_of_the_table_in_its_unit():
    table = replace(
        track("a", [0.254, 0.508]).table,
        **{name: np.array([0.1, 0.2]) * k for k, name in enumerate(CHARTED, start=1)},
        poses=np.array([[0.0, 0.0, 0.0], [0.0, 0.0, np.pi / 6]]),
        mean_sd_m=np.array([[0.0254, 0.0], [0.0, 0.0508]]),
    )
    one = replace(collected(Track("a", table, ())), results=(SimpleNamespace(radii=USUAL),))
    charts, unknown = _charts(Scale(UNITS["in"]), one, (), by_laser=False)
    found = {f"{one.chart.title} ({one.chart.unit})": one.lines[0].y.tolist() for one in charts}
    assert unknown == []
    assert found == {
        "Position error (in)": pytest.approx([10, 20]),
        "Heading error (deg)": pytest.approx([0, 30]),
        "Spread (in)": pytest.approx([1, 2]),
        "Confidence (share)": pytest.approx([0.1, 0.2]),
        "Knows where it is (probability)": pytest.approx([0.2, 0.4]),
        "Effective sample size (share)": pytest.approx([0.3 / 4, 0.6 / 4]),
        "Evidence (nats)": pytest.approx([0.4, 0.8]),
    }
