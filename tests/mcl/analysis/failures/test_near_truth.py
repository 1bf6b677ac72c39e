from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from helpers.step_records import at, made
from maurice_mcl.analysis.failures.near_truth import (
    DROPPED,
    MISLED,
    MOVED,
    NEVER,
    OUTWEIGHED,
    VanishingFinder,
    near_truth,
    truth_fit,
)
from maurice_mcl.records import Belief

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


class Places:
    """Two references: 0 at x = 1, 1 at x = 4; what a sensor model offers, as far as it is needed."""

    library = SimpleNamespace(origin=np.zeros(2))

    @property
    def references(self):
        return self

    def entries(self, poses, origin):
        return np.where(poses[:, 1] > 2, -1, poses[:, 0] > 2.5).astype(np.int32)


def fitting(record, here, away):
    """Give the two references these log-likelihoods."""
    comparison = replace(record.sighting.comparison, log_likelihood=np.array([here, away], np.float32))
    return replace(record, sighting=replace(record.sighting, comparison=comparison))


def test_shares_are_those_after_motion_picture_and_resampling():
    found = near_truth(cloud(0.5, 0.75, 0.25), TRUTH)
    assert (found.particles, found.shares) == (4, pytest.approx((0.5, 0.75, 0.25)))
    assert found.nearest_m == pytest.approx(0.02, abs=1e-6)


def test_near_needs_a_like_heading_and_free_space():
    assert near_truth(made(THERE, heading=1.0, references=2), TRUTH).particles == 0
    record = made(THERE, references=2)
    walls = replace(record.sighting, entries=np.array([-1, -1, 0, 0], np.int32))
    assert near_truth(replace(record, sighting=walls), TRUTH).particles == 2


def test_the_fit_is_that_of_the_references_nearest_truth_and_estimate():
    record = fitting(made(AWAY, references=2), -3.0, -1.0)
    found = truth_fit(record, TRUTH, Places())
    assert (found.truth, found.estimate, found.rank, found.references) == (-3.0, -1.0, 2, 2)
    assert not found.is_better
    assert truth_fit(record, np.array([1.0, 9.0, 0.0]), Places()) is None  # off the map
    assert truth_fit(made(AWAY), TRUTH, Places()) is None  # nothing was compared


def watched(*records, sensor=None):
    finder = VanishingFinder(sensor)
    for step, record in enumerate(records, 1):
        finder.see(step, record, TRUTH)
    return finder.found()


@pytest.mark.parametrize(
    ("last", "kind"),
    [
        (cloud(0.05, 0.05, 0.05), MOVED),
        (cloud(0.5, 0.05, 0.05), OUTWEIGHED),
        (cloud(0.5, 0.5, 0.05), DROPPED),
    ],
)
def test_what_took_most_of_the_share_is_what_made_the_particles_go(last, kind):
    found = watched(cloud(0.5, 0.5, 0.5), last, made(AWAY, references=2))
    assert (found.held, found.near, found.gone, found.particles) == (1 if kind != DROPPED else 2, 4, 3, 4)
    assert found.kind == kind


def test_a_cloud_that_never_came_near_says_how_near_it_was():
    found = watched(*[made(AWAY, references=2)] * 3)
    assert (found.kind, found.held, found.gone) == (NEVER, None, 1)
    assert found.nearest_m == pytest.approx(2.98, abs=1e-6)


def test_pictures_are_counted_since_the_last_particle_went():
    away = made(AWAY, references=2)
    here = fitting(made(THERE, references=2), -9.0, 0.0)
    found = watched(here, *[fitting(away, -1.0, -2.0)] * 3, fitting(away, -2.0, -1.0), sensor=Places())
    assert (found.gone, found.better, found.pictures, found.rank, found.references) == (2, 3, 4, 1, 2)
    assert found.fits


def test_a_cloud_with_some_particles_at_the_truth_can_be_misled_by_the_pictures():
    wrong = fitting(cloud(0.1, 0.1, 0.1), -2.0, -1.0)
    found = watched(cloud(0.5, 0.5, 0.5), *[wrong] * 4, sensor=Places())
    assert (found.kind, found.gone, found.better, found.pictures) == (MISLED, None, 1, 5)


def test_without_truth_or_picture_nothing_is_known():
    finder = VanishingFinder()
    finder.see(1, made(AWAY, references=2), None)
    finder.see(2, made(AWAY), TRUTH)
    assert (finder.found().kind, finder.found().held) == ("", None)
