import numpy as np
import pytest

from maurice_mcl.map import Arena, Region
from maurice_mcl.sensor.references import (
    InterpolationParameters,
    crosses,
    interpolated_reference,
    nearest_reference,
    spacing,
)

HERE = np.zeros(2)
WALL = np.array([[2.0, 0.0, 2.0, 2.0]])
PITCH = 0.5


def _library(columns=8, rows=6, headings=8):
    x, y = np.meshgrid(np.arange(columns) * PITCH + PITCH / 2, np.arange(rows) * PITCH + PITCH / 2)
    turned = np.arange(headings) * 2 * np.pi / headings - np.pi
    xy = np.column_stack([x.ravel(), y.ravel()])
    return np.column_stack([np.repeat(xy, headings, axis=0), np.tile(turned, len(xy))])


def _arena(walls=WALL, obstacles=()):
    return Arena((0.0, 0.0, 4.0, 3.0), np.reshape(walls, (-1, 4)), tuple(obstacles))


def _tables(walls=WALL, library=None, **parameters):
    library = _library() if library is None else library
    arena = _arena(walls)
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
    assert tables.weights.shape == (tables.grid.free.size, places)
    assert (tables.weights >= 0).all()
    assert tables.weights.sum(axis=1) == pytest.approx(np.ones(tables.grid.free.size), abs=1e-6)
    assert ((tables.share >= 0) & (tables.share <= 1)).all()


def test_what_all_entries_agree_on_every_particle_gets():
    tables, poses = _tables(), _poses(2000)
    found = tables.at(np.full(len(_library()), -1.25, np.float32), poses, HERE)
    inside = tables.entries(poses, HERE) >= 0
    assert found[inside] == pytest.approx(-1.25, abs=1e-5)
    assert 0 < (~inside).sum() < len(poses)
    assert np.all(found[~inside] == -np.inf)


def test_outside_is_where_the_nearest_reference_has_it():
    box = Region("box", np.array([[1.0, 1.0], [1.4, 1.0], [1.4, 1.4], [1.0, 1.4]]))
    library, arena = _library(), _arena(WALL, [box])
    nearest = nearest_reference(library, arena)
    tables = interpolated_reference(nearest, library, arena)
    poses = np.vstack([_poses(3000), [[1.2, 1.2, 0], [-1, 1, 0], [1, 9, 0], [2.01, 1, 0]]]).astype(np.float32)
    found = tables.at(_logs(library), poses, HERE)
    assert np.array_equal(np.isfinite(found), nearest.entries(poses, HERE) >= 0)
    assert np.array_equal(tables.entries(poses, HERE), nearest.entries(poses, HERE))
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
    inside = tables.entries(poses, HERE) >= 0
    found, nearest = tables.at(logs, poses, HERE), tables.nearest.at(logs, poses, HERE)
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
        assert tables.at(logs, poses, HERE) == pytest.approx(expected, abs=1e-4)


def test_headings_need_not_be_even():
    library = np.array([[0.5, 0.5, -0.2], [0.5, 0.5, 0.4], [0.5, 0.5, 3.0]])
    tables = _tables((), library)
    logs = np.array([0.0, -6.0, -60.0], np.float32)
    poses = np.array([[1, 1, 0.1], [1, 1, 1.7], [1, 1, 3.1], [1, 1, -1.7]], np.float32)
    back = 2 * np.pi - 3.2  # from 3.0 on to -0.2
    expected = [-3, -6 - 54 * 1.3 / 2.6, -60 + 60 * 0.1 / back, -60 + 60 * (2 * np.pi - 4.7) / back]
    # within half a bin, a quarter of a degree, of the slope there
    assert tables.at(logs, poses, HERE) == pytest.approx(expected, abs=60 / 2.6 * np.radians(0.26))


def test_one_heading_at_a_place_holds_for_all():
    library = np.array([[0.5, 0.5, 0.3], [1.0, 0.5, -2.0]])
    tables = _tables((), library, width=0.05)
    poses = np.array([[0.5, 0.5, h] for h in (-3.0, 0.0, 0.3, 2.9)], np.float32)
    found = tables.at(np.array([-2.0, -7.0], np.float32), poses, HERE)
    assert found == pytest.approx([-2] * 4, abs=1e-4)


def test_never_across_a_wall():
    library = _library()
    tables = _tables(width=2.0, places=9)
    east = library[:, 0] > 2
    logs = np.where(east, -1000.0, -1.0).astype(np.float32)
    centers = tables.grid.centers()
    for k in range(tables.places.shape[1]):
        used = tables.grid.free.ravel() & (tables.weights[:, k] > 0)
        ends = tables.nearest.places[tables.places[used, k]]
        assert not crosses(centers[used], ends, WALL).any()
    poses = _poses(4000)
    low = (poses[:, 1] < 1.0) & (np.abs(poses[:, 0] - 2) < 0.3)  # the wall stands between, far from its end
    found = tables.at(logs, poses, HERE)
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
    found = tables.at(logs, poses, HERE)
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
    by_place = dict(zip(tables.places[inner].tolist(), tables.weights[inner].tolist(), strict=True))
    assert [by_place[p] for p in four] == pytest.approx(expected, rel=1e-4)


def test_spacing():
    assert spacing(_library()[::8, :2]) == pytest.approx(PITCH)
    assert spacing(np.array([[3.0, 4.0]])) == 1.0


def test_a_library_of_one_entry():
    tables = _tables((), np.array([[1.0, 1.0, 0.5]]))
    found = tables.at(np.array([-2.5], np.float32), _poses(50), HERE)
    assert found == pytest.approx([-2.5] * 50)


def test_arguments_are_left_alone():
    tables, poses, logs = _tables(), _poses(100), _logs(_library())
    kept = poses.copy(), logs.copy()
    tables.at(logs, poses, HERE)
    assert np.array_equal(poses, kept[0])
    assert np.array_equal(logs, kept[1])
