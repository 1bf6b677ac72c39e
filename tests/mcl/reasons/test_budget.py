"""What a perfect part is: by definition, on drives small enough to reckon."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import maurice_mcl as mcl
from maurice_mcl.reasons.budget import (
    AS_IS,
    LIBRARY,
    MOTION,
    SENSOR,
    TrueMotion,
    budget_line,
    perfect_comparisons,
    with_dense_references,
    with_perfect,
    with_true_motions,
)
from maurice_mcl.scoring.batch import SeededRuns, compared_once
from maurice_mcl.values.geometry import compose
from maurice_mcl.values.nearest import distinct_places, spacing


@pytest.fixture(scope="module")
def moments() -> list[mcl.Moment]:
    return list(mcl.tiny_session().moments())


@pytest.fixture(scope="module")
def localizer() -> mcl.Localizer:
    return mcl.make_localizer(mcl.tiny_library(), particles=200).of_session(mcl.tiny_session())


def test_true_motions_lead_from_truth_to_truth(moments: list[mcl.Moment]) -> None:
    start = moments[0].truth
    assert start is not None
    told = with_true_motions(moments[1:], start)
    here = start
    for moment in told:
        (motion,) = moment.frame.motions
        here = compose(here, motion)
        assert moment.truth is not None
        assert np.allclose(here, moment.truth, atol=1e-9)


@pytest.mark.parametrize("without", [[1], [1, 2], [2, 4], [1, 2, 3, 4]])
def test_updates_without_truth_do_not_count_a_distance_twice(
    moments: list[mcl.Moment], without: list[int]
) -> None:
    given = [replace(moment, truth=None) if k in without else moment for k, moment in enumerate(moments)]
    here = moments[0].truth
    assert here is not None
    for moment in with_true_motions(given, here):
        for motion in moment.frame.motions:
            here = compose(here, motion)
        if moment.truth is not None:
            assert np.allclose(here, moment.truth, atol=1e-9)


def test_a_truth_after_a_kidnapping_without_one_tells_no_movement(moments: list[mcl.Moment]) -> None:
    carried = replace(moments[1], truth=None, events=("kidnapped",))
    assert len(with_true_motions([moments[0], carried, moments[2]], None)[2].frame.motions) == 0


def test_no_movement_is_told_where_the_robot_was_carried(moments: list[mcl.Moment]) -> None:
    carried = [moments[0], replace(moments[1], events=("kidnapped",))]
    assert len(with_true_motions(carried, None)[1].frame.motions) == 0


def test_without_noise_every_particle_moves_by_the_true_motion() -> None:
    rng = np.random.default_rng(0)
    poses = rng.uniform(-1, 1, (50, 3)).astype(np.float32)
    motion = np.array([0.3, -0.1, 0.4])
    moved = TrueMotion().move(poses, np.zeros(2), motion, np.zeros((50, 3), np.float32))
    expected = [compose(pose.astype(float), motion) for pose in poses]
    assert np.allclose(moved, expected, atol=1e-5)


def test_a_perfect_sensor_likes_the_reference_nearest_the_truth_best(
    localizer: mcl.Localizer, moments: list[mcl.Moment]
) -> None:
    comparisons = compared_once(localizer.sensor, moments)
    for moment, perfect in zip(moments, perfect_comparisons(localizer, moments, comparisons), strict=True):
        assert moment.truth is not None
        away = np.linalg.norm(localizer.library.poses[:, :2] - moment.truth[:2], axis=1)
        assert away[perfect.log_likelihood.argmax()] == pytest.approx(away.min())
        assert len(perfect.of_references) == len(comparisons[0].of_references)


def test_a_picture_without_truth_says_nothing(localizer: mcl.Localizer, moments: list[mcl.Moment]) -> None:
    blind = [replace(moment, truth=None) for moment in moments]
    comparisons = compared_once(localizer.sensor, moments)
    assert all(not one.log_likelihood.any() for one in perfect_comparisons(localizer, blind, comparisons))


def test_dense_references_lie_a_quarter_as_far_apart_all_over_the_floor(localizer: mcl.Localizer) -> None:
    dense = with_dense_references(localizer)
    before, _ = distinct_places(localizer.library.poses[:, :2])
    after, _ = distinct_places(dense.library.poses[:, :2])
    assert spacing(after) == pytest.approx(spacing(before) / 4, rel=0.2)
    grid = localizer.reference.grid
    floor = grid.centers()[grid.free.ravel()]
    nearest = np.linalg.norm(floor[:, None] - after[None], axis=2).min(axis=1)
    assert nearest.max() <= spacing(after)


def test_perfect_parts_leave_less_error(localizer: mcl.Localizer, moments: list[mcl.Moment]) -> None:
    comparisons = compared_once(localizer.sensor, moments)
    runs = SeededRuns(localizer, moments, comparisons, range(8), moments[0].truth)
    lines = [
        budget_line(part, with_perfect(part, runs).tables()) for part in (AS_IS, MOTION, SENSOR, LIBRARY)
    ]
    error_m = {line.part: line.errors_m.mean() for line in lines}
    assert error_m[LIBRARY] < error_m[SENSOR] + 0.01
    assert error_m[MOTION] < error_m[AS_IS]
    assert error_m[LIBRARY] < error_m[AS_IS]


def test_without_truth_there_is_no_budget(localizer: mcl.Localizer, moments: list[mcl.Moment]) -> None:
    blind = [replace(moment, truth=None) for moment in moments]
    comparisons = compared_once(localizer.sensor, moments)
    with pytest.raises(mcl.InputError, match="no truth"):
        with_perfect(AS_IS, SeededRuns(localizer, blind, comparisons, [0]))
