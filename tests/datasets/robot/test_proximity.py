import numpy as np
import pytest

from maurice_datasets.robot.behaviors import Proximity, Ring, distances, sense
from maurice_mcl.map import Arena, Region

BOX = Region("box", np.array([[2.0, -0.5], [3.0, -0.5], [3.0, 0.5], [2.0, 0.5]]))
WALL = np.array([[-1.0, -5.0, -1.0, 5.0]])
ARENA = Arena((-1, -5, 5, 5), WALL, (BOX,))
ORIGIN = np.zeros(3)


def test_readings_are_those_of_geometry() -> None:
    found = distances(ARENA, ORIGIN[:2], np.array([0.0, np.pi, 3 * np.pi / 4, np.pi / 2, np.pi / 4]))
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


def test_a_disc_stops_where_it_touches() -> None:
    read = Proximity(np.array([0.0, 0.2]), np.array([2.0, 3.0]), 3.0)
    assert read.open_m(0.0, 0.5) == pytest.approx(1.5)
    assert read.open_m(np.pi, 0.5) == pytest.approx(2.5)  # nothing there: as far as it sees
    beside = Proximity(np.array([np.pi / 6]), np.array([2.0]), 9.0)  # 1 m aside
    assert beside.open_m(0.0, 0.9) == pytest.approx(8.1)
    assert beside.open_m(0.0, 1.0 + 1e-9) == pytest.approx(np.sqrt(3), abs=1e-3)
    assert Proximity(np.array([0.0]), np.array([0.3]), 3.0).open_m(0.0, 0.5) == 0
