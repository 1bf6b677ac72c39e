from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from maurice_mcl.filter.proposal import (
    MixtureParameters,
    MixtureProposal,
    draw_poses,
    likely_poses,
    regions,
    shares_of,
    uniform_poses,
)
from maurice_mcl.sensor.references import HEADING_BINS, nearest_reference
from maurice_mcl.values.map import Arena, Region, make_grid
from maurice_mcl.values.pose_sensor import PoseProposal
from maurice_mcl.values.randomness import stream
from maurice_mcl.values.records import Belief, normalize

MIDDLE = np.array([2.0, 1.5])
BOX = Region("box", np.array([[0.0, 0.0], [1.2, 0.0], [1.2, 0.9], [0.0, 0.9]]))
WALL = np.array([[2.0, 0.0, 2.0, 2.0]])
ARENA = Arena((0.0, 0.0, 4.0, 3.0), WALL, (BOX,))
N = 100_000


def _library():
    """Irregular on purpose: places of one, two and four headings, one of them in the box."""
    places = [(0.5, 0.5, 4), (0.5, 2.0, 4), (1.5, 1.0, 2), (1.5, 2.5, 1), (2.5, 1.0, 4), (3.5, 2.5, 2)]
    return np.array([[x, y, k * 2 * np.pi / n - 3] for x, y, n in places for k in range(n)])


@pytest.fixture(scope="module")
def nearest():
    return nearest_reference(_library(), ARENA)


@pytest.fixture(scope="module")
def where(nearest):
    return regions(nearest, len(_library()))


def _logs(seed=0):
    return np.random.default_rng(seed).normal(-50, 1.2, len(_library())).astype(np.float32)


def _assert_shares(counts, shares):
    """Chi-square at the 99.99 % quantile, and every share within four standard errors."""
    n = counts.sum()
    known = shares > 0
    assert counts[~known].sum() == 0
    statistic = (np.square(counts - n * shares)[known] / (n * shares[known])).sum()
    assert statistic < chi2.ppf(0.9999, known.sum() - 1)
    assert np.all(np.abs(counts / n - shares) <= 4 * np.sqrt(shares * (1 - shares) / n) + 1e-12)


def _in_free_space(grid, poses):
    cells = grid.cells_of(poses[:, :2], MIDDLE)
    # float32 rounding puts a few in a million across the border that they were drawn beside
    return (grid.free.ravel()[cells] & (cells >= 0)).mean() > 0.9999


def test_evenly_is_even_over_free_space_and_headings(nearest):
    poses = uniform_poses(nearest.grid, N, MIDDLE, stream(9, 1))
    assert (poses.shape, poses.dtype) == ((N, 3), np.float32)
    assert _in_free_space(nearest.grid, poses)
    free = nearest.grid.free
    block = np.arange(free.size).reshape(free.shape)
    block = (block // free.shape[1] // 18) * 100 + block % free.shape[1] // 18
    kept = nearest.grid.cells_of(poses[:, :2], MIDDLE)
    kept = kept[nearest.grid.free.ravel()[kept]]
    size = block.max() + 1
    shares = np.bincount(block[free], minlength=size) / free.sum()
    _assert_shares(np.bincount(block.ravel()[kept], minlength=size), shares)
    turn = np.bincount(((poses[:, 2] + np.pi) * 24 / (2 * np.pi)).astype(int).clip(0, 23), minlength=24)
    _assert_shares(turn, np.full(24, 1 / 24))


def test_draws_are_even_within_a_cell_and_may_be_none(nearest, where):
    poses = uniform_poses(nearest.grid, N, MIDDLE, stream(9, 2)).astype(np.float64)
    inside = (poses[:, :2] + MIDDLE - nearest.grid.corner) / nearest.grid.cell_m % 1
    for share in inside.T:
        _assert_shares(np.bincount((share * 10).astype(int), minlength=10), np.full(10, 0.1))
    few, many = (uniform_poses(nearest.grid, n, MIDDLE, stream(9, 3)) for n in (10, 300))
    assert np.array_equal(many[:10], few)
    assert uniform_poses(nearest.grid, 0, MIDDLE, stream(9, 1)).shape == (0, 3)
    assert likely_poses(_logs(), nearest.grid, where, 0, MIDDLE, stream(9, 1)).shape == (0, 3)
    flood = Region("flood", np.array([[-1.0, -1.0], [5.0, -1.0], [5.0, 4.0], [-1.0, 4.0]]))
    grid = make_grid(Arena((0.0, 0.0, 4.0, 3.0), np.zeros((0, 4)), (flood,)), _library()[:, :2])
    with pytest.raises(ValueError, match="no free space"):
        uniform_poses(grid, 3, MIDDLE, stream(9, 1))


def test_regions_are_the_tables_the_other_way_round(nearest, where):
    size = where.sizes()
    cells = nearest.place_of_cell[:-1]
    slow = np.zeros(len(_library()))
    for place in range(len(nearest.places)):
        for entry in nearest.entry_of[place]:
            slow[entry] += (cells == place).sum()
    assert np.array_equal(size, slow)
    assert size.sum() == nearest.grid.free.sum() * HEADING_BINS
    for entry in range(len(_library())):
        place = where.place_of_entry[entry]
        own = where.cells[where.first_cell[place] : where.first_cell[place + 1]]
        assert np.array_equal(np.sort(own), np.flatnonzero(cells == place))
        bins = where.bins[where.first_bin[entry] : where.first_bin[entry + 1]]
        assert np.array_equal(np.sort(bins), np.flatnonzero(nearest.entry_of[place] == entry))


def test_an_entry_whose_place_is_the_nearest_of_no_cell_has_no_share(where):
    size, shares = where.sizes(), shares_of(np.zeros(len(_library()), np.float32), where)
    assert np.array_equal(shares, size / size.sum())
    crowded = np.vstack([_library(), [_library()[4]]])  # the same pose twice: the first is taken
    twice = nearest_reference(crowded, ARENA)
    found = regions(twice, len(crowded)).sizes()
    assert found[-1] == 0
    assert shares_of(np.full(len(crowded), -9.0, np.float32), regions(twice, len(crowded)))[-1] == 0
    drawn = likely_poses(
        np.append(_logs(), np.float32(0)), twice.grid, regions(twice, len(crowded)), 500, MIDDLE, stream(9, 4)
    )
    assert (twice.entries(drawn, MIDDLE) < len(_library())).all()


def test_the_likeliest_entry_may_be_the_nearest_of_no_pose(where):
    """However much likelier: what is left keeps its shares."""
    crowded = np.vstack([_library(), [_library()[4]]])
    found = regions(nearest_reference(crowded, ARENA), len(crowded))
    for top in (-60.0, 0.0, 5000.0):
        shares = shares_of(np.append(_logs(), np.float32(top)), found)
        assert shares[:-1] == pytest.approx(shares_of(_logs(), where))
        assert shares[-1] == 0
    for unknown in (np.nan, -np.inf):  # no number: anywhere
        even = where.sizes() / where.sizes().sum()
        assert shares_of(np.full(len(even), unknown, np.float32), where) == pytest.approx(even)


def test_from_likelihood_has_every_entry_in_its_share(nearest, where):
    logs = _logs()
    weight = np.exp(logs.astype(float) + 50) * where.sizes()
    assert shares_of(logs, where) == pytest.approx(weight / weight.sum())
    poses = likely_poses(logs, nearest.grid, where, N, MIDDLE, stream(9, 5))
    assert (poses.shape, poses.dtype) == ((N, 3), np.float32)
    assert _in_free_space(nearest.grid, poses)
    entries = nearest.entries(poses, MIDDLE)
    entries = entries[entries >= 0]
    _assert_shares(np.bincount(entries, minlength=len(logs)), shares_of(logs, where))


def test_from_likelihood_is_even_over_what_each_entry_is_nearest_of(nearest, where):
    poses = likely_poses(_logs(1), nearest.grid, where, N, MIDDLE, stream(9, 6))
    entries, cells = nearest.entries(poses, MIDDLE), nearest.grid.cells_of(poses[:, :2], MIDDLE)
    most = np.bincount(entries[entries >= 0]).argmax()
    held = cells[entries == most]
    own = where.cells[
        where.first_cell[where.place_of_entry[most]] : where.first_cell[where.place_of_entry[most] + 1]
    ]
    rank = np.searchsorted(np.sort(own), held) * 40 // len(own)
    size = np.bincount(np.arange(len(own)) * 40 // len(own), minlength=40) / len(own)
    _assert_shares(np.bincount(rank, minlength=40), size)
    turn = ((poses[entries == most, 2].astype(float) + np.pi) * HEADING_BINS / (2 * np.pi)).astype(int)
    bins = np.sort(where.bins[where.first_bin[most] : where.first_bin[most + 1]])
    rank = np.searchsorted(bins, turn) * 20 // len(bins)
    size = np.bincount(np.arange(len(bins)) * 20 // len(bins), minlength=20) / len(bins)
    _assert_shares(np.bincount(rank.clip(0, 19), minlength=20), size)


def test_likely_poses_follow_the_likelihood(nearest, where):
    poses = likely_poses(np.zeros(len(_library()), np.float32), nearest.grid, where, N, MIDDLE, stream(9, 7))
    west = (poses[:, 0] < 0).mean()
    centers = nearest.grid.centers()[nearest.grid.free.ravel()]
    expected = (centers[:, 0] < 2).mean()
    assert abs(west - expected) < 4 * np.sqrt(expected * (1 - expected) / N)
    logs = np.full(len(_library()), -1e6, np.float32)
    logs[9] = -1e5
    drawn = likely_poses(logs, nearest.grid, where, 1000, MIDDLE, stream(9, 8))
    assert (nearest.entries(drawn, MIDDLE) == 9).mean() > 0.998
    for poses in (
        uniform_poses(nearest.grid, N, MIDDLE, stream(9, 9)),
        likely_poses(_logs(), nearest.grid, where, N, MIDDLE, stream(9, 9)),
    ):
        assert poses[:, 2].min() >= np.float32(-np.pi)
        assert poses[:, 2].max() <= np.float32(np.pi)


MIXTURE_MIDDLE = np.array([2.0, 1.5])
MIXTURE_ARENA = Arena((0.0, 0.0, 4.0, 3.0), np.zeros((0, 4)))


def _mixture_library():
    places = [(0.5, 0.5), (1.5, 0.5), (2.5, 1.5), (3.5, 2.5)]
    return np.array([[x, y, k * np.pi / 2 - 3] for x, y in places for k in range(4)])


NEAREST = nearest_reference(_mixture_library(), MIXTURE_ARENA)
WHERE = regions(NEAREST, 16)
LOGS = np.random.default_rng(0).normal(-20, 1, 16).astype(np.float32)


def _belief(n=1000, seed=1):
    rng = np.random.default_rng(seed)
    poses = np.column_stack([rng.uniform(-2, 0, n), rng.uniform(-1.5, 1.5, n), rng.uniform(-3, 3, n)])
    return Belief(poses.astype(np.float32), normalize(rng.normal(0, 1, n))[0], MIXTURE_MIDDLE)


def _mix(belief=None, share=0.3, teleport=0.05, logs=LOGS, seed=2):
    belief = _belief() if belief is None else belief
    parameters = MixtureParameters(share, teleport)
    found = MixtureProposal(parameters, NEAREST, WHERE).mixed(belief, logs, stream(9, seed))
    return found.belief, found.correction


def test_the_mixture_keeps_its_size_and_copies_first():
    mixed, correction = _mix()
    assert (mixed.size, mixed.poses.dtype) == (1000, np.float32)
    assert correction.shape == (1000,)
    assert mixed.weights == pytest.approx(np.full(1000, 1e-3))
    belief = _belief()
    mixed, _ = _mix(belief)
    known = set(map(bytes, belief.poses))
    old = [bytes(row) in known for row in mixed.poses]
    assert all(old[:700])
    assert not any(old[700:])
    mixed, correction = _mix(share=0.0, teleport=0.0)
    assert correction == pytest.approx(np.zeros(1000))
    known = set(map(bytes, _belief().poses))
    assert all(bytes(row) in known for row in mixed.poses)


def test_corrections_are_densities():
    belief = _belief()
    mixed, correction = _mix(belief)
    entry = NEAREST.entries(belief.poses, MIXTURE_MIDDLE)
    kept = np.array([belief.weights[entry == k].sum() for k in range(16)])
    p = 0.95 * kept + 0.05 * WHERE.sizes() / WHERE.sizes().sum()
    q = shares_of(LOGS, WHERE)
    expected = p / (0.7 * kept + 0.3 * q)
    assert np.exp(correction) == pytest.approx(expected[NEAREST.entries(mixed.poses, MIXTURE_MIDDLE)])
    mixed, correction = _mix(teleport=0.0)
    entry = NEAREST.entries(_belief().poses, MIXTURE_MIDDLE)
    found = NEAREST.entries(mixed.poses, MIXTURE_MIDDLE)
    nobody = ~np.isin(found, entry)
    assert nobody.sum() > 20
    assert np.all(correction[nobody] == -np.inf)
    assert np.isfinite(correction[~nobody]).all()
    assert np.isfinite(_mix(teleport=0.01)[1]).all()


@pytest.mark.parametrize("teleport", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("believed", [None, 0.0, 0.2])
def test_corrected_means_are_those_of_the_prediction(teleport, believed):
    """Mean over the mixture of p / mixture times anything known by entry is the mean over the prediction.

    Where a sensor proposes poses that earlier readings speak for, the robot is there as probably as they say.
    """
    value = np.append(np.random.default_rng(3).normal(size=16), 0.0)  # outside: 0
    even = WHERE.sizes() / WHERE.sizes().sum()
    parameters = MixtureParameters(0.3, teleport)
    proposed = PoseProposal(
        np.array([[1.5, 1.5, 0.5]]), np.diag([0.3, 0.3, 0.5])[None], np.ones(1), believed=believed or 0.0
    )
    logs = np.where(np.arange(16) < 6, np.arange(16) / 4, -90.0).astype(
        np.float32
    )  # six entries have particles
    many = draw_poses([proposed], 200_000, MIXTURE_MIDDLE, stream(9, 1000))
    there = value[NEAREST.entries(many, MIXTURE_MIDDLE)].mean()
    off = []
    for seed in range(400):
        rng = stream(9, seed)
        poses = likely_poses(logs, NEAREST.grid, WHERE, 500, MIXTURE_MIDDLE, rng)
        belief = Belief(poses, normalize(np.zeros(500))[0], MIXTURE_MIDDLE)
        mixture = MixtureProposal(parameters, NEAREST, WHERE)
        mixed = mixture.mixed(belief, LOGS, rng, () if believed is None else [proposed])
        known, found = (value[NEAREST.entries(b.poses, MIXTURE_MIDDLE)] for b in (belief, mixed.belief))
        expected = (1 - teleport) * known.mean() + teleport * even @ value[:16]
        if believed:
            expected = (1 - believed) * expected + believed * there
        off.append(np.mean(np.exp(mixed.correction) * found) - expected)
    assert abs(np.mean(off)) < 4 * np.std(off) / np.sqrt(len(off))


def test_the_mixture_bears_odd_clouds():
    twice = np.vstack([_mixture_library(), _mixture_library()[:1]])  # the same pose again
    nearest = nearest_reference(twice, MIXTURE_ARENA)
    logs = np.append(LOGS, np.float32(5))
    where = regions(nearest, 17)
    assert where.sizes()[16] == 0
    for teleport in (0.0, 0.01):
        parameters = MixtureParameters(0.3, teleport)
        for proposals in ((), (PoseProposal(twice[:1], 0.01 * np.eye(3)[None], np.ones(1)),)):
            mixed = MixtureProposal(parameters, nearest, where).mixed(
                _belief(), logs, stream(9, 2), proposals
            )
            assert not np.isnan(mixed.correction).any()
            assert np.isfinite(mixed.belief.poses).all()
    belief = _belief()
    poses = belief.poses.copy()
    poses[:300, 0] = 50.0
    mixed, correction = _mix(Belief(poses, belief.log_weights, MIXTURE_MIDDLE))
    outside = NEAREST.entries(mixed.poses, MIXTURE_MIDDLE) < 0
    assert 100 < outside.sum() < 400
    assert not np.isnan(correction).any()


def test_what_is_given_is_not_changed():
    belief = _belief()
    kept = belief.poses.copy(), belief.log_weights.copy(), LOGS.copy()
    _mix(belief)
    assert np.array_equal(belief.poses, kept[0])
    assert np.array_equal(belief.log_weights, kept[1])
    assert np.array_equal(LOGS, kept[2])
