"""Pictures compared ahead: the same numbers, in order, with errors where they happened."""

from __future__ import annotations

import threading
from dataclasses import replace

import numpy as np
import pytest

import maurice_mcl as mcl
from maurice_mcl.sensor.ahead import PICTURES_AHEAD, compared, compared_ahead


@pytest.fixture(scope="module")
def sensors():
    library = mcl.tiny_library()
    return [mcl.make_localizer(library, feature=name).sensor for name in ("color", "blended")]


@pytest.fixture(scope="module")
def moments():
    few = list(mcl.tiny_session().moments())
    return [replace(moment, frame=replace(moment.frame, step=k)) for k, moment in enumerate(few * 4, start=1)]


def test_ahead_and_alone_give_the_same_bits(sensors, moments):
    found = list(compared_ahead(sensors, moments))
    assert [moment.frame.step for moment, _ in found] == [moment.frame.step for moment in moments]
    for moment, pictures in found:
        for sensor, picture in zip(sensors, pictures, strict=True):
            alone = sensor.compare(sensor.measure(moment.frame.image))
            assert np.array_equal(picture.comparison.distances, alone.distances)
            assert np.array_equal(picture.comparison.log_likelihood, alone.log_likelihood)
            assert picture.took_s > 0


def test_an_error_comes_after_the_moments_before_it(sensors, moments):
    def broken():
        yield from moments[:5]
        raise ValueError("picture 6 is broken")

    found = compared_ahead(sensors, broken())
    assert [next(found)[0].frame.step for _ in range(5)] == [1, 2, 3, 4, 5]
    with pytest.raises(ValueError, match="picture 6"):
        next(found)


def test_no_more_than_a_few_moments_are_read_ahead(sensors, moments):
    read = []

    def counted():
        for moment in moments:
            read.append(moment.frame.step)
            yield moment

    found = compared_ahead(sensors, counted())
    for taken in range(1, 9):
        next(found)
        assert len(read) <= taken + PICTURES_AHEAD
    found.close()
    assert len(read) <= 8 + PICTURES_AHEAD + 1


def test_stopping_early_ends_the_thread(sensors, moments):
    before = threading.active_count()
    found = compared_ahead(sensors, moments)
    next(found)
    found.close()
    assert threading.active_count() == before


def test_a_channel_of_two_filters_is_measured_once(sensors, moments, monkeypatch):
    calls = []
    from maurice_mcl.sensor import ahead

    class Counting:
        def __init__(self, channel):
            self.channel = channel

        def describe(self, image):
            calls.append(self.channel.name)
            return self.channel.describe(image)

    counting = {name: Counting(channel) for name, channel in ahead.CHANNELS.items()}
    monkeypatch.setattr(ahead, "CHANNELS", counting)
    compared(sensors, moments[0].frame)
    assert sorted(calls) == ["color", "edges"]


def test_a_step_takes_what_was_compared_ahead(sensors, moments):
    localizer = mcl.make_localizer(
        mcl.tiny_library(), feature="color", particles=50, motion={"model": "maurice"}
    )
    state = localizer.initialize(None)
    (seen,) = compared([localizer.sensor], moments[0].frame)
    _, ahead = localizer.step(state, moments[0].frame, seen)
    _, alone = localizer.step(state, moments[0].frame)
    assert ahead.sighting.comparison is seen.comparison
    assert np.array_equal(ahead.weighted.log_weights, alone.weighted.log_weights)
    assert np.array_equal(ahead.belief.poses, alone.belief.poses)
