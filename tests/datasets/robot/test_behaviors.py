from __future__ import annotations

import numpy as np
import pytest

from maurice_datasets.robot.behaviors import (
    DICE,
    AvoidCollision,
    GoToPoint,
    Localize,
    Proximity,
    Ring,
    Senses,
    Stride,
    Wander,
    choose,
    sense,
)
from maurice_datasets.robot.drive import BEHAVIORS
from maurice_datasets.worlds.world import cast, segments_of
from maurice_mcl.values.geometry import INCH_M
from maurice_mcl.values.map import Arena, Region

RING = Ring()
BEARINGS = np.arange(RING.count) * (2 * np.pi / RING.count)
FREE = np.full(RING.count, RING.reach_m)
MIDDLE = np.full(DICE, 0.5)


def around(**near_in: float) -> Proximity:
    """Everything free but the sensors named by their number, like s0=8.0."""
    ranges = FREE.copy()
    for name, inches in near_in.items():
        ranges[int(name[1:])] = inches * INCH_M
    return Proximity(BEARINGS, ranges, RING.reach_m)


def test_priorities():
    pressed = Senses(around(s0=4.0), MIDDLE, bumped=True, unseen=True, goal_rad=0.1)
    chosen = choose(BEHAVIORS, pressed)
    assert chosen.look
    assert (chosen.turn_rad, chosen.forward_m) == (0, 0)
    near = around(s0=5.2)
    names = [
        choose(BEHAVIORS, senses)
        for senses in (
            Senses(near, MIDDLE, goal_rad=0.1),
            Senses(around(), MIDDLE, goal_rad=0.1),
            Senses(around(), MIDDLE),
        )
    ]
    expected = ["collision avoidance", "going to a point", "wandering"]
    assert [n and n.behavior for n in names] == expected
    assert choose((), Senses(around(), MIDDLE)) is None


@pytest.mark.parametrize("die", [0.0, 0.2, 0.5, 0.8, 0.999])
def test_after_contact_it_goes_back(die):
    dice = np.full(DICE, die)
    proposal = AvoidCollision().propose(Senses(around(), dice, bumped=True))
    assert np.pi >= abs(proposal.turn_rad) >= np.radians(120) - 1e-9


def test_goals_are_approached_in_even_strides():
    wall = around(s0=8.0, s1=8.3, s23=8.3, s2=9.2, s22=9.2, s3=11.3, s21=11.3)
    assert GoToPoint().propose(Senses(wall, MIDDLE, goal_rad=0.0)) is None
    clear = GoToPoint().propose(Senses(wall, MIDDLE, goal_rad=np.pi))
    assert abs(clear.turn_rad) == pytest.approx(np.pi)
    rng = np.random.default_rng(5)
    told = [GoToPoint().propose(Senses(around(), rng.random(DICE), goal_rad=0.4)) for _ in range(2000)]
    turns = np.array([p.turn_rad for p in told if p]) - 0.4
    lengths = np.array([p.forward_m for p in told if p])
    assert len(turns) == 2000
    for values, low, high in ((turns, -np.pi / 8, np.pi / 8), (lengths, 5 * INCH_M, 18 * INCH_M)):
        assert (values >= low).all()
        assert (values <= high).all()
        error = (high - low) / np.sqrt(12 * len(values))
        assert values.mean() == pytest.approx((low + high) / 2, abs=4 * error)
    assert Stride().length(1.0, 0.2) == 0.2
    assert Stride().length(0.0, 9.0) == pytest.approx(5 * INCH_M)


def test_wandering_and_avoidance():
    rng = np.random.default_rng(6)
    turns = [Wander().propose(Senses(around(), rng.random(DICE))) for _ in range(500)]
    assert (np.histogram([p.turn_rad for p in turns if p], 4, (-np.pi, np.pi))[0] > 80).all()
    boxed = Proximity(BEARINGS, np.full(RING.count, 7 * INCH_M), RING.reach_m)
    stuck = Wander().propose(Senses(boxed, MIDDLE))
    assert stuck.forward_m < 2 * INCH_M
    assert Localize().propose(Senses(around(), MIDDLE)) is None
    proposal = AvoidCollision().propose(Senses(around(s0=5.1, s1=5.3, s23=5.3), MIDDLE))
    assert abs(proposal.turn_rad) > np.pi / 2
    assert AvoidCollision().propose(Senses(around(s0=7.0), MIDDLE)) is None


BOX = Region("box", np.array([[2.0, -0.5], [3.0, -0.5], [3.0, 0.5], [2.0, 0.5]]))
WALL = np.array([[-1.0, -5.0, -1.0, 5.0]])
ARENA = Arena((-1, -5, 5, 5), WALL, (BOX,))
ORIGIN = np.zeros(3)


def test_readings_are_those_of_geometry():
    found = cast(ORIGIN[:2], np.array([0.0, np.pi, 3 * np.pi / 4, np.pi / 2, np.pi / 4]), segments_of(ARENA))
    assert found[:3] == pytest.approx([2.0, 1.0, np.sqrt(2)])
    assert np.isinf(found[3:]).all()
    empty = Arena((-1, -1, 1, 1), np.zeros((0, 4)))
    read = sense(empty, ORIGIN, Ring(), np.random.default_rng(0))
    assert (read.ranges_m == Ring().reach_m).all()
    ring = Ring(count=4, reach_m=1.5, noise=0.0)
    ahead = sense(ARENA, ORIGIN, ring, np.random.default_rng(0)).ranges_m
    turned = sense(ARENA, np.array([0, 0, np.pi / 2]), ring, np.random.default_rng(0)).ranges_m
    assert ahead == pytest.approx([1.5, 1.5, 1.0, 1.5])
    assert turned == pytest.approx([1.5, 1.0, 1.5, 1.5])
    ring = Ring(count=4, reach_m=9.0, noise=0.05)
    reads = [sense(ARENA, ORIGIN, ring, np.random.default_rng(k)).ranges_m[0] for k in range(800)]
    assert np.mean(reads) == pytest.approx(2.0, abs=4 * 0.1 / np.sqrt(800))
    assert np.std(reads) == pytest.approx(0.1, abs=4 * 0.1 / np.sqrt(1600))


def test_a_disc_stops_where_it_touches():
    read = Proximity(np.array([0.0, 0.2]), np.array([2.0, 3.0]), 3.0)
    assert read.open_m(0.0, 0.5) == pytest.approx(1.5)
    assert read.open_m(np.pi, 0.5) == pytest.approx(2.5)  # nothing there: as far as it sees
    beside = Proximity(np.array([np.pi / 6]), np.array([2.0]), 9.0)  # 1 m aside
    assert beside.open_m(0.0, 0.9) == pytest.approx(8.1)
    assert beside.open_m(0.0, 1.0 + 1e-9) == pytest.approx(np.sqrt(3), abs=1e-3)
    assert Proximity(np.array([0.0]), np.array([0.3]), 3.0).open_m(0.0, 0.5) == 0
