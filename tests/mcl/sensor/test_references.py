from __future__ import annotations

import numpy as np
import pytest

from maurice_mcl.sensor.references import (
    InterpolationParameters,
    interpolated_reference,
    nearest_reference,
    place_tree,
    spacing,
)
from maurice_mcl.values.map import Arena, Region, crosses

HERE = np.zeros(2)
SLANTED = np.array([[2.0, 0.0, 2.0, 2.0], [2.6, 0.7, 3.6, 2.3], [0.4, 2.4, 1.1, 1.9]])


def _grid_poses(columns=8, rows=6, pitch=0.5, headings=8):
    x, y = np.meshgrid(np.arange(columns) * pitch + pitch / 2, np.arange(rows) * pitch + pitch / 2)
    turned = np.arange(headings) * 2 * np.pi / headings - np.pi
    return np.column_stack(
        [np.repeat(np.column_stack([x.ravel(), y.ravel()]), headings, axis=0), np.tile(turned, x.size)]
    )


def _arena(walls=(), obstacles=(), at=(0.0, 0.0)):
    bounds = (at[0], at[1], at[0] + 4.0, at[1] + 3.0)
    return Arena(bounds, np.reshape(np.asarray(walls, float), (-1, 4)), tuple(obstacles))


def _cuts(start, end, wall):
    """Give where along the wall, from 0 to 1, the segment cuts it; None where it does not."""
    along, across = wall[2:] - wall[:2], end - start
    matrix = np.column_stack([across, -along])
    if abs(np.linalg.det(matrix)) < 1e-12:
        return None
    t, u = np.linalg.solve(matrix, wall[:2] - start)
    return u if 0 < t < 1 and 0 <= u <= 1 else None


def _brute(pose, library, walls):
    """Nearest position with a free line of sight, then nearest heading."""
    places = np.unique(library[:, :2].round(6), axis=0)
    order = np.hypot(*(places - pose[:2]).T).argsort(kind="stable")
    seen = (p for p in order if all(_cuts(pose[:2], places[p], wall) is None for wall in walls))
    place = places[next(seen)]
    here = np.flatnonzero(np.hypot(*(library[:, :2] - place).T) < 1e-4)
    apart = np.abs(np.angle(np.exp(1j * (library[here, 2] - pose[2]))))
    return here[apart.argmin()]


def _random_poses(n, seed=0):
    rng = np.random.default_rng(seed)
    return np.column_stack([rng.uniform(0, 4, n), rng.uniform(0, 3, n), rng.uniform(-np.pi, np.pi, n)])


def _off_the_borders(reference, poses):
    """Keep poses that are not within a thousandth of a cell's border, of the raster and of headings."""
    cells = (poses[:, :2] - reference.grid.corner) / reference.grid.cell_m
    turns = (poses[:, 2] + np.pi) * 720 / (2 * np.pi)
    steps = np.column_stack([cells, turns])
    return poses[(np.abs(steps - np.round(steps)) > 1e-3).all(axis=1)]


def test_without_walls_it_is_the_nearest_position_then_the_nearest_heading():
    library = _grid_poses()
    reference = nearest_reference(library, _arena())
    poses = _off_the_borders(reference, _random_poses(2000))
    found = reference.entries(poses.astype(np.float32), HERE)
    assert found.tolist() == [_brute(pose, library, []) for pose in poses]


def test_with_walls_it_is_the_nearest_that_can_be_seen():
    library = _grid_poses()
    reference = nearest_reference(library, _arena(SLANTED))
    free = reference.grid.centers()[reference.grid.free.ravel()]
    poses = _random_poses(1500, 1)
    poses[:, :2] = free[np.random.default_rng(2).choice(len(free), 1500, replace=False)]
    poses = poses[(np.abs((poses[:, 2] + np.pi) / np.radians(0.5) % 1 - 0.5) < 0.49)]
    found = reference.entries(poses.astype(np.float32), HERE)
    brute = np.array([_brute(pose, library, SLANTED) for pose in poses])
    # centers on the line between two places are as near to one as to the other
    tie = np.hypot(*(library[found, :2] - library[brute, :2]).T) > 0
    off = [np.hypot(*(library[e, :2] - poses[:, :2]).T) for e in (found, brute)]
    assert np.allclose(off[0][tie], off[1][tie], atol=1e-9)
    assert np.array_equal(found[~tie], brute[~tie])
    assert tie.mean() < 0.05
    across = nearest_reference(library, _arena()).entries(poses.astype(np.float32), HERE)
    assert (across != found).any(), "the walls matter for some of these poses"


def test_never_across_a_wall():
    library = _grid_poses()
    reference = nearest_reference(library, _arena(SLANTED))
    poses = _random_poses(4000, 3)
    found = reference.entries(poses.astype(np.float32), HERE)
    tip = 2 * reference.grid.cell_m  # a cell at the end of a wall sees a little around it
    for pose, entry in zip(poses[found >= 0], found[found >= 0], strict=True):
        for wall in SLANTED:
            u = _cuts(pose[:2], library[entry, :2], wall)
            length = np.hypot(*(wall[2:] - wall[:2]))
            assert u is None or min(u, 1 - u) * length < tip


def test_outside_and_in_obstacles_and_walls_is_minus_one():
    box = Region("box", np.array([[1.0, 1.0], [1.4, 1.0], [1.4, 1.4], [1.0, 1.4]]))
    reference = nearest_reference(_grid_poses(), _arena([[2.0, 0.0, 2.0, 2.0]], [box]))
    inside = np.array([[1.2, 1.2, 0], [-0.1, 1, 0], [4.1, 1, 0], [1, -0.1, 0], [1, 3.1, 0], [2.01, 1.0, 0]])
    assert np.all(reference.entries(inside.astype(np.float32), HERE) == -1)
    beside = np.array([[0.9, 1.2, 0.0], [0.1, 1, 0], [3.9, 1, 0], [1.97, 1.0, 0]])
    assert np.all(reference.entries(beside.astype(np.float32), HERE) >= 0)


def test_headings_wrap_and_one_entry_serves():
    reference = nearest_reference(_grid_poses(1, 1), _arena())
    below_pi = np.nextafter(np.float32(np.pi), np.float32(0))
    headings = np.array([-np.pi, -np.pi + 0.3, below_pi, np.pi - 0.3, np.pi - 0.5, -np.pi + 0.5])
    poses = np.column_stack([np.full((6, 2), 0.25), headings]).astype(np.float32)
    assert reference.entries(poses, HERE).tolist() == [0, 0, 0, 0, 7, 1]
    reference = nearest_reference(np.array([[1.0, 1.0, 0.5]]), _arena(SLANTED[:1]))
    poses = np.array([[0.5, 0.5, 3.0], [3.5, 0.5, -1.0], [5.0, 0.5, 0.0]], np.float32)
    assert reference.entries(poses, HERE).tolist() == [0, 0, -1], "behind the wall one walks there"


@pytest.mark.parametrize("turns", [1, -3, 1000])
def test_a_heading_of_any_size_is_that_within_one_turn(turns):
    reference = nearest_reference(_grid_poses(4, 4), _arena())
    headings = np.arange(-3.0, 3.0, 0.37)
    poses = np.column_stack([np.full((len(headings), 2), 1.1), headings])
    turned = poses + np.array([0, 0, 2 * np.pi * turns])
    expected = reference.entries(poses.astype(np.float32), HERE)
    assert np.array_equal(reference.entries(turned.astype(np.float32), HERE), expected)
    far = np.array([[1.1, 1.1, -1e9], [1.1, 1.1, 1e9]], np.float32)
    assert (reference.entries(far, HERE) >= 0).all()


def test_irregular_libraries():
    rng = np.random.default_rng(7)
    library = np.column_stack([rng.uniform(0, 4, 30), rng.uniform(0, 3, 30), rng.uniform(-np.pi, np.pi, 30)])
    library = np.vstack([library, library[:10] + np.array([0, 0, 1.5])])
    reference = nearest_reference(library, _arena())
    assert len(reference.places) == 30
    poses = _random_poses(500, 8)
    centers = reference.grid.centers()
    poses[:, :2] = centers[reference.grid.cells_of(poses[:, :2].astype(np.float32), HERE)]
    poses[:, 2] = (np.floor(np.degrees(poses[:, 2]) * 2) + 0.5) / 2 / 180 * np.pi
    found = reference.entries(poses.astype(np.float32), HERE)
    assert found.tolist() == [_brute(pose, library, []) for pose in poses]


def test_a_map_500_km_away_gives_the_same_entries():
    at = np.array([500_000.0, -300_000.0])
    library, walls = _grid_poses(), SLANTED
    there = library + np.append(at, 0.0)
    near = nearest_reference(library, _arena(walls))
    far = nearest_reference(there, _arena(walls + np.tile(at, 2), at=at))
    poses = _off_the_borders(near, _random_poses(3000, 5)).astype(np.float32)
    middle = np.array([2.0, 1.5])
    shifted = poses - np.array([*middle, 0], np.float32)
    shifted = shifted[(shifted[:, 2] >= -np.pi)]
    here, away = near.entries(shifted, middle), far.entries(shifted, middle + at)
    # of cells that are as near to two places, the last bit of a coordinate decides
    assert (here != away).mean() < 0.002


ORIGIN = np.zeros(2)
WALL = np.array([[2.0, 0.0, 2.0, 2.0]])
PITCH = 0.5


def _library(columns=8, rows=6, headings=8):
    x, y = np.meshgrid(np.arange(columns) * PITCH + PITCH / 2, np.arange(rows) * PITCH + PITCH / 2)
    turned = np.arange(headings) * 2 * np.pi / headings - np.pi
    xy = np.column_stack([x.ravel(), y.ravel()])
    return np.column_stack([np.repeat(xy, headings, axis=0), np.tile(turned, len(xy))])


def _two_rooms(walls=WALL, obstacles=()):
    return Arena((0.0, 0.0, 4.0, 3.0), np.reshape(walls, (-1, 4)), tuple(obstacles))


def _tables(walls=WALL, library=None, **parameters):
    library = _library() if library is None else library
    arena = _two_rooms(walls)
    nearest = nearest_reference(library, arena)
    return interpolated_reference(nearest, library, arena, InterpolationParameters(**parameters))


def _logs(library, seed=0):
    return np.random.default_rng(seed).normal(-3, 2, len(library)).astype(np.float32)


def _poses(n, seed=1):
    rng = np.random.default_rng(seed)
    return np.column_stack(
        [rng.uniform(0, 4, n), rng.uniform(0, 3, n), rng.uniform(-np.pi, np.pi, n)]
    ).astype(np.float32)


@pytest.mark.parametrize("places", [1, 2, 4, 9])
@pytest.mark.parametrize("width", [0.05, 0.5, 3.0])
def test_weights_sum_to_one_and_are_never_negative(places, width):
    tables = _tables(places=places, width=width)
    assert tables.weights.shape == (places, tables.grid.free.size)
    assert (tables.weights >= 0).all()
    assert tables.weights.sum(axis=0) == pytest.approx(np.ones(tables.grid.free.size), abs=1e-6)
    assert ((tables.share >= 0) & (tables.share <= 1)).all()


def test_outside_is_where_the_nearest_reference_has_it():
    box = Region("box", np.array([[1.0, 1.0], [1.4, 1.0], [1.4, 1.4], [1.0, 1.4]]))
    library, arena = _library(), _two_rooms(WALL, [box])
    nearest = nearest_reference(library, arena)
    tables = interpolated_reference(nearest, library, arena, InterpolationParameters())
    poses = np.vstack([_poses(3000), [[1.2, 1.2, 0], [-1, 1, 0], [1, 9, 0], [2.01, 1, 0]]]).astype(np.float32)
    found = tables.at(_logs(library), poses, ORIGIN)
    assert np.array_equal(np.isfinite(found), nearest.entries(poses, ORIGIN) >= 0)
    assert np.array_equal(tables.entries(poses, ORIGIN), nearest.entries(poses, ORIGIN))
    assert np.all(found[-4:] == -np.inf)


def test_as_the_width_goes_to_nothing_it_is_the_nearest_at_its_own_headings():
    library, logs = _library(), _logs(_library())
    tables = _tables(width=0.02)
    poses = _poses(2000)
    # half a degree's bin lies on the heading of the entry, so both of its halves are as near as can be
    poses[:, 2] = library[np.random.default_rng(2).integers(0, len(library), 2000), 2] + 1e-4
    # on a line half way between two places both count
    steps = poses[:, :2] / (PITCH / 2)
    odd = np.round(steps) % 2 == 0
    poses = poses[~(odd & (np.abs(steps - np.round(steps)) < 0.15)).any(axis=1)]
    inside = tables.entries(poses, ORIGIN) >= 0
    found, nearest = (tables.at(logs, poses, ORIGIN), tables.nearest.at(logs, poses, ORIGIN))
    step = np.abs(logs).max() * 2 * (0.25 / 45)  # a quarter of a degree between headings
    assert inside.sum() > 500
    assert np.abs(found[inside] - nearest[inside]).max() < step


def test_it_is_linear_in_heading_between_two_entries():
    library = _library(1, 1)
    tables = _tables((), library)
    logs = _logs(library)
    for k in range(8):
        share = (np.arange(90) + 0.5) / 90  # the middles of half-degree bins
        heading = -np.pi + (k + share) * np.pi / 4
        poses = np.column_stack([np.full((90, 2), 0.3), heading]).astype(np.float32)
        expected = logs[k] + share * (logs[(k + 1) % 8] - logs[k])
        assert tables.at(logs, poses, ORIGIN) == pytest.approx(expected, abs=1e-4)


def test_headings_need_not_be_even():
    library = np.array([[0.5, 0.5, -0.2], [0.5, 0.5, 0.4], [0.5, 0.5, 1.2]])
    tables = _tables((), library)
    logs = np.array([0.0, -6.0, -60.0], np.float32)
    poses = np.array([[1, 1, 0.1], [1, 1, 0.3], [1, 1, 0.6], [1, 1, 0.9]], np.float32)
    expected = [-3, -5, -6 - 54 * 0.2 / 0.8, -6 - 54 * 0.5 / 0.8]
    # within half a bin, a quarter of a degree, of the slope there
    assert tables.at(logs, poses, ORIGIN) == pytest.approx(expected, abs=54 / 0.8 * np.radians(0.26))


def test_odd_libraries_and_arguments():
    library = np.array([[0.5, 0.5, 0.3], [1.0, 0.5, -2.0]])
    tables = _tables((), library, width=0.05)
    poses = np.array([[0.5, 0.5, h] for h in (-0.1, 0.0, 0.3, 0.7)], np.float32)
    found = tables.at(np.array([-2.0, -7.0], np.float32), poses, ORIGIN)
    assert found == pytest.approx([-2] * 4, abs=1e-4)
    tables = _tables((), np.array([[1.0, 1.0, 0.5]]))
    found = tables.at(np.array([-2.5], np.float32), _poses(50), ORIGIN)
    assert found == pytest.approx([-2.5] * 50)
    assert spacing(_library()[::8, :2]) == pytest.approx(PITCH)
    assert spacing(np.array([[3.0, 4.0]])) == 1.0
    assert spacing(np.zeros((600, 2))) == 0
    for count in (2, 3, 257, 2000):  # as SciPy's tree finds it, to the last bit
        places = np.random.default_rng(count).normal(size=(count, 2)) * (1, 30) + 5e5
        assert spacing(places) == np.median(place_tree(places).query(places, k=2)[0][:, 1])
    tables, poses, logs = _tables(), _poses(100), _logs(_library())
    kept = poses.copy(), logs.copy()
    tables.at(logs, poses, ORIGIN)
    assert np.array_equal(poses, kept[0])
    assert np.array_equal(logs, kept[1])
    tables, poses = _tables(), _poses(2000)
    found = tables.at(np.full(len(_library()), -1.25, np.float32), poses, ORIGIN)
    inside = tables.entries(poses, ORIGIN) >= 0
    assert found[inside] == pytest.approx(-1.25, abs=1e-5)
    assert 0 < (~inside).sum() < len(poses)
    assert np.all(found[~inside] == -np.inf)


def test_interpolation_is_never_across_a_wall():
    library = _library()
    tables = _tables(width=2.0, places=9)
    east = library[:, 0] > 2
    logs = np.where(east, -1000.0, -1.0).astype(np.float32)
    centers = tables.grid.centers()
    for k in range(len(tables.places)):
        used = tables.grid.free.ravel() & (tables.weights[k] > 0)
        ends = tables.nearest.places[tables.places[k, used]]
        assert not crosses(centers[used], ends, WALL).any()
    poses = _poses(4000)
    low = (poses[:, 1] < 1.0) & (np.abs(poses[:, 0] - 2) < 0.3)  # the wall stands between, far from its end
    found = tables.at(logs, poses, ORIGIN)
    beside = low & np.isfinite(found)
    assert beside.sum() > 50
    west = poses[:, 0] < 2
    assert np.all(found[beside & west] > -1.01)
    assert np.all(found[beside & ~west] < -999)


def _jump(tables, at, logs, heading=0.3):
    """The largest difference between neighboring cells of the raster along x, and between any two."""
    x = tables.grid.corner[0] + (np.arange(2, tables.grid.shape[1] - 2) + 0.5) * tables.grid.cell_m
    poses = np.column_stack([x, np.full(len(x), at), np.full(len(x), heading)]).astype(np.float32)
    found = at_finite(tables, logs, poses)
    return np.abs(np.diff(found)).max(), np.ptp(found)


def at_finite(tables, logs, poses):
    found = tables.at(logs, poses, ORIGIN)
    assert np.isfinite(found).all()
    return found


@pytest.mark.parametrize(("places", "most"), [(4, 0.5), (9, 0.35)])
@pytest.mark.parametrize("row", [0.26, 0.5, 0.74, 1.27])
def test_it_is_continuous_across_the_borders_of_a_references_cell(row, places, most):
    """Nearest jumps by whole differences there; here no step between raster cells is a large part of it.

    With four places there is still a small one where, on a line of places, the fourth becomes another.
    """
    logs = _logs(_library())
    tables = _tables((), places=places, width=0.5)
    step, extent = _jump(tables, row, logs)
    by_nearest, _ = _jump(tables.nearest, row, logs)
    assert step < 0.25 * extent
    assert step < most * by_nearest


def test_on_a_place_the_kernel_is_the_gaussian_by_hand():
    tables = _tables((), places=4, width=0.5)
    center = tables.grid.centers()
    inner = np.flatnonzero(np.hypot(*(center - (1.95, 1.45)).T) < 0.04)[0]
    away = np.hypot(*(tables.nearest.places - center[inner]).T)
    four = np.argsort(away, kind="stable")[:4]
    expected = np.exp(-0.5 * (away[four] / 0.25) ** 2)
    expected /= expected.sum()
    by_place = dict(zip(tables.places[:, inner].tolist(), tables.weights[:, inner].tolist(), strict=True))
    assert [by_place[p] for p in four] == pytest.approx(expected, rel=1e-4)


def test_crosses_all_walls_at_once_as_one_by_one():
    rng = np.random.default_rng(0)
    start, end, walls = (rng.uniform(0, 10, shape).round(1) for shape in ((3000, 2), (3000, 2), (40, 4)))
    one_by_one = [crosses(start, end, wall[None]) for wall in walls]
    assert np.array_equal(crosses(start, end, walls), np.any(one_by_one, axis=0))
    assert not crosses(start, end, walls[:0]).any()
    assert crosses(np.array([[0.0, 0.0]]), np.array([[2.0, 0.0]]), np.array([[1.0, -1.0, 1.0, 1.0]])).all()
