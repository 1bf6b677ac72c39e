"""Places where a robot may be as well: after a jump they are followed, and share the probability."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from helpers.step_records import at, made, moment
from maurice_mcl.scoring.episodes import standing
from maurice_mcl.scoring.lost_signal import LostSignal
from maurice_mcl.scoring.table import PROBABLY_LOCALIZED, PROBABLY_LOST, SEARCHING, TableRows
from maurice_mcl.values.pose_sensor import Sensed

HERE, THERE = (2.0, 1.0), (60.0, 1.0)


@dataclass
class TwinRooms:
    """A sensor that fits two places alike, or one of them less by some nats."""

    less: dict[tuple[float, float], float] = field(default_factory=dict)
    against_there: float = 0.0
    name: str = "twins"

    def against(self, reading, pose):
        return self.against_there

    def settled(self, reading, pose):
        near = [place for place in (HERE, THERE) if np.hypot(*(pose[:2] - place)) < 0.4 and abs(pose[2]) < 1]
        return pose, -self.less.get(near[0], 0.0) if near else -24.0


def record(step, place, sensor):
    one = made(at(*place, 1.0), step=step)
    sensed = Sensed(sensor, "scan", 1.0, np.zeros(0, np.float32))
    comparison = replace(one.sighting.comparison, sensed=(sensed,))
    return replace(one, sighting=replace(one.sighting, comparison=comparison))


def run(sensor, places):
    """Return what the signal says at each place of a run that stands still or jumps."""
    signal, rows = LostSignal(), TableRows()
    for step, place in enumerate(places, 1):
        one = record(step, place, sensor)
        signal.add(one)
        rows.add(moment(one), one, signal)
    return signal, standing(rows.table())


def test_a_run_that_never_jumped_has_no_rival():
    signal, now = run(TwinRooms(), [HERE] * 5)
    assert signal.places == 1
    assert signal.knows > 0.95
    assert now.state == PROBABLY_LOCALIZED
    assert "places" not in now.words


def test_two_places_that_readings_cannot_tell_apart_are_said_to_be_two():
    signal, now = run(TwinRooms(), [HERE] * 5 + [THERE] * 5)
    assert signal.places == 2
    assert signal.knows == pytest.approx(0.5, abs=0.02)
    assert now.state == SEARCHING
    assert now.words.endswith("at one of 2 places that look alike")


def test_a_place_that_was_left_and_fits_better_makes_an_alarm():
    signal, now = run(TwinRooms({THERE: 8.0}), [HERE] * 5 + [THERE] * 5)
    assert signal.probably_lost
    assert now.state == PROBABLY_LOST


def test_a_jump_to_where_the_readings_fit_leaves_no_rival_after_a_few():
    signal, _ = run(TwinRooms({HERE: 8.0}), [HERE] * 5 + [THERE] * 16)
    assert signal.places == 1
    assert signal.knows > 0.95


def test_what_comes_back_to_the_place_that_it_left_is_sure_again():
    sensor = TwinRooms({THERE: 8.0})
    signal, _ = run(sensor, [HERE] * 5 + [THERE] * 3 + [HERE] * 16)
    assert signal.places == 1
    assert signal.knows > 0.95


def test_doubt_comes_at_once_and_goes_slowly():
    signal, sensor = LostSignal(), TwinRooms()
    signal.add(record(1, HERE, sensor))
    sensor.against_there = 0.6
    signal.add(record(2, HERE, sensor))
    assert signal.probably_lost
    sensor.against_there = 0.0
    rising = [signal.add(record(step, HERE, sensor)) for step in range(3, 19)]
    assert rising == sorted(rising)
    assert rising[0] < 0.3
    assert rising[-1] > 0.95
