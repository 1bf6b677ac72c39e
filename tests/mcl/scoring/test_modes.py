"""Modes followed from step to step, and the ancestry of particles."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace

import numpy as np
import pytest

from helpers.step_records import Cloud, at, made
from maurice_mcl.filter.estimate import modes
from maurice_mcl.scoring.modes import Ancestry, ModeTracker


def seen(tracker: ModeTracker, cloud: Cloud, parents: Sequence[int] | None = None) -> dict[int, float]:
    """Take in a cloud; give the mass of each mode by its identity, heaviest first."""
    tracked = tracker.see(made(cloud, parents=parents))
    return {one.identity: round(one.estimate.mass, 6) for one in tracked}


def test_modes_keep_their_identity():
    tracker = ModeTracker()
    for step in range(20):  # 2 m a step: further than a mode is wide
        assert seen(tracker, [*at(2.0 * step, 0, 0.7), *at(2.0 * step, 9, 0.3)]) == {1: 0.7, 2: 0.3}
    # By place alone they would be taken for each other
    tracker = ModeTracker()
    assert seen(tracker, [*at(0, 0, 0.6), *at(5, 0, 0.4)]) == {1: 0.6, 2: 0.4}
    assert seen(tracker, [*at(5, 0, 0.6), *at(0, 0, 0.4)]) == {1: 0.6, 2: 0.4}
    tracker = ModeTracker()
    seen(tracker, [*at(0, 0, 0.6), *at(5, 0, 0.4)])
    now = seen(tracker, [*at(0, 0, 0.2), *at(5, 0, 0.8)])
    assert list(now.items()) == [(2, 0.8), (1, 0.2)]


def test_identities_follow_copies_not_strays():
    tracker = ModeTracker()
    seen(tracker, [*at(0, 0, 0.5), *at(5, 0, 0.5)], parents=[0, 4, 5, 6, 7, 1, 2, 3])
    shuffled = [*at(1, 0, 0.25, 1), *at(6, 0, 0.5), *at(1, 0, 0.25, 3)]
    tracked = tracker.see(made(shuffled))
    place = {one.identity: round(float(one.estimate.pose[0])) for one in tracked}
    assert place == {1: 1, 2: 6}, "equally heavy: the one further left was named first"
    # A fifth of a mode's weight descends from another that is gone; a quarter is asked for
    tracker = ModeTracker()
    seen(tracker, [*at(0, 0, 0.5, 2), *at(5, 0, 0.3, 2), *at(9, 9, 0.2, 6)], [2, 2, 3, 3, 0, *[-1] * 5])
    cloud = [*at(0, 5, 0.3, 4), *at(5, 5, 0.7, 6)]
    cloud = [(x, y, 0.14 if k == 4 else 0.112 if k > 4 else share) for k, (x, y, share) in enumerate(cloud)]
    assert seen(tracker, cloud) == {4: 0.7, 2: 0.3}


@pytest.mark.parametrize("seed", range(20))
def test_equal_modes_are_named_alike_however_weights_are_rounded(seed):
    """Two join and part again in halves; sums of weights differ from processor to processor."""
    rng, tracker = np.random.default_rng(seed), ModeTracker()

    def see(*places: tuple[float, float]) -> dict[int, tuple[int, int]]:
        tables = [at(*place, 1 / len(places), 8 // len(places)) for place in places]
        rounded = [(x, y, share * rng.uniform(1 - 1e-14, 1 + 1e-14)) for t in tables for x, y, share in t]
        return {
            one.identity: (round(float(one.estimate.pose[0])), round(float(one.estimate.pose[1])))
            for one in tracker.see(made(rounded))
        }

    assert see((5, 0), (0, 0)) == {1: (0, 0), 2: (5, 0)}
    assert see((5, 0), (0, 0)) == {1: (0, 0), 2: (5, 0)}
    assert see((2, 0)) == {1: (2, 0)}, "the older goes on"
    assert see((0, 4), (0, 0)) == {1: (0, 0), 3: (0, 4)}, "in the half that is named first"


def test_modes_split_and_join():
    tracker = ModeTracker()
    seen(tracker, at(0, 0, 1, 10))
    assert seen(tracker, [*at(0, 0, 0.3, 5), *at(4, 0, 0.7, 5)]) == {1: 0.7, 2: 0.3}
    tracker = ModeTracker()
    seen(tracker, [*at(0, 0, 0.6), *at(5, 0, 0.4)])
    joined = at(2, 0, 1, 8)
    joined = [(x, y, share) for (x, y, _), share in zip(joined, [0.15] * 4 + [0.1] * 4, strict=True)]
    assert seen(tracker, joined) == {1: 1.0}
    assert seen(tracker, [*at(0, 0, 0.6), *at(5, 0, 0.4)]) == {1: 0.6, 3: 0.4}
    tracker = ModeTracker()
    seen(tracker, [*at(0, 0, 0.8), *at(5, 0, 0.2)])
    assert seen(tracker, [*at(0, 0, 0.995), *at(5, 0, 0.005)]) == {1: 0.995}
    assert seen(tracker, [*at(0, 0, 0.4), *at(5, 0, 0.6)]) == {2: 0.6, 1: 0.4}


def test_new_modes_have_new_names():
    tracker = ModeTracker()
    first = made(at(0, 0, 1, 8), parents=[0, 1, 2, 3, -1, -1, -1, -1], injected=[False] * 4 + [True] * 4)
    tracker.see(first)
    tracked = tracker.see(made([*at(0, 0, 0.3), *at(5, 0, 0.7)]))
    assert [(one.identity, round(one.estimate.mass, 3)) for one in tracked] == [(2, 0.7), (1, 0.3)]
    tracker = ModeTracker()
    seen(tracker, at(0, 0, 1, 8))
    assert seen(tracker, at(0, 0, 1, 5)) == {2: 1.0}


@pytest.mark.parametrize("seed", range(6))
def test_modes_are_those_of_the_estimate_each_named_once(seed):
    """Whatever the cloud: the same modes as without names, and no name twice, now or ever."""
    rng, tracker, ever = np.random.default_rng(seed), ModeTracker(), set[int]()
    cloud = rng.uniform(0, 6, (60, 2))
    for step in range(12):
        cloud = cloud + rng.normal(0, 0.1, cloud.shape)
        record = made([(x, y, w) for (x, y), w in zip(cloud, rng.uniform(0.1, 1, 60), strict=True)])
        tracked, plain = tracker.see(record), modes(record.weighted)
        assert [one.estimate.mass for one in tracked] == pytest.approx([one.mass for one in plain])
        names = {one.identity for one in tracked}
        assert len(names) == len(tracked)
        new = names - ever
        assert not new or min(new) > max(ever, default=0), f"step {step}: an old name was given again"
        ever |= names


def test_far_from_zero_places_are_the_same():
    near, far = ModeTracker(), ModeTracker()
    for step in range(3):
        cloud = [*at(step, 0, 0.6), *at(step + 3, 4, 0.4)]
        moved = [(x + 500_000, y - 200_000, share) for x, y, share in cloud]
        a = near.see(made(cloud))
        b = far.see(made(moved, origin=(500_000.0, -200_000.0)))
        assert [one.identity for one in a] == [one.identity for one in b] == [1, 2]


def _record(x, parents=None):
    """An update whose particles stand at x (N,), y = 0, in a frame that begins at (10, 20)."""
    poses = np.column_stack([x, np.zeros(len(x)), np.zeros(len(x))]).astype(np.float32)
    cloud = SimpleNamespace(poses=poses, origin=np.array([10.0, 20.0]))
    return SimpleNamespace(weighted=cloud, parents=None if parents is None else np.array(parents, np.int32))


def test_ancestors_by_hand():
    tree = Ancestry()
    for _ in range(3):
        tree.see(_record([0, 1, 2, 3]))
    assert tree.distinct() == 4
    tree = Ancestry()
    tree.see(_record([0, 1, 2, 3], [0, 0, 2, 3]))
    assert tree.distinct() == 3
    tree.see(_record([0, 1, 2, 3], [0, 1, 1, 2]))  # of 0, 0, 0, 2
    assert tree.distinct() == 2
    tree.see(_record([0, 1, 2, 3], [0, 1, 2, 2]))
    assert tree.distinct() == 1
    tree = Ancestry()
    tree.see(_record([0, 1, 2], [0, 0, 0, -1]))
    assert tree.distinct() == 2
    tree.see(_record([0, 1, 2, 3], [3, 3, 0, 1, -1]))  # the fresh one, the old one, and another fresh one
    assert tree.distinct() == 3
    tree = Ancestry(depth=2)
    tree.see(_record([0, 1, 2, 3], [0, 0, 0, 0]))
    assert tree.distinct() == 1
    for _ in range(2):
        tree.see(_record([0, 1, 2, 3], [0, 1, 2, 3]))
    assert tree.distinct() == 4
    assert Ancestry().distinct() == 0
