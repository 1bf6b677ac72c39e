"""Occupancy grids become walls."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from maurice_loaders.bags.localizer import MOST_WALLS, arena_of


def grid(
    cells: np.ndarray, side_m: float = 0.5, at: tuple[float, float, float] = (0, 0, 0)
) -> SimpleNamespace:
    q = SimpleNamespace(x=0.0, y=0.0, z=np.sin(at[2] / 2), w=np.cos(at[2] / 2))
    origin = SimpleNamespace(position=SimpleNamespace(x=at[0], y=at[1], z=0.0), orientation=q)
    info = SimpleNamespace(width=cells.shape[1], height=cells.shape[0], resolution=side_m, origin=origin)
    return SimpleNamespace(info=info, data=cells.reshape(-1).astype(np.int8))


def test_one_cell_has_four_walls() -> None:
    cells = np.zeros((4, 6), int)
    cells[1, 2] = 100
    cells[3, 3] = -1  # unknown is no wall
    arena = arena_of(grid(cells, at=(10.0, 20.0, 0.0)))
    assert arena.bounds == (10.0, 20.0, 13.0, 22.0)
    walls = {tuple(wall) for wall in arena.walls.tolist()}
    assert walls == {
        (11.0, 20.5, 11.5, 20.5),
        (11.0, 21.0, 11.5, 21.0),
        (11.0, 20.5, 11.0, 21.0),
        (11.5, 20.5, 11.5, 21.0),
    }


def test_a_long_wall_is_one_segment_a_side() -> None:
    cells = np.zeros((3, 9), int)
    cells[1] = 100
    assert len(arena_of(grid(cells)).walls) == 4


def test_a_turned_map() -> None:
    arena = arena_of(grid(np.full((2, 4), 100), at=(0.0, 0.0, np.pi / 2)))
    np.testing.assert_allclose(arena.bounds, (-1.0, 0.0, 0.0, 2.0), atol=1e-12)


def test_fine_maps_are_made_coarser() -> None:
    cells = np.indices((300, 300)).sum(axis=0) % 2 * 100
    arena = arena_of(grid(cells, side_m=0.1))
    assert len(arena.walls) <= MOST_WALLS
    np.testing.assert_allclose(arena.bounds, (0, 0, 30, 30))


@pytest.mark.parametrize(
    "change", [{"width": 3}, {"resolution": 0.0}, {"resolution": float("nan")}, {"height": 0}]
)
def test_maps_that_cannot_be(change: dict[str, float]) -> None:
    wrong = grid(np.zeros((4, 6), int))
    vars(wrong.info).update(change)
    with pytest.raises(ValueError, match="found"):
        arena_of(wrong)
