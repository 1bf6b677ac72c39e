"""Ready-made rows are the rows that Rerun would have made."""

from __future__ import annotations

import numpy as np
import pytest
import rerun as rr

from maurice_viz.drawing.arrow import (
    blob_of,
    colors_of,
    doubles_of,
    floats_of,
    places_of,
    points_of,
    row_of,
    scalars,
    space_strips_of,
    strips_of,
    text_of,
    ui_points_of,
)

PLACES = np.random.default_rng(1).random((7, 2), np.float32)
NUMBERS = np.arange(7, dtype=np.float32)
PACKED = np.array([0x112233FF, 0x445566FF], np.uint32)
LINES = [PLACES[:4], PLACES[4:]]
IN_SPACE = np.random.default_rng(2).random((2, 4, 3), np.float32)
POINTS = rr.components.Radius.ui_points


STRIPS = PLACES[:6].reshape(3, 2, 2)
CASES = [
    (rr.Points2D, {"positions": points_of(PLACES)}, {"positions": PLACES}),
    (rr.Points2D, {"positions": points_of([])}, {"positions": []}),
    (rr.Points2D, {"colors": colors_of(PACKED)}, {"colors": PACKED}),
    (rr.Points2D, {"radii": floats_of(NUMBERS)}, {"radii": NUMBERS}),
    (rr.Points2D, {"radii": ui_points_of([2.5])}, {"radii": POINTS(2.5)}),
    (rr.Arrows2D, {"origins": points_of(PLACES)}, {"origins": PLACES}),
    (rr.Arrows2D, {"vectors": points_of(PLACES[::-1])}, {"vectors": PLACES[::-1]}),
    (rr.LineStrips2D, {"strips": strips_of(LINES)}, {"strips": LINES}),
    (rr.LineStrips2D, {"strips": strips_of([])}, {"strips": []}),
    (rr.LineStrips2D, {"strips": strips_of(STRIPS)}, {"strips": STRIPS}),
    (rr.LineStrips3D, {"strips": space_strips_of(IN_SPACE)}, {"strips": IN_SPACE}),
    (rr.Points3D, {"positions": places_of(IN_SPACE[0])}, {"positions": IN_SPACE[0]}),
    (rr.Transform3D, {"translation": places_of([1, 2, 3])}, {"translation": [1, 2, 3]}),
    (rr.EncodedImage, {"blob": blob_of(b"picture")}, {"blob": b"picture"}),
    (rr.TextDocument, {"text": text_of("0.5 m²")}, {"text": "0.5 m²"}),
    (rr.Measurements, {"values": doubles_of(1.5)}, {"values": 1.5}),
    (rr.Measurements, {"variances": doubles_of(0.5)}, {"variances": 0.5}),
]
ROWS = [(row_of(kind, **ready), kind.from_fields(**usual)) for kind, ready, usual in CASES]
ROWS += [(scalars(value), rr.Scalars(value)) for value in (1.5, [1.5, 2.5])]


@pytest.mark.parametrize(("ready", "usual"), ROWS)
def test_a_ready_row_is_what_rerun_would_have_made(ready, usual):
    wanted = {b.component_descriptor(): b.as_arrow_array() for b in usual.as_component_batches()}
    found = {b.component_descriptor(): b.as_arrow_array() for b in ready.as_component_batches()}
    assert found.keys() == wanted.keys()
    for descriptor, values in found.items():
        values.validate(full=True)
        assert values.type == wanted[descriptor].type
        assert values.equals(wanted[descriptor])
