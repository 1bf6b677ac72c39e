import numpy as np

from maurice_mcl.map import Arena, Region
from maurice_mcl.sensor.references import nearest_reference

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


def test_headings_wrap():
    reference = nearest_reference(_grid_poses(1, 1), _arena())
    below_pi = np.nextafter(np.float32(np.pi), np.float32(0))
    headings = np.array([-np.pi, -np.pi + 0.3, below_pi, np.pi - 0.3, np.pi - 0.5, -np.pi + 0.5])
    poses = np.column_stack([np.full((6, 2), 0.25), headings]).astype(np.float32)
    assert reference.entries(poses, HERE).tolist() == [0, 0, 0, 0, 7, 1]


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


def test_one_entry():
    reference = nearest_reference(np.array([[1.0, 1.0, 0.5]]), _arena(SLANTED[:1]))
    poses = np.array([[0.5, 0.5, 3.0], [3.5, 0.5, -1.0], [5.0, 0.5, 0.0]], np.float32)
    assert reference.entries(poses, HERE).tolist() == [0, 0, -1], "behind the wall one walks there"


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
