"""What is asked of a library whose places are too far apart, or too few."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import maurice_mcl as mcl
from maurice_mcl.library.left_out import ENOUGH_PLACES, LeftOutTable, PlaceScore
from maurice_mcl.library.quality import coverage_of, self_similarity_of
from maurice_viz.app.library_check import _wanted_m

TELLS = PlaceScore(3, 24, -1.0, -2.0, 1.0)
WORSE = PlaceScore(3, 24, -3.0, -2.0, 100.0)


def test_places_are_asked_for_where_the_view_does_not_reach_the_next_or_a_few_cannot_be_told_apart():
    sensor = mcl.make_localizer(mcl.tiny_library()).sensor
    library, found = sensor.library, self_similarity_of(LeftOutTable.of(sensor))
    spacing_m = found.spacing_m
    near, far = replace(found, reach_m=0.8 * spacing_m), replace(found, reach_m=3 * spacing_m)
    assert _wanted_m(library, far, TELLS) == spacing_m
    assert _wanted_m(library, near, TELLS) == 0.8 * spacing_m
    assert _wanted_m(library, replace(near, reach_m=0.0), TELLS) == spacing_m / 2
    enough_m = np.sqrt(coverage_of(library, spacing_m).free_m2 / ENOUGH_PLACES)
    assert _wanted_m(library, far, WORSE) == pytest.approx(min(enough_m, spacing_m))
    assert _wanted_m(library, far, replace(WORSE, places=ENOUGH_PLACES)) == spacing_m
