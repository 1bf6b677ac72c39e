"""The panel of explanations, read back from recordings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import rerun.blueprint as rrb

from helpers import viz_fakes as fakes
from helpers import viz_recordings as recordings
from maurice_mcl.config.build import build_localizer
from maurice_mcl.config.parameters import FilterParameters, of_feature
from maurice_mcl.filter.localizer import run
from maurice_mcl.reasons.explanation import (
    explain_step,
)
from maurice_mcl.sensor.descriptors.registry import CHANNELS
from maurice_mcl.sensor.model import SensorModel, SensorParameters
from maurice_mcl.values.library import Library
from maurice_mcl.values.records import StepRecord
from maurice_mcl.values.session import Moment
from maurice_viz.drawing.contact_sheet import CARD_PX, blank_card
from maurice_viz.drawing.heat import CHART, HEATS, SHADES, grid_of, heat_of
from maurice_viz.drawing.reference_chart import (
    BAR_SHARE,
    CHART_PX,
    TEXT_SHARE,
    channel_color,
    draw_levels,
    draw_reference_chart,
    scale_of,
)
from maurice_viz.entities import Phase, RunPaths
from maurice_viz.layouts import one_run
from maurice_viz.panels.explanation import ExplanationPanel
from maurice_viz.panels.panel import StepUpdate, set_phase
from maurice_viz.scene import RunView
from maurice_viz.style import EMPTY, PICTURE, REFERENCE
from maurice_viz.viewer import sinks

Played = tuple[SensorModel, list[tuple[Moment, StepRecord]]]
PATHS = RunPaths("Lauf ä")


def play(library: Library, parameters: FilterParameters | None = None, *, has_truth: bool = True) -> Played:
    session = fakes.make_session(library, 3, has_truth)
    localizer = build_localizer(library, session, parameters or of_feature("blended", 80))
    return localizer.sensor, list(run(localizer, session, None))


def draw(path: Path, played: Played, *, has_truth: bool = True, left_out: int | None = None) -> None:
    sensor, updates = played
    library = sensor.library
    view = RunView(PATHS.label, tuple(sensor.weights), sensor)
    scene = recordings.scene_with(library, has_truth=has_truth)
    panel = ExplanationPanel(view, scene)
    with sinks.to_file(path, "Büro", rrb.Blueprint(one_run.explain(view, scene))) as rec:
        panel.prepare(rec)
        for moment, record in updates:
            if moment.frame.step == left_out:
                set_phase(rec, moment, Phase.ESTIMATE)
                panel.clear(rec)
            else:
                panel.draw(rec, StepUpdate(moment, record))


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    return fakes.make_library(tmp_path_factory.mktemp("pictures"))


@pytest.fixture(scope="module")
def drawn(library: Library, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Played]:
    path, played = tmp_path_factory.mktemp("drawn") / "out.rrd", play(library)
    draw(path, played)
    return path, played


def picture_of(row: recordings.Row) -> np.ndarray:
    blob = np.array(row.values["EncodedImage:blob"][0], np.uint8)
    return cv2.cvtColor(cv2.imdecode(blob, cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB)


def bar_of(chart: np.ndarray) -> list[int]:
    """Widths in pixels of the parts of the stacked bar, by the colors of the channels."""
    top = chart[: round(BAR_SHARE * len(chart) * 0.2)]
    rows = [(top == channel_color(channel)).all(axis=2) for channel in ("color", "edges")]
    return [int(row.any(axis=0).sum()) for row in rows]


def test_bars_are_as_long_as_the_nats_that_channels_lose(drawn):
    path, (sensor, updates) = drawn
    charts = {who: recordings.rows(path, PATHS.explain("chart", who)) for who in ("winner", "truth")}
    for k, (moment, record) in enumerate(updates):
        step = explain_step(record, sensor, moment.truth)
        scale = scale_of([e.entry for e in step.shown if e.entry is not None])
        for who, rows in charts.items():
            assert len(rows) == len(updates)
            entry = step.of(who).entry
            chart = picture_of(rows[k])
            np.testing.assert_array_equal(chart, CHART.colors[draw_reference_chart(entry, scale)])
            length = CHART_PX[0] - 8 - 3.2 * TEXT_SHARE * CHART_PX[0]
            expected = [channel.loses / scale.nats * length for channel in entry.channels]
            assert bar_of(chart) == pytest.approx(expected, abs=2)


def test_a_picture_equal_to_the_reference_covers_it_and_costs_nothing(library):
    sensor, updates = play(library)
    moment, record = updates[0]
    entry = explain_step(record, sensor, moment.truth).winner
    sums = [channel.nats.sum() for channel in entry.channels]
    assert sums == pytest.approx([channel.loses for channel in entry.channels], abs=1e-4)
    image = np.zeros((60, 84), np.uint8)
    ramp = np.linspace(0, 1, 84, dtype=np.float32)
    draw_levels(image, ramp, ramp, (0.0, 1.0))
    filled = (CHART.colors[image] == REFERENCE).all(axis=2).sum(axis=0)
    assert (np.diff(filled) >= -3).all()
    assert filled[-5:].mean() > 50 > 5 > filled[:5].mean()
    line = (CHART.colors[image] == PICTURE).all(axis=2)
    assert line.any(axis=0).all()


def test_two_dimensional_histograms_are_heat_maps():
    assert grid_of("chromaticity", 256) == (16, 16)
    assert grid_of("chromaticity", 255) is None
    assert grid_of("color", 84) is None
    values = np.zeros((16, 16), np.float32)
    values[15, 0], values[0, 15] = 1.0, 0.25
    heat = heat_of(values, 1.0, HEATS[0])
    assert CHART.colors[heat[0, 0]].tolist() == list(PICTURE)  # the last row is on top
    assert HEATS[0] < heat[15, 15] < HEATS[0] + SHADES - 1
    assert CHART.colors[heat[8, 8]].tolist() == list(EMPTY)


def test_cards_show_the_references_pictures_and_are_logged_when_they_change(drawn):
    path, (sensor, updates) = drawn
    entries = [explain_step(r, sensor, m.truth).winner.entry for m, r in updates]
    changes = [k for k, entry in enumerate(entries) if k == 0 or entry != entries[k - 1]]
    rows = recordings.rows(path, PATHS.explain("card", "winner"))
    assert [row.step for row in rows] == [updates[k][0].frame.step for k in changes]
    for row, k in zip(rows, changes, strict=True):
        blob = np.array(row.values["EncodedImage:blob"][0], np.uint8)
        card = cv2.cvtColor(cv2.imdecode(blob, cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB)
        picture = fakes.picture_at(sensor.library.poses[entries[k]])
        height = round(CARD_PX * picture.shape[0] / picture.shape[1])
        small = cv2.resize(picture, (CARD_PX, height), interpolation=cv2.INTER_AREA)
        assert np.abs(card[:height].astype(int) - small).mean() < 12
    tables = recordings.rows(path, PATHS.explain("table"))
    for row, entry in zip(tables, entries, strict=True):
        assert f"winner: {entry} |" in row.values["TextDocument:text"][0]


def test_table_and_arrows_are_there_at_every_update(drawn):
    path, (sensor, updates) = drawn
    tables, marks = (recordings.rows(path, p) for p in (PATHS.explain("table"), PATHS.explain("marks")))
    assert len(tables) == len(marks) == len(updates)
    for row, (moment, record) in zip(marks, updates, strict=True):
        step = explain_step(record, sensor, moment.truth)
        poses = np.array([np.zeros(3) if e.entry is None else e.entry.pose for e in step.shown])
        expected = poses[:, :2] / 0.0254 * (1, -1)
        np.testing.assert_allclose(row.values["Arrows2D:origins"], expected, atol=0.02)
        ways = np.array(row.values["Arrows2D:vectors"])
        turned = np.arctan2(-ways[:, 1], ways[:, 0])
        known = [e.entry is not None for e in step.shown]
        np.testing.assert_allclose(np.cos(turned - poses[:, 2])[known], 1, atol=1e-4)
    first = explain_step(updates[0][1], sensor, updates[0][0].truth)
    words = recordings.rows(path, PATHS.explain("words"))[0].values["TextDocument:text"][0]
    rival = first.of("truth").entry
    assert f"{rival.rank} of {rival.entries}" in words.splitlines()[0]
    assert rival.entry == first.winner.entry or f"{rival.behind:.1f} nats behind" in words


def test_without_truth_there_are_two_columns(library, tmp_path):
    played = play(library, has_truth=False)
    draw(tmp_path / "out.rrd", played, has_truth=False)
    found = recordings.entities_of(tmp_path / "out.rrd")
    assert PATHS.explain("card", "truth") not in found
    assert {PATHS.explain("card", "estimate"), PATHS.explain("card", "winner")} <= found


def test_a_truth_that_is_missing_for_a_while_says_so_in_its_column(library, tmp_path):
    sensor, updates = play(library)
    some = [
        (moment if k else replace(moment, truth=None), record) for k, (moment, record) in enumerate(updates)
    ]
    draw(tmp_path / "out.rrd", (sensor, some))
    first, second = recordings.rows(tmp_path / "out.rrd", PATHS.explain("card", "truth"))[:2]
    assert bytes(first.values["EncodedImage:blob"][0]) == blank_card(98, "truth not known here")
    assert len(bytes(second.values["EncodedImage:blob"][0])) > 0
    first_table = recordings.rows(tmp_path / "out.rrd", PATHS.explain("table"))[0]
    assert "truth" not in first_table.values["TextDocument:text"][0]


def test_one_entry_and_no_pictures(tmp_path):
    draw(tmp_path / "out.rrd", play(fakes.make_library()))
    row = recordings.rows(tmp_path / "out.rrd", PATHS.explain("card", "winner"))[0]
    card = cv2.imdecode(np.array(row.values["EncodedImage:blob"][0], np.uint8), cv2.IMREAD_COLOR)
    assert card.shape[1] == CARD_PX
    assert np.ptp(card[:20].astype(int), axis=2).max() < 20
    draw(tmp_path / "one.rrd", play(fakes.make_library(tmp_path, columns=1, rows=1, headings=1)))
    for row in recordings.rows(tmp_path / "one.rrd", PATHS.explain("words")):
        assert "there" in row.values["TextDocument:text"][0] or "within" in row.values["TextDocument:text"][0]


def test_a_saved_run_without_its_library_says_so(library, tmp_path):
    view = RunView(PATHS.label, ("color", "edges"))
    panel = ExplanationPanel(view, recordings.scene_with(library))
    _, updates = play(library)
    with sinks.to_file(tmp_path / "out.rrd", "x", rrb.Blueprint()) as rec:
        panel.prepare(rec)
        panel.draw(rec, StepUpdate(*updates[0]))
    found = {name for name in recordings.entities_of(tmp_path / "out.rrd") if "explain" in name}
    assert found == {PATHS.explain("table")}


def test_an_update_that_is_left_out_shows_nothing_and_the_next_one_everything(library, tmp_path):
    sensor, updates = play(library)
    again = [updates[0], updates[1], (updates[2][0], replace(updates[0][1], frame=updates[2][1].frame))]
    draw(tmp_path / "out.rrd", (sensor, again), left_out=2)
    tables = [
        row.values["TextDocument:text"][0]
        for row in recordings.rows(tmp_path / "out.rrd", PATHS.explain("table"))
    ]
    assert "--detail" in tables[1]
    assert "--detail" not in tables[0] + tables[2]
    cards = recordings.rows(tmp_path / "out.rrd", PATHS.explain("card", "winner"))
    assert [(row.step, "EncodedImage:blob" in row.values) for row in cards] == [
        (1, True),
        (2, False),
        (3, True),
    ]


def with_all_channels(library: Library) -> tuple[Library, FilterParameters]:
    weights: Mapping[str, float] = dict.fromkeys(list(CHANNELS)[:12], 0.1)
    images = [fakes.picture_at(pose) for pose in library.poses[:40]]
    index = {name: fakes.index_of(images, name) for name in weights}
    many = Library("viele", library.poses[:40], library.pictures[:40], index, library.arena, "in")
    return many, FilterParameters(sensor=SensorParameters(weights), particles=40)


def test_twelve_channels_each_have_a_chart_with_their_name(library, tmp_path):
    many, parameters = with_all_channels(library)
    played = play(many, parameters)
    draw(tmp_path / "out.rrd", played)
    chart = picture_of(recordings.rows(tmp_path / "out.rrd", PATHS.explain("chart", "winner"))[0])
    under = round(BAR_SHARE * len(chart))
    for row in range(3):
        for column in range(4):
            high, wide = (len(chart) - under) // 3, chart.shape[1] // 4
            part = chart[under + row * high :, column * wide :][:high, :wide]
            assert (part[: high // 2] != part[0, 0]).any()
            name = part[-12:-2]
            assert (name.max(axis=2) > 110).sum() > 20
