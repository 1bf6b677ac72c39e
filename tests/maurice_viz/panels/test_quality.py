"""The chart of qualities by reference number, read back from a recording."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from helpers import viz_fakes as fakes
from helpers import viz_recordings as recordings
from maurice_viz.drawing.quality_chart import CHART_PX, COLORS, MarkedEntry, QualityChart
from maurice_viz.entities import RunPaths
from maurice_viz.panels.panel import EntryFinder
from maurice_viz.style import NODE, RANK, RUN_COLORS, TRUTH

RUN = RunPaths("blended")


def test_every_update_marks_the_truth_the_estimate_and_the_best(tmp_path: Path) -> None:
    library = fakes.make_library(tmp_path)
    path = tmp_path / "out.rrd"
    (played,) = recordings.draw(path, fakes.make_session(library, 4), ["blended"])
    finder, chart = EntryFinder.of(library), QualityChart(library.size)
    rows = recordings.rows(path, RUN.qualities)
    assert len(rows) == len(played) == 4
    for row, (moment, record) in zip(rows, played, strict=True):
        comparison = record.sighting.comparison
        marked = [
            MarkedEntry("best", int(comparison.ranking()[0]), RANK),
            MarkedEntry("estimate's", finder.entry_at(record.estimate.pose), RUN_COLORS[0]),
            MarkedEntry("truth's", finder.entry_at(moment.truth), TRUTH),
        ]
        image = cv2.imdecode(np.array(row.values["EncodedImage:blob"][0], np.uint8), cv2.IMREAD_COLOR)
        expected = COLORS.colors[chart.draw(comparison.quality, marked)]
        np.testing.assert_array_equal(image[:, :, ::-1], expected)


def test_without_truth_none_is_marked(tmp_path: Path) -> None:
    library = fakes.make_library(tmp_path)
    path = tmp_path / "out.rrd"
    recordings.draw(path, fakes.make_session(library, 2, has_truth=False), ["blended"])
    for row in recordings.rows(path, RUN.qualities):
        image = cv2.imdecode(np.array(row.values["EncodedImage:blob"][0], np.uint8), cv2.IMREAD_COLOR)
        assert not (image == TRUTH).all(axis=2).any()


def test_dots_are_as_high_as_the_qualities() -> None:
    quality = np.array([0.0, 0.25, 0.75, 1.0], np.float32)
    chart = QualityChart(4)
    plain = COLORS.colors[chart.draw(quality, [])]
    for entry, (column, row) in enumerate(zip(chart.columns, chart.rows(quality), strict=True)):
        assert tuple(plain[row, column]) == NODE, entry
    assert (np.diff(chart.rows(quality)) < 0).all()
    found = COLORS.colors[chart.draw(quality, [MarkedEntry("truth's", 2, TRUTH)])]
    white = (found == TRUTH).all(axis=2)
    assert white[chart.rows(quality)[2], chart.columns[2]]
    assert not white[:, : chart.columns[2] - 3][20:].any()


@pytest.mark.parametrize("entries", [1, 2, 3, 20_000])
def test_libraries_of_any_size_have_a_chart(entries: int) -> None:
    chart = QualityChart(entries)
    drawn = chart.draw(np.ones(entries, np.float32), [MarkedEntry("truth's", entries - 1, TRUTH)])
    assert drawn.shape == CHART_PX[::-1]
