from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from helpers.step_records import at, made
from maurice_mcl.scoring.modes import near_truth
from maurice_mcl.values.records import Belief

TRUTH = np.array([1.0, 1.0, 0.0])
THERE, AWAY = at(1, 1, 1.0), at(4, 1, 1.0)


def cloud(*shares):
    """Make a record whose cloud is half here, half away: the shares of the weight here, in order."""
    moved, weighed, after = shares
    record = made(at(1, 1, 0.5) + at(4, 1, 0.5), references=2)

    def with_share(share):
        weights = np.repeat([share / 4, (1 - share) / 4], 4)
        with np.errstate(divide="ignore"):
            return Belief(record.weighted.poses, np.log(weights), record.weighted.origin)

    shared = replace(record, predicted=with_share(moved), weighted=with_share(weighed))
    return replace(shared, belief=with_share(after), estimate=made(AWAY).estimate)


def test_shares_are_those_after_motion_picture_and_resampling():
    found = near_truth(cloud(0.5, 0.75, 0.25), TRUTH)
    assert (found.particles, found.shares) == (4, pytest.approx((0.5, 0.75, 0.25)))
    assert found.nearest_m == pytest.approx(0.02, abs=1e-6)


def test_near_needs_a_like_heading_and_free_space():
    assert near_truth(made(THERE, heading=1.0, references=2), TRUTH).particles == 0
    record = made(THERE, references=2)
    walls = replace(record.sighting, entries=np.array([-1, -1, 0, 0], np.int32))
    assert near_truth(replace(record, sighting=walls), TRUTH).particles == 2
