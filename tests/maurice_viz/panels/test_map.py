"""What lies on the map: match circles of references, library nodes, walls."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from helpers import viz_fakes as fakes
from helpers import viz_recordings as recordings
from helpers.step_records import made
from maurice_mcl.config.build import build_localizer
from maurice_mcl.config.parameters import PRESETS, Layer, configure
from maurice_mcl.filter.estimate import heaviest_cluster
from maurice_mcl.filter.localizer import run
from maurice_mcl.scoring.modes import TrackedMode
from maurice_mcl.values.map import Arena
from maurice_viz.entities import RunPaths
from maurice_viz.panels.panel import joined_labels
from maurice_viz.panels.population import rings_of
from maurice_viz.panels.references import LARGEST_RADIUS, SMALLEST_RADIUS, MatchCircles
from maurice_viz.panels.world import clipped
from maurice_viz.style import scale_for
from maurice_viz.viewer.sinks import recording


def test_circles_stand_off_their_node_along_their_heading():
    library = fakes.make_library()
    scale = scale_for("in", library.arena)
    circles = MatchCircles(library, scale)
    assert circles.spacing == pytest.approx(18)
    off = (circles.centers - scale.screen(library.poses)) * (1, -1)
    np.testing.assert_allclose(np.arctan2(off[:, 1], off[:, 0]), library.poses[:, 2], atol=0.01)


@pytest.mark.parametrize("sharpness", [0.01, 1.0, 20.0])
def test_a_circles_diameter_is_proportional_to_the_match_quality(sharpness, tmp_path):
    """Also where likelihoods are flat: in nats below the best nearly all of the thesis's were alike."""
    library = fakes.make_library()
    session = fakes.make_session(library, 3)
    settings = {"particles": 60, "sensor.sharpness": sharpness}
    configured = configure([Layer("preset", PRESETS["thesis"]), Layer("test", settings)])
    localizer = build_localizer(library, session, configured.parameters)
    circles, path = MatchCircles(library, scale_for("in", library.arena)), RunPaths("run")
    (_, record), *_ = run(localizer, session, None)
    quality = record.sighting.comparison.quality
    rec = recording("circles")
    rec.save(tmp_path / "circles.rrd")
    rec.set_time("phase", sequence=1)
    circles.draw(rec, path, record.sighting.comparison)
    rec.flush()
    rec.disconnect()
    (row,) = recordings.rows(tmp_path / "circles.rrd", path.circles)
    radii = np.array(row.values["Points2D:radii"])
    clear = quality > SMALLEST_RADIUS / LARGEST_RADIUS
    np.testing.assert_allclose(radii[clear] / quality[clear], 18 * LARGEST_RADIUS, rtol=1e-4)
    assert radii[clear].std() > 0.05 * radii[clear].mean() > 0


def test_references_at_one_place_share_a_label():
    places = np.array([[0, 0], [1, 0], [9, 0], [0, 1], [2, 0]], np.float32)
    assert joined_labels(places, 1.2, "12345") == [
        "1, 2, 4",
        "",
        "3",
        "",
        "5",
    ]  # the fifth is near the second alone
    assert joined_labels(places, 0.5, "12345") == ["1", "2", "3", "4", "5"]


def test_walls_are_cut_at_the_bounds():
    bounds = (0.0, 0.0, 4.0, 3.0)
    walls = np.array(
        [
            [1.0, 1.0, 2.0, 2.0],  # inside: as it is
            [-2.0, 1.0, 2.0, 1.0],  # cut on one side
            [2.0, -5.0, 2.0, 9.0],  # cut on both
            [-1.0, -1.0, 5.0, 5.0],  # slanted, through two corners' sides
            [0.0, 0.0, 4.0, 0.0],  # on the border
            [5.0, 0.0, 5.0, 3.0],  # beside, parallel
            [-3.0, 2.0, 1.0, 6.0],  # passes the corner outside
        ]
    )
    expected = [[1, 1, 2, 2], [0, 1, 2, 1], [2, 0, 2, 3], [0, 0, 3, 3], [0, 0, 4, 0]]
    np.testing.assert_allclose(clipped(walls, bounds), expected)
    assert clipped(np.zeros((0, 4)), bounds).shape == (0, 4)


def test_rings_are_around_modes_where_two_hold_a_tenth_of_the_weight_or_more():
    scale = scale_for("m", Arena((0.0, 0.0, 5.0, 4.0), np.zeros((0, 4))))
    one, two, small = (
        TrackedMode(k, heaviest_cluster(made([(x, 1.0, 1.0)]).weighted))
        for k, x in ((1, 1.0), (2, 4.0), (3, 2.0))
    )
    shared = [
        replace(mode, estimate=replace(mode.estimate, mass=mass))
        for mode, mass in ((one, 0.6), (two, 0.35), (small, 0.05))
    ]
    parts = rings_of(shared, scale, 0.5).as_component_batches()
    row = {part.component_descriptor().component: part.as_arrow_array() for part in parts}
    assert row["LineStrips2D:labels"].to_pylist() == ["60 %", "35 %"]
    for strip, mode in zip(row["LineStrips2D:strips"].to_pylist(), shared, strict=False):
        ring = np.array(strip)
        middle = scale.screen(mode.estimate.pose[None, :2])[0]
        away = np.hypot(*(ring - middle).T)
        radius = scale.length(mode.estimate.radii.cluster_m) * np.sqrt(mode.estimate.mass)
        assert away == pytest.approx(radius, rel=1e-3)
    parts = rings_of(shared, scale, scale.length(4.0)).as_component_batches()
    row = {part.component_descriptor().component: part.as_arrow_array() for part in parts}
    assert row["LineStrips2D:labels"].to_pylist() == ["60 %, 35 %", ""]
    alone = rings_of([replace(one, estimate=replace(one.estimate, mass=0.95)), shared[2]], scale, 0.5)
    assert all(len(part.as_arrow_array()) == 0 for part in alone.as_component_batches())
