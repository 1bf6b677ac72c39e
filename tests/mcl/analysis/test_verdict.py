import pytest

from helpers.step_records import at, made, moment
from maurice_mcl.analysis.verdict import RunVerdict, VerdictBuilder
from maurice_mcl.filter.localizer import LEFT_MAP

HERE = at(1, 1, 1.0)
FAR = (4.0, 1.0, 0.0)  # where the robot is while the cloud is at (1, 1)
NEAR = (1.0, 1.0, 0.0)


def verdict_of(truths, log=None, fresh=None, events=None):
    """Judge a run whose cloud stays at (1, 1), for a truth at every step from 1 on."""
    builder = VerdictBuilder()
    for step, truth in enumerate(truths, 1):
        record = made(HERE, step=step, injected=(fresh or {}).get(step), events=(events or {}).get(step, ()))
        builder.add(moment(record, truth, *(log or {}).get(step, ())), record)
    return builder.result()


def test_a_run_that_stays_localized_has_no_trouble_and_opens_at_its_worst_error():
    found = verdict_of([NEAR] * 5 + [(1.2, 1.0, 0.0)] + [NEAR] * 4)
    assert (found.troubles, found.found, found.decisive) == ((), 1, 6)
    assert found.error_most_m == pytest.approx(0.2, abs=1e-6)
    assert found.error_mean_m == pytest.approx(0.02, abs=1e-6)


def test_a_loss_counts_from_its_first_update_and_is_sure_where_the_cloud_is_narrow():
    (trouble,) = verdict_of([NEAR] * 5 + [FAR] * 6).troubles
    assert (trouble.kind, trouble.step, trouble.recovered, trouble.lost) == ("lost", 6, None, True)
    assert (trouble.updates, trouble.sure, trouble.is_sure) == (6, 6, True)


def test_a_kidnapping_owns_the_loss_that_follows_and_the_fresh_particles_of_its_recovery():
    truths = [NEAR] * 5 + [FAR] * 5 + [NEAR] * 6
    found = verdict_of(truths, {6: ("kidnapped",)}, {8: [True, True, False, False], 13: [True] * 4})
    (trouble,) = found.troubles
    assert (trouble.kind, trouble.step, trouble.recovered, trouble.lost) == ("kidnapped", 6, 11, True)
    assert (trouble.fresh, trouble.updates, found.decisive) == (2, 5, 6)


def test_without_truth_nothing_is_judged():
    found = verdict_of([None] * 6, events={4: (LEFT_MAP,)})
    assert (found.has_truth, found.error_mean_m, found.troubles) == (False, None, ())
    assert (found.converged_share, found.left_map, found.decisive) == (1.0, (4,), 4)


def test_before_the_first_update_there_is_nothing_to_say():
    assert VerdictBuilder().result() == RunVerdict()
