"""A map as a library: places on a lattice that stand for all free cells."""

from __future__ import annotations

import numpy as np
import pytest

from maurice_mcl.errors import InputError
from maurice_mcl.sensor.map_places import HEADINGS, LEAST_APART_M, MOST_PLACES, map_library, reference_of
from maurice_mcl.values.geometry import wrap
from maurice_mcl.values.laser import FREE, OCCUPIED, UNKNOWN, OccupancyMap
from maurice_mcl.values.map import MOST_CELLS

CORNER = np.array([-3.0, 7.0])


def rooms(height=90, width=200, cell_m=0.05):
    """Two rooms of another size with a door, walls around, and nothing known beyond."""
    cells = np.full((height, width), UNKNOWN, np.uint8)
    cells[5:-5, 5:-5] = OCCUPIED
    cells[6:-6, 6:-6] = FREE
    cells[6:-6, width // 3] = OCCUPIED
    cells[height // 2 : height // 2 + 12, width // 3] = FREE
    return OccupancyMap(cells, cell_m, CORNER)


def centers(grid, states):
    rows, columns = np.nonzero(states)
    return grid.corner + grid.cell_m * (np.column_stack([columns, rows]) + 0.5)


@pytest.mark.parametrize("cell_m", [0.02, 0.05, 0.3])
def test_places_are_free_cells_and_near_to_every_free_cell(cell_m):
    grid = rooms(cell_m=cell_m)
    library = map_library(grid, "rooms")
    places = library.poses[::HEADINGS, :2]
    assert (grid.states_at(places) == FREE).all()
    area_m2 = grid.free.sum() * cell_m**2
    apart_m = max(LEAST_APART_M, np.sqrt(area_m2 / MOST_PLACES), cell_m) + cell_m
    free = centers(grid, grid.free)
    off = np.sqrt(((free[:, None] - places) ** 2).sum(axis=2)).min(axis=1)
    assert off.max() <= np.sqrt(2) * apart_m
    assert len(places) <= 2 * MOST_PLACES


def test_every_place_has_all_headings_and_no_picture():
    library = map_library(rooms(), "rooms")
    assert library.is_map
    assert set(library.index) == set()
    by_place = library.poses.reshape(-1, HEADINGS, 3)
    assert (by_place[:, :, :2] == by_place[:, :1, :2]).all()
    assert np.allclose(np.diff(by_place[:, :, 2], axis=1), 2 * np.pi / HEADINGS)
    assert np.abs(by_place[:, :, 2]).max() < np.pi


def test_a_pose_counts_for_the_nearest_place_and_its_heading():
    grid = rooms()
    library = map_library(grid, "rooms")
    reference, random = reference_of(library), np.random.default_rng(4)
    free = centers(grid, grid.free)
    poses = np.column_stack([free[random.integers(0, len(free), 500)], random.uniform(-np.pi, np.pi, 500)])
    entries = reference.entries(poses.astype(np.float32), np.zeros(2))
    chosen = library.poses[entries]
    places = library.poses[::HEADINGS, :2]
    nearest = np.sqrt(((poses[:, None, :2] - places) ** 2).sum(axis=2)).min(axis=1)
    assert np.abs(np.hypot(*(chosen - poses)[:, :2].T) - nearest).max() < 1e-4
    assert np.abs(wrap(chosen[:, 2] - poses[:, 2])).max() <= np.pi / HEADINGS + 1e-4


def test_no_cell_of_the_map_is_ruled_out_nor_what_is_beyond_it():
    """A robot may stand where a cell was not seen, is taken for occupied, or is missing."""
    grid = rooms()
    reference = reference_of(map_library(grid, "rooms"))
    everywhere = centers(grid, np.ones_like(grid.free))
    poses = np.column_stack([everywhere, np.zeros(len(everywhere))]).astype(np.float32)
    assert (reference.entries(poses, np.zeros(2)) >= 0).all()
    x_min, y_min, x_max, y_max = grid.bounds
    beyond = np.array([[x_min - 0.1, y_min + 1, 0], [x_max + 0.1, y_min + 1, 0], [x_min + 1, y_max + 0.1, 0]])
    assert (reference.entries(beyond.astype(np.float32), np.zeros(2)) >= 0).all()


def test_a_map_of_many_cells_has_a_coarser_raster_with_the_same_free_space():
    side = int(np.sqrt(MOST_CELLS)) + 401
    cells = np.full((side, side - 3), UNKNOWN, np.uint8)
    cells[100:900, 200:1200] = FREE
    grid = OccupancyMap(cells, 0.01, CORNER)
    raster = reference_of(map_library(grid, "large")).grid
    assert raster.free.size <= MOST_CELLS
    assert raster.free.sum() * raster.cell_m**2 == pytest.approx(8.0 * 10.0, rel=0.01)


def test_a_map_without_free_cells_is_refused():
    with pytest.raises(InputError, match="no free cell"):
        map_library(OccupancyMap(np.full((4, 5), OCCUPIED, np.uint8), 0.1, CORNER), "inverted")


def test_off_the_map_a_pose_counts_as_on_a_map_with_a_border():
    grid = rooms()
    wide = OccupancyMap(
        np.pad(grid.cells, 80, constant_values=UNKNOWN), grid.cell_m, CORNER - 80 * grid.cell_m
    )
    library, random = map_library(grid, "rooms"), np.random.default_rng(5)
    low, high = np.array(wide.bounds).reshape(2, 2)
    poses = np.column_stack(
        [random.uniform(low, high, (3000, 2)) - library.origin, random.uniform(-3, 3, 3000)]
    )
    poses = poses.astype(np.float32)
    reference, beyond = reference_of(library), reference_of(map_library(wide, "rooms"))
    entries = reference.entries(poses, library.origin)
    assert (reference.grid.cells_of(poses[:, :2], library.origin) < 0).mean() > 0.3
    # of two places that are as near any may count, and a pose at the edge of a cell be rounded into the next
    assert (entries == beyond.entries(poses, library.origin)).mean() > 0.98
    nats = np.arange(library.size, dtype=np.float32)
    np.testing.assert_array_equal(reference.look(nats, poses, library.origin)[1], nats[entries])
    assert (
        reference.entries(np.array([[np.nan, 0, 0], [1e9, 0, 0]], np.float32), np.zeros(2)).tolist()[0] == -1
    )
