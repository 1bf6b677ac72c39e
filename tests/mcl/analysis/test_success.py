"""The thesis's definition of success, on clouds made for it."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from maurice_mcl.analysis.success import LEFT, TOO_LATE, SuccessJudge, meets_circle, meets_tenth
from maurice_mcl.filter.estimate import heaviest_cluster, weighted_mean
from maurice_mcl.geometry import INCH_M
from maurice_mcl.records import Belief, uniform_log_weights

ARENA_M = (204 * INCH_M, 156 * INCH_M)
HERE = np.array([1.0, 1.0, 0.0])


def _record(off_m, time_s=10.0, at=HERE, injected=None, fresh=None, forward_m=0.2):
    """An update, its particles along x from a place; `fresh` were injected before, `injected` now."""
    offsets = np.asarray(off_m, float)
    poses = np.zeros((len(offsets), 3), np.float32)
    poses[:, 0], poses[:, 1] = at[0] + offsets, at[1]
    belief = Belief(poses, uniform_log_weights(len(poses)), np.zeros(2))
    frame = SimpleNamespace(motions=np.array([[forward_m, 0.0, 0.1]]), time_s=time_s)
    return SimpleNamespace(
        weighted=belief,
        estimate=heaviest_cluster(belief, fresh),
        mean_estimate=weighted_mean(belief, fresh),
        injected=injected,
        frame=frame,
    )


ROW = np.linspace(-0.5, 0.5, 101)  # sd 0.2915, all within 24 in
SPREAD = np.linspace(-2, 2, 100)


@pytest.mark.parametrize(("share", "expected"), [(91, True), (90, False)])
def test_the_circle_wants_more_than_nine_of_ten_within_six_inches(share, expected):
    record = _record([0.0] * share + [0.4] * (100 - share))
    record.estimate = heaviest_cluster(_record([0.0]).weighted)
    assert meets_circle(record, None) is expected


def test_the_circle_is_one_foot_in_diameter():
    assert meets_circle(_record([-5.9 * INCH_M, 5.9 * INCH_M]), None)
    assert not meets_circle(_record([-6.1 * INCH_M, 6.1 * INCH_M]), None)


def test_a_tenth_wants_both_the_share_and_a_small_spread():
    assert meets_tenth(_record(ROW), ARENA_M)
    assert not meets_tenth(_record(ROW), (2.9, 4.0)), "sd 0.29"
    assert not meets_tenth(_record([0.0] * 89 + [0.65] * 11), ARENA_M), "a share of 89 %"
    assert not meets_tenth(_record([0.0] * 95 + [4.0] * 5), ARENA_M), "sd 0.87 m of the whole cloud"


def test_each_axis_has_its_own_bound():
    record = _record(ROW)
    assert meets_tenth(record, (2.95, 0.1))
    assert not meets_tenth(record, (2.9, 100.0))
    record.mean_estimate = replace(record.mean_estimate, sd_m=(0.0, 0.5))
    assert not meets_tenth(record, (100.0, 4.9))


def _judged(records, truths=None):
    judge = SuccessJudge(ARENA_M)
    for record, truth in zip(records, truths or [HERE] * len(records), strict=True):
        judge.add(record, truth)
    return {one.preset: one for one in judge.result()}


def test_time_to_localize_in_updates_metres_and_seconds():
    truths = [HERE + np.array([0.3 * k, 0, 0]) for k in range(4)]
    records = [_record(SPREAD if k < 2 else [0.0] * 9, 5.0 * k, truths[k]) for k in range(4)]
    for one in _judged(records, truths).values():
        assert (one.at_update, one.at_s, one.failed) == (3, 10.0, None)
        assert one.at_m == pytest.approx(0.6)


def test_without_truth_the_way_is_the_odometrys_and_nobody_can_leave():
    found = _judged([_record(SPREAD), _record([0.0]), _record([0.0], at=HERE + 5)], [None] * 3)
    for one in found.values():
        assert (one.at_update, one.failed) == (2, None)
        assert one.at_m == pytest.approx(0.4)


def test_later_than_five_minutes_is_a_failure():
    in_time = _judged([_record([0.0], 300.0)])
    late = _judged([_record(SPREAD, 299.0), _record([0.0], 300.1), _record([0.0], 310.0)])
    for preset in ("tenth", "circle"):
        assert in_time[preset].at_update == 1
        assert (late[preset].at_update, late[preset].failed, late[preset].failed_at_update) == (
            None,
            TOO_LATE,
            2,
        )


def test_a_run_that_ends_early_neither_succeeds_nor_fails():
    for one in _judged([_record(SPREAD, 20.0)]).values():
        assert (one.at_update, one.failed) == (None, None)


def test_leaving_the_truth_is_a_failure_once_localized():
    def off(inches):
        return HERE + np.array([inches * INCH_M, 0, 0])

    found = _judged([_record(SPREAD), *(_record([0.0], at=off(k)) for k in (0, 35.9, 36.1, 0))])
    for one in found.values():
        assert (one.at_update, one.failed, one.failed_at_update) == (2, LEFT, 4)


def test_localizing_in_the_wrong_place_fails_at_once():
    for one in _judged([_record([0.0], at=HERE + 2)]).values():
        assert (one.at_update, one.failed, one.failed_at_update) == (1, LEFT, 1)


def test_freshly_injected_particles_are_left_out():
    fresh = np.array([False] * 80 + [True] * 20)
    offsets = [0.0] * 80 + [4.0] * 20
    records = [_record(SPREAD, injected=fresh), _record(offsets, fresh=fresh)]
    assert all(one.at_update == 2 for one in _judged(records).values())
    records[0].injected = None
    assert _judged(records)["circle"].at_update is None


def test_a_mask_of_another_size_is_not_used():
    records = [_record(SPREAD, injected=np.ones(3, bool)), _record([0.0] * 10)]
    assert _judged(records)["circle"].at_update == 2
