"""Figures: the map of expected ambiguity shows walls and look-alikes; a name ends as can be written."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from helpers import viz_fakes as fakes
from maurice_loaders.errors import InputError
from maurice_loaders.libraries.store import build_library
from maurice_mcl.library.left_out import LeftOutTable
from maurice_mcl.library.quality import SelfSimilarity, self_similarity_of
from maurice_mcl.sensor.model import SensorModel, SensorParameters
from maurice_mcl.sensor.references import nearest_reference
from maurice_mcl.values.arrays import U8
from maurice_mcl.values.library import Library
from maurice_viz.plots.calibration import figure, save
from maurice_viz.plots.sheets import draw_ambiguity
from maurice_viz.style import DEAD, PALE, WALL, scale_for


def checked(library: Library) -> SelfSimilarity:
    nearest = nearest_reference(library.poses, library.arena)
    return self_similarity_of(
        LeftOutTable.of(SensorModel(library, nearest, SensorParameters({"color": 1.0})))
    )


def pixels_of(image: U8, color: tuple[int, int, int]) -> int:
    return int((image == np.array(color, np.uint8)).all(axis=2).sum())


def test_walls_are_drawn_where_there_are_some(small_session):
    library = build_library(small_session.parent / "survey.log", ["color"])
    scale = scale_for(library.display_units, library.arena)
    bare = replace(library, arena=replace(library.arena, walls=np.zeros((0, 4))))
    walled = replace(library, arena=replace(library.arena, walls=np.array([[0.1, 0.1, 1.9, 0.1]])))
    drawn = [pixels_of(draw_ambiguity(one, checked(one), scale), WALL) for one in (bare, walled)]
    assert drawn[1] > drawn[0] + 300


def test_the_title_of_the_map_of_ambiguity_fits():
    """On a map that is higher than wide, too."""
    library = fakes.make_library(columns=2, rows=9)
    scale = scale_for("in", library.arena)
    image = draw_ambiguity(library, checked(library), scale)
    ink = (np.abs(image.astype(int) - PALE) < 40).all(axis=2)[: image.shape[0] // 20]
    columns = np.flatnonzero(ink.any(axis=0))
    assert len(columns) > 100
    assert columns[-1] < image.shape[1] - 3


def test_a_pair_of_look_alikes_is_a_line_from_dot_to_dot(small_session):
    library = build_library(small_session.parent / "survey.log", ["color"])
    found, scale = checked(library), scale_for(library.display_units, library.arena)
    margin = np.full(library.size, np.nan)
    none, one = (replace(found, margin=values) for values in (margin, np.append(margin[:-1], -1.0)))
    assert one.aliased.tolist() == [library.size - 1]
    pair = found.places[found.place_of[[library.size - 1, found.alias[-1]]]]
    moved = replace(library, poses=library.poses + np.array([0.3, 0.3, 0.0]))  # entries, not places
    lines = [draw_ambiguity(of, one, scale) for of in (library, moved)]
    assert pixels_of(lines[0], DEAD) > pixels_of(draw_ambiguity(library, none, scale), DEAD) + 100
    assert np.hypot(*(pair[0] - pair[1])) > 1
    assert (lines[0] == lines[1]).all()


@pytest.mark.parametrize("name", ["noise", "noise.", "noise.jpeg"])
def test_a_figure_needs_an_ending_that_can_be_written(name, tmp_path):
    drawing, _ = figure("title", "x", "y")
    with pytest.raises(InputError, match=r"expected \.png, \.svg, \.pdf"):
        save(drawing, tmp_path / name, force=False)
