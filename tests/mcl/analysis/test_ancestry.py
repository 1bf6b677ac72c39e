from types import SimpleNamespace

import numpy as np
import pytest

from maurice_mcl.analysis.ancestry import Ancestry


def _record(x, parents=None):
    """An update whose particles stand at x (N,), y = 0, in a frame that begins at (10, 20)."""
    poses = np.column_stack([x, np.zeros(len(x)), np.zeros(len(x))]).astype(np.float32)
    cloud = SimpleNamespace(poses=poses, origin=np.array([10.0, 20.0]))
    return SimpleNamespace(weighted=cloud, parents=None if parents is None else np.array(parents, np.int32))


def test_without_resampling_everyone_is_an_ancestor():
    tree = Ancestry()
    for _ in range(3):
        tree.see(_record([0, 1, 2, 3]))
    assert tree.distinct() == 4


def test_ancestors_by_hand():
    tree = Ancestry()
    tree.see(_record([0, 1, 2, 3], [0, 0, 2, 3]))
    assert tree.distinct() == 3
    tree.see(_record([0, 1, 2, 3], [0, 1, 1, 2]))  # of 0, 0, 0, 2
    assert tree.distinct() == 2
    tree.see(_record([0, 1, 2, 3], [0, 1, 2, 2]))
    assert tree.distinct() == 1


def test_fresh_particles_are_their_own_ancestors():
    tree = Ancestry()
    tree.see(_record([0, 1, 2], [0, 0, 0, -1]))
    assert tree.distinct() == 2
    tree.see(_record([0, 1, 2, 3], [3, 3, 0, 1, -1]))  # the fresh one, the old one, and another fresh one
    assert tree.distinct() == 3


def test_only_so_many_updates_are_looked_back():
    tree = Ancestry(depth=2)
    tree.see(_record([0, 1, 2, 3], [0, 0, 0, 0]))
    assert tree.distinct() == 1
    for _ in range(2):
        tree.see(_record([0, 1, 2, 3], [0, 1, 2, 3]))
    assert tree.distinct() == 4


def test_lines_go_back_through_the_parents():
    tree = Ancestry()
    tree.see(_record([1.0, 2.0], [1, 1]))
    tree.see(_record([3.0, 4.0], [1, -1]))
    (first,) = (line for line in tree.lines(10))
    assert first == pytest.approx(np.array([[14.0, 20.0], [12.0, 20.0]]))


def test_lines_are_as_many_as_asked_for_at_most():
    tree = Ancestry()
    tree.see(_record(np.arange(100.0)))
    assert len(tree.lines(7)) == 7
    assert len(tree.lines(1000)) == 100


def test_nothing_seen_yet():
    assert Ancestry().distinct() == 0
    assert Ancestry().lines(5) == []
