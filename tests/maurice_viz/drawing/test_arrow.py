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
    tensor_of,
    text_of,
    ui_points_of,
)

PLACES = np.random.default_rng(1).random((7, 2), np.float32)
NUMBERS = np.arange(7, dtype=np.float32)
PACKED = np.array([0x112233FF, 0x445566FF], np.uint32)
LINES = [PLACES[:4], PLACES[4:]]
IN_SPACE = np.random.default_rng(2).random((2, 4, 3), np.float32)
POINTS = rr.components.Radius.ui_points


@pytest.mark.parametrize(
    ("ready", "usual"),
    [
        (row_of(rr.Points2D, positions=points_of(PLACES)), rr.Points2D.from_fields(positions=PLACES)),
        (row_of(rr.Points2D, positions=points_of([])), rr.Points2D.from_fields(positions=[])),
        (row_of(rr.Points2D, colors=colors_of(PACKED)), rr.Points2D.from_fields(colors=PACKED)),
        (row_of(rr.Points2D, radii=floats_of(NUMBERS)), rr.Points2D.from_fields(radii=NUMBERS)),
        (row_of(rr.Points2D, radii=ui_points_of([2.5])), rr.Points2D.from_fields(radii=POINTS(2.5))),
        (
            row_of(rr.Arrows2D, origins=points_of(PLACES), vectors=points_of(PLACES[::-1])),
            rr.Arrows2D.from_fields(origins=PLACES, vectors=PLACES[::-1]),
        ),
        (row_of(rr.LineStrips2D, strips=strips_of(LINES)), rr.LineStrips2D.from_fields(strips=LINES)),
        (row_of(rr.LineStrips2D, strips=strips_of([])), rr.LineStrips2D.from_fields(strips=[])),
        (
            row_of(rr.LineStrips2D, strips=strips_of(PLACES[:6].reshape(3, 2, 2))),
            rr.LineStrips2D.from_fields(strips=PLACES[:6].reshape(3, 2, 2)),
        ),
        (
            row_of(rr.LineStrips3D, strips=space_strips_of(IN_SPACE)),
            rr.LineStrips3D.from_fields(strips=IN_SPACE),
        ),
        (
            row_of(rr.Points3D, positions=places_of(IN_SPACE[0])),
            rr.Points3D.from_fields(positions=IN_SPACE[0]),
        ),
        (
            row_of(rr.Transform3D, translation=places_of([1, 2, 3])),
            rr.Transform3D.from_fields(translation=[1, 2, 3]),
        ),
        (row_of(rr.EncodedImage, blob=blob_of(b"picture")), rr.EncodedImage.from_fields(blob=b"picture")),
        (row_of(rr.TextDocument, text=text_of("0.5 m²")), rr.TextDocument.from_fields(text="0.5 m²")),
        (row_of(rr.BarChart, values=tensor_of(NUMBERS)), rr.BarChart.from_fields(values=NUMBERS)),
        (scalars(1.5), rr.Scalars(1.5)),
        (scalars([1.5, 2.5]), rr.Scalars([1.5, 2.5])),
        (
            row_of(rr.Measurements, values=doubles_of(1.5), variances=doubles_of(0.5)),
            rr.Measurements.from_fields(values=1.5, variances=0.5),
        ),
    ],
)
def test_a_ready_row_is_what_rerun_would_have_made(ready, usual):
    wanted = {b.component_descriptor(): b.as_arrow_array() for b in usual.as_component_batches()}
    found = {b.component_descriptor(): b.as_arrow_array() for b in ready}
    assert found.keys() == wanted.keys()
    for descriptor, values in found.items():
        values.validate(full=True)
        assert values.type == wanted[descriptor].type
        assert values.equals(wanted[descriptor])
