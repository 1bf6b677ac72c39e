from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import maurice_mcl as mcl
from helpers.step_records import at, made, moment
from maurice_mcl.filter.localizer import LEFT_MAP
from maurice_mcl.reasons.causes import (
    CARRIED,
    DARK,
    JUMPED,
    LEAPT,
    PROPOSAL,
    SLIPPED,
    Incident,
    IncidentFinder,
)
from maurice_mcl.reasons.verdict import Ambiguity, RunVerdict, VerdictBuilder, most_even
from maurice_mcl.scoring.episodes import Episode
from maurice_mcl.values.map import Region

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
    assert (found.episodes, found.localized, found.decisive, found.off) == ((), 1, 6, 0)
    assert found.error_most_m == pytest.approx(0.2, abs=1e-6)
    assert found.error_mean_m == pytest.approx(0.2 / 7, abs=1e-6)  # over steps 4 to 10, as in the table


def test_a_drive_too_short_to_be_scored_opens_at_its_first_step():
    assert verdict_of([NEAR]).decisive == 1


def test_a_loss_counts_from_its_first_update_and_is_sure_where_the_cloud_is_narrow():
    (episode,) = verdict_of([NEAR] * 5 + [FAR] * 6).episodes
    assert (episode.kind, episode.first, episode.wrong, episode.lost) == ("lost", 6, 6, 9)
    assert (episode.last, episode.localized) == (11, None)
    assert (episode.steps, episode.sure, episode.is_sure) == (6, 6, True)


def test_a_kidnapping_owns_the_loss_that_follows_and_the_fresh_particles_of_its_recovery():
    truths = [NEAR] * 5 + [FAR] * 5 + [NEAR] * 6
    found = verdict_of(truths, {6: ("kidnapped",)}, {8: [True, True, False, False], 13: [True] * 4})
    (episode,) = found.episodes
    assert (episode.kind, episode.first, episode.lost, episode.localized) == ("kidnapped", 6, 9, 11)
    assert (episode.fresh, episode.steps, episode.last, found.decisive) == (2, 5, 10, 6)


def test_without_truth_nothing_is_judged():
    found = verdict_of([None] * 6, events={4: (LEFT_MAP,)})
    assert (found.has_truth, found.error_mean_m, found.episodes) == (False, None, ())
    assert (found.converged_share, found.left_map, found.decisive) == (1.0, (4,), 4)


@pytest.mark.parametrize(("obstacles", "seen"), [("solid", True), ("movable", False)])
def test_a_robot_where_the_map_has_an_obstacle_is_told_once_a_stay_unless_obstacles_may_move(obstacles, seen):
    library = mcl.tiny_library()
    corners = np.array([[0.5, 0.5], [0.9, 0.5], [0.9, 0.9], [0.5, 0.9]])
    arena = replace(library.arena, obstacles=(Region("sofa", corners),))
    library = replace(library, arena=arena)
    settings = {"map.obstacles": obstacles}
    localizer = mcl.make_localizer(library, settings=settings).of_session(mcl.tiny_session())
    builder = VerdictBuilder(localizer)
    inside, edge, out = (0.7, 0.7, 0.0), (0.505, 0.7, 0.0), (1.5, 1.0, 0.0)
    for step, truth in enumerate([out, inside, inside, edge, out, None, inside], 1):
        record = made(HERE, step=step)
        builder.add(moment(record, truth), record)
    found = [(one.obstacle, one.first, one.last) for one in builder.result().in_obstacles]
    assert found == ([("sofa", 2, 3), ("sofa", 7, 7)] if seen else [])


def test_before_the_first_update_there_is_nothing_to_say():
    assert VerdictBuilder().result() == RunVerdict()


def drive(steps, gray=None, cloud=HERE, localizer=None):
    """Judge a run along x: for each step how far odometry says, how far the robot went, and what is told."""
    builder, x = VerdictBuilder(localizer), 1.0
    for step, (driven, moved, *told) in enumerate(steps, 1):
        x += moved
        image = np.full((2, 2, 3), 100 if gray is None else gray[step - 1], np.uint8)
        record = made(cloud, step=step, references=0 if gray is None else 3)
        record = replace(record, frame=replace(record.frame, image=image, motions=np.array([[driven, 0, 0]])))
        builder.add(moment(record, (x, 1.0, 0.0), *told), record)
    return builder.result()


def test_wheels_that_slip_are_one_cause_over_several_steps():
    (cause,) = drive([(0.3, 0.3)] * 3 + [(0.3, 0.05)] * 2 + [(0.3, 0.3)]).incidents
    assert (cause.kind, cause.step, cause.last) == (SLIPPED, 4, 5)
    assert (cause.expected, cause.actual) == (pytest.approx(0.6), pytest.approx(0.1))


def test_odometry_that_jumps_is_no_slip():
    (cause,) = drive([(0.3, 0.3)] * 8 + [(9.0, 0.3)] + [(0.3, 0.3)] * 2).incidents
    assert (cause.kind, cause.step, cause.expected) == (LEAPT, 9, pytest.approx(9.0))


def test_a_small_slip_counts_only_where_the_log_tells_of_it():
    assert drive([(0.2, 0.2)] * 3 + [(0.1, 0.02)]).incidents == ()
    (cause,) = drive([(0.2, 0.2)] * 3 + [(0.1, 0.02, "slip 3 in ahead: the wheels spin")]).incidents
    assert cause.kind == SLIPPED


def test_a_truth_that_jumps_is_a_kidnapping_only_where_the_log_says_so():
    (jumped,) = drive([(0.1, 0.1)] * 2 + [(0.1, 2.0)]).incidents
    (carried,) = drive([(0.1, 0.1)] * 2 + [(0.1, 2.0, "kidnapped")]).incidents
    assert (jumped.kind, jumped.actual, carried.kind, carried.actual) == (JUMPED, 2.0, CARRIED, 2.0)


def test_it_is_dark_after_three_pictures_that_are_darker_than_all_before():
    calm = [(0.1, 0.1)] * 10
    assert drive(calm, [100] * 6 + [20, 20, 100, 100]).incidents == ()
    (cause,) = drive(calm, [100] * 6 + [20] * 4).incidents
    assert (cause.kind, cause.step, cause.last, cause.expected, cause.actual) == (DARK, 7, 10, 100, 20)


@pytest.mark.parametrize(
    ("darkest", "usual", "levels", "dark"),
    [
        (40, 100, [100] * 6 + [60] * 9, None),  # a view that is darker, as some of the library are
        (40, 100, [100] * 6 + [20] * 4, (7, 10)),
        (80, 100, [50] * 6 + [30] * 9, None),  # the same in a drive that is darker as a whole
        (80, 100, [50] * 6 + [20] * 4, (7, 10)),
        (None, None, [100] * 6 + [60] * 9, None),  # no library tells how dark a view may be
        (None, None, [100] * 6 + [20] * 4, (7, 10)),
    ],
)
def test_a_darker_view_is_no_darkness(darkest, usual, levels, dark):
    known = None if darkest is None else np.repeat([[darkest], [usual], [usual]], 3, axis=1).astype(float)
    finder = IncidentFinder(levels=known)
    for step, level in enumerate(levels, start=1):
        record = made(HERE, step=step, references=3)
        frame = replace(record.frame, image=np.full((4, 6, 3), level, np.uint8))
        record = replace(record, frame=frame)
        finder.see(moment(record, NEAR), record)
    found = [(incident.step, incident.last) for incident in finder.incidents if incident.kind == DARK]
    assert found == ([] if dark is None else [dark])


def test_a_loss_is_due_to_what_befell_the_robot_shortly_before():
    found = drive([(0.0, 0.0)] * 5 + [(0.3, 0.05)] * 2 + [(1.0, 1.0)] * 6)
    (episode,) = found.episodes
    assert (episode.kind, found.incident_of(episode).kind) == ("lost", SLIPPED)
    assert episode.is_bereft


def test_a_loss_that_nothing_explains_names_the_step_at_which_the_last_particle_near_the_truth_went():
    builder = VerdictBuilder()
    for step in range(1, 25):
        record = made(at(4, 1, 1.0) if step >= 5 else HERE, step=step, references=3)
        builder.add(moment(record, NEAR), record)
    (failure,) = builder.result().failures
    episode = failure.episode
    assert (failure.kind, failure.first, episode.wrong, episode.last) == (PROPOSAL, 5, 5, 24)
    assert (failure.evidence["held_until"], failure.evidence["died"]) == (4, 5)


def test_two_places_that_share_the_weight_are_told_until_it_is_localized():
    builder = VerdictBuilder()
    for step in range(1, 10):
        cloud = at(1, 1, 0.55) + at(4, 1, 0.45) if step < 4 else HERE
        record = made(cloud, step=step)
        builder.add(moment(record, NEAR), record)
    found = builder.result()
    one = found.telling
    assert (one.first, one.last, one.truth_in, found.decisive) == (1, 3, 1, 1)
    assert (one.shares, one.apart_m) == (
        (pytest.approx(0.55), pytest.approx(0.45)),
        pytest.approx(3, abs=0.05),
    )


def test_of_divided_updates_in_a_row_the_most_even_is_told():
    def divided(**second: float) -> dict[int, Ambiguity]:
        shares = {int(name[1:]): share for name, share in second.items()}
        return {k: Ambiguity(k + 1, k + 1, k + 1, (1 - b, b), 3.0, None) for k, b in shares.items()}

    told = most_even(divided(u2=0.3, u3=0.4, u4=0.4, u5=0.3, u7=0.5, u9=0.35, u10=0.35))
    assert (told.first, told.step, told.last, told.shares[1]) == (3, 4, 6, 0.4)
    assert most_even(divided(u2=0.3, u4=0.4)) is None
    assert most_even({}) is None


# Numbers, just under and just over.


@pytest.mark.parametrize(("levels", "dark"), [([100] * 4, False), ([100] * 5, True)])
def test_five_pictures_must_have_been_seen_before_three_are_dark(levels, dark):
    gray = [*levels, 20, 20, 20]
    assert bool(drive([(0.1, 0.1)] * len(gray), gray).incidents) == dark


def test_where_the_log_tells_of_the_light_a_picture_is_dark_at_two_thirds():
    told = [(0.1, 0.1)] * 6 + [(0.1, 0.1, "lights off")]
    found = [any(i.kind == DARK for i in drive(told, [100] * 6 + [level]).incidents) for level in (67, 66)]
    assert found == [False, True]


def test_wheels_slip_where_half_of_the_way_is_missing():
    found = [drive([(0.6, 0.6)] * 3 + [(0.6, moved)]).incidents for moved in (0.31, 0.29)]
    assert [bool(one) for one in found] == [False, True]


def test_references_score_alike_at_half_of_their_usual_scatter():
    def alike(scatter):
        finder = IncidentFinder()
        for step in range(1, 10):
            record, likely = made(HERE, step=step, references=3), np.array([-1, 0, 1], np.float32)
            comparison = replace(
                record.sighting.comparison, log_likelihood=likely * (1 if step < 7 else scatter)
            )
            frame = replace(record.frame, image=np.full((4, 6, 3), 100 if step < 7 else 10, np.uint8))
            record = replace(record, frame=frame, sighting=replace(record.sighting, comparison=comparison))
            finder.see(moment(record, NEAR), record)
        return finder.incidents[-1].alike

    assert [alike(0.51), alike(0.49)] == [False, True]


def test_a_run_is_kept_from_half_on_and_a_loss_is_due_for_ten_steps():
    assert [RunVerdict(localized=1, kept_share=share).is_kept for share in (0.49, 0.5)] == [False, True]
    slipped = RunVerdict(incidents=(Incident(SLIPPED, 3, 5),))
    losses = [Episode("lost", step, step + 9, wrong=step) for step in (15, 16)]
    assert [slipped.incident_of(loss) is not None for loss in losses] == [True, False]


def rest(share):
    """Spread a share of the weight over a hundred places."""
    return [(9.0 + k, 9.0, share / 100) for k in range(100)]


@pytest.mark.parametrize(
    ("cloud", "updates", "divided"),
    [
        (at(1, 1, 0.76) + at(4, 1, 0.24), 2, False),  # the second needs a quarter
        (at(1, 1, 0.74) + at(4, 1, 0.26), 2, True),
        (at(1, 1, 0.74) + at(4, 1, 0.26), 1, False),  # for two updates
        (at(1, 1, 0.36) + at(4, 1, 0.33) + rest(0.31), 2, False),  # both need 0.7
        (at(1, 1, 0.38) + at(4, 1, 0.33) + rest(0.29), 2, True),
        (at(1, 1, 0.6) + at(2.18, 1, 0.4), 2, False),  # 2 radii *converged* apart, 1.22 m
        (at(1, 1, 0.6) + at(2.26, 1, 0.4), 2, True),
    ],
)
def test_two_places_share_the_weight(cloud, updates, divided):
    builder = VerdictBuilder()
    for step in range(1, updates + 1):
        record = made(cloud, step=step)
        builder.add(moment(record, NEAR), record)
    assert (builder.result().ambiguity is not None) == divided
