from __future__ import annotations

import numpy as np
import pytest

from maurice_mcl.config.build import build_localizer
from maurice_mcl.config.parameters import of_feature
from maurice_mcl.sensor.virtual_references import virtual_references
from maurice_mcl.values.geometry import wrap
from maurice_mcl.values.library import ChannelIndex
from maurice_mcl.values.map import Arena, crosses

PITCH = 0.5


def _grid(columns, rows, headings=8, turned=0.0):
    x, y = np.meshgrid(np.arange(columns) * PITCH, np.arange(rows) * PITCH)
    each = wrap(np.arange(headings) * 2 * np.pi / headings + turned)
    xy = np.column_stack([x.ravel(), y.ravel()])
    return np.column_stack([np.repeat(xy, headings, axis=0), np.tile(each, len(xy))])


def _arena(walls=()):
    return Arena((-1.0, -1.0, 6.0, 6.0), np.reshape(walls, (-1, 4)))


def _index(references):
    size = references.shape[1]
    return ChannelIndex(references.astype(np.float32), np.zeros(size, np.float32), np.ones(size, np.float32))


@pytest.mark.parametrize(("columns", "rows"), [(1, 1), (4, 1), (3, 2), (5, 4)])
def test_a_grid_gets_all_middles_of_places_and_headings_once(columns, rows):
    found = virtual_references(_grid(columns, rows), _arena())
    edges = (columns - 1) * rows + columns * (rows - 1)
    cells = (columns - 1) * (rows - 1)
    assert len(found.poses) == columns * rows * 8 + (edges + cells) * 16
    assert len(np.unique(np.round(found.poses, 6), axis=0)) == len(found.poses)


def test_poses_are_the_middles_of_their_sources_across_half_a_turn_too():
    poses = _grid(3, 3, turned=0.1)
    found = virtual_references(poses, _arena())
    sources = poses[found.sources]
    assert found.poses[:, :2] == pytest.approx(sources[..., :2].mean(axis=1))
    off = wrap(sources[..., 2] - found.poses[:, 2:])
    assert np.abs(off).max() <= np.pi / 8 + 1e-9
    assert off.mean(axis=1) == pytest.approx(0, abs=1e-9)


def test_what_changes_evenly_with_the_place_is_met_exactly():
    poses = _grid(4, 3)

    def seen(at):
        return np.column_stack([2 * at[:, 0] - at[:, 1], 0.3 * at[:, 1] + 1])

    found = virtual_references(poses, _arena())
    extended = found.extend({"color": _index(seen(poses))})["color"].references
    assert np.array_equal(extended[: len(poses)], seen(poses).astype(np.float32))
    assert extended[len(poses) :] == pytest.approx(seen(found.poses), abs=1e-6)


def test_sources_are_seen_from_the_middle():
    wall = [1.2, -1.0, 1.2, 1.2]
    found = virtual_references(_grid(5, 4), _arena(wall))
    sources = _grid(5, 4)[found.sources][..., :2]
    for k in range(1, sources.shape[1]):
        assert not crosses(sources[:, 0], sources[:, k], np.array([wall])).any()
    free = virtual_references(_grid(5, 4), _arena())
    assert len(found.poses) < len(free.poses)
    four = virtual_references(_grid(2, 1, headings=4), _arena())
    assert len(four.poses) == 4  # the middle of the two places, but no heading between two at right angles
    there_and_back = np.array([[0.0, 0.0, 0.0], [0.5, 0.0, np.pi]])
    assert len(virtual_references(there_and_back, _arena()).poses) == 0
    assert len(virtual_references(there_and_back[:1], _arena()).poses) == 0


def test_a_localizer_weighs_by_them_and_records_only_the_librarys_entries(world):
    session = world.drive
    localizer = build_localizer(world.library, session, of_feature("blended", 50))
    _, record = localizer.step(localizer.initialize(None), session.all_moments[0].frame)
    comparison = record.sighting.comparison
    assert comparison.log_likelihood.shape == (world.library.size,)
    assert comparison.distances.shape == (2, world.library.size)
    extra = virtual_references(world.library.poses, world.library.arena)
    assert comparison.virtual.shape == (len(extra.poses),)
    assert record.sighting.entries.max() < world.library.size


def test_a_particle_where_a_middle_is_gets_its_likelihood(world):
    localizer = build_localizer(world.library, world.drive, of_feature("blended", 50))
    extra = virtual_references(world.library.poses, world.library.arena)
    comparison = localizer.sensor.compare(localizer.sensor.measure(world.drive.all_moments[0].frame.image))
    poses = extra.poses - np.append(world.library.origin, 0)
    found = localizer.sensor.at(comparison, poses.astype(np.float32))
    inside = found.entries >= 0
    assert inside.mean() > 0.5
    # a kernel lets the neighbors have a say as well, so they are alike and not equal
    assert np.corrcoef(found.log_likelihood[inside], comparison.virtual[inside])[0, 1] > 0.9
