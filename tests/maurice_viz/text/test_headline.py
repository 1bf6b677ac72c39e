"""The headline: what happened to which run, in two lines of a small screen."""

from __future__ import annotations

from dataclasses import replace

import pytest

from maurice_mcl.filter.recovery import DRAWS_NEVER, DRAWS_WHERE_LIKELY
from maurice_mcl.reasons.causes import (
    AMBIGUITY,
    CARRIED,
    DARK,
    FLAT,
    JUMPED,
    LIGHTING,
    UNKNOWN,
    Failure,
    Incident,
)
from maurice_mcl.reasons.verdict import Ambiguity, RunVerdict, decisive_step
from maurice_mcl.scoring.comparison import ErrorDifference, OdometryAlone
from maurice_mcl.scoring.episodes import Episode
from maurice_mcl.scoring.metrics import StepScore
from maurice_mcl.scoring.table import PROBABLY_LOST
from maurice_mcl.sensor.laser.parameters import LaserParameters
from maurice_viz.style import UNITS, Scale
from maurice_viz.text.verdict import TWO_LINES, headline

INCHES = Scale(UNITS["in"])
OFF, NEAR = StepScore(2.0, 0.1, True, False, True), StepScore(0.05, 0.1, True, True, False)
GOOD = RunVerdict(updates=90, has_truth=True, localized=1, first=1, last=90, error_mean_m=0.1, end=NEAR)
STAYS = Episode("kidnapped", 61, 90, 61, 63, 64, steps=30, sure=29)
EARLY, LATE = Episode("lost", 10, 60, 10, lost=13), Episode("lost", 70, 90, 70, lost=73)
BACK = Episode("kidnapped", 61, 62, 61, localized=63, steps=2, fresh=100)
LONG, JUMP = Episode("lost", 61, 75, 61, lost=64, localized=76, steps=15), Incident(JUMPED, 61, 61, 0.2, 3.0)
AMCLS = LaserParameters(model="likelihood_field")


def wrong(*episodes, end=OFF, **more):
    carried = tuple(Incident(CARRIED, one.first, one.first) for one in episodes if one.kind == "kidnapped")
    return replace(GOOD, episodes=episodes, incidents=carried, end=end, **more)


def doubted(cause):
    failure = Failure(cause, 9, Episode(PROBABLY_LOST, 9, 20, noticed=9), truth_known=False)
    return RunVerdict(updates=90, converged_share=0.9, failures=(failure,))


TWINS = Ambiguity(step=3, first=2, last=4, shares=(0.5, 0.4), apart_m=1.6, truth_in=2)
ALONE = OdometryAlone(0.1, 0.2, ErrorDifference(0.3, (0.1, 0.4), 2, 87, 9, 78))


@pytest.mark.parametrize(
    ("verdict", "facts"),
    [
        (RunVerdict(), ["No step yet"]),
        (GOOD, ["The filter was right at every step", "3.9 in"]),
        (wrong(STAYS), ["Kidnapped at step 61: the filter stayed lost, sure of a wrong place", "78.7 in"]),
        (
            wrong(BACK, end=NEAR),
            ["Kidnapped at step 61", "found itself again", "step 63", "100 new"],
        ),
        (
            replace(GOOD, incidents=(JUMP,), episodes=(LONG,), end=NEAR),
            ["The truth jumps at step 61: the filter was lost, and found itself again (at step 76, 15 steps"],
        ),
        (
            replace(wrong(STAYS), laser=AMCLS, draws_new=DRAWS_NEVER),
            ["stayed lost", "recovery_alpha 0: no new particles"],
        ),
        (
            replace(wrong(BACK, end=NEAR), laser=AMCLS, draws_new=DRAWS_WHERE_LIKELY),
            ["found itself again (at step 63, by particles drawn where the scan fits)"],
        ),
        (
            wrong(replace(BACK, kind="lost", given=62, fresh=0), end=NEAR),
            ["The filter was lost until somebody gave a pose (at step 63)"],
        ),
        (replace(GOOD, odometry_alone=ALONE), ["worse than odometry alone", "without the camera"]),
        (
            RunVerdict(updates=5, localized=1, first=1, last=5, has_truth=True, end=NEAR),  # not scored
            ["The filter was right at every step (2.0 in off at the end)"],
        ),
        (
            RunVerdict(updates=9, has_truth=True, end=NEAR),
            ["The filter was right at every step, but never sure of it (2.0 in off at the end)"],
        ),
        (
            RunVerdict(updates=20, has_truth=True, end=NEAR, off=6, sure=2),
            ["right at 14 of 20 steps, but sure of it at only 2"],
        ),
        (
            replace(GOOD, updates=20, end=OFF, off=15, sure=4, kept_share=0.2),
            ["localized at only 4 of 20 steps (78.7 in off at the end)"],
        ),
        (
            RunVerdict(updates=20, has_truth=True, end=NEAR, off=17, sure=3, sure_lately=3),
            ["localized only at the last 3 of 20 steps"],
        ),
        (
            RunVerdict(updates=9, converged_share=0.5),
            ["together (at 50% of the steps). No truth is known"],
        ),
        (
            RunVerdict(updates=5, has_truth=True, end=OFF, off=5),
            ["never localized", "78.7 in off at the end"],
        ),
        (
            wrong(STAYS, STAYS, end=NEAR, failures=(Failure(AMBIGUITY, 61, STAYS),)),
            [
                "Kidnapped at step 61 and 1 more time",
                "was lost and not localized again, though right in the end",
            ],
        ),
        (
            wrong(LATE, failures=(Failure(AMBIGUITY, 70, LATE),)),
            ["The filter stayed lost", "places look alike"],
        ),
        (  # it was not the kidnapping that it was lost by
            wrong(EARLY, replace(STAYS, sure=0), failures=(Failure(FLAT, 10, EARLY),)),
            ["Kidnapped at step 61: the filter was lost from step 10 on", "likelihood too flat"],
        ),
        (
            wrong(replace(EARLY, localized=20), STAYS),
            ["the filter stayed lost", "lost from step 10 before"],
        ),
        (
            replace(GOOD, localized=9, ambiguity=TWINS),
            ["Two places looked alike at step 3: the filter found itself", "step 9"],
        ),
        (replace(GOOD, incidents=(Incident(DARK, 30, 40),)), ["Lights out at step 30: the filter was right"]),
        (doubted(LIGHTING), ["probably lost", "No truth is known", "from step 9", "the light changed"]),
    ],
)
def test_one_run(verdict, facts):
    text = headline({"robust": verdict}, INCHES)
    assert len(text) <= TWO_LINES
    for fact in facts:
        assert fact in text


def test_without_truth_the_run_that_fits_elsewhere_is_the_evidence_and_the_step_is_where_they_parted():
    verdict = doubted(UNKNOWN)
    (failure,) = verdict.failures
    rival = replace(failure, first=7, evidence={"rival": "robust", "apart_m": 2.0})
    runs = {"thesis": replace(verdict, failures=(rival,)), "robust": RunVerdict(updates=90, first=1)}
    expect = "`thesis` was probably lost (from step 9: `robust` fits these pictures 78.7 in away)."
    assert headline(runs, INCHES).startswith(expect)
    assert decisive_step(runs) == 7
    runs["robust"] = replace(verdict, updates=90)  # which has another reason, or none
    assert headline(runs, INCHES).startswith("`thesis` and `robust` were probably lost (from step 9).")


def test_a_run_that_was_never_localized_is_looked_at_before_the_worst_step_of_one_that_was_right():
    searching = Episode("searching", 1, 90, steps=90)
    never = RunVerdict(updates=90, has_truth=True, first=1, last=90, end=OFF, episodes=(searching,))
    never = replace(never, failures=(Failure(FLAT, 2, searching),), error_most_m=9.0, most_at=50)
    assert decisive_step({"a": replace(GOOD, error_most_m=0.2, most_at=5), "b": never}) == 50


def test_a_lost_run_is_looked_at_before_the_worst_step_of_one_that_was_not():
    assert decisive_step({"a": replace(GOOD, error_most_m=0.2, most_at=5), "b": wrong(STAYS)}) == 61


def test_a_cause_that_is_not_known_is_not_told():
    text = headline({"robust": doubted(UNKNOWN)}, INCHES)
    assert "from step 9" in text
    assert "not known" not in text


def test_runs_that_did_the_same_are_told_together():
    back = wrong(BACK, end=NEAR)
    later = wrong(replace(BACK, localized=70), end=NEAR)
    text = headline({"a": wrong(STAYS), "b": back, "c": later, "d": wrong(STAYS)}, INCHES)
    assert text == (
        "Kidnapped at step 61: `a` and `d` stayed lost, sure of a wrong place (78.7 in off at the end). "
        "`b` and `c` found themselves again (at step 63 and 70)."
    )
    assert headline({"a": back, "b": GOOD}, INCHES).startswith("`a` found itself again")  # of other drives


@pytest.mark.parametrize("updates", [1, 4])
def test_a_few_steps_are_too_few_to_judge_by(updates):
    lost = replace(wrong(STAYS), updates=updates)
    text = headline({"a": lost, "b": replace(lost, end=NEAR)}, INCHES)
    expect = [f"After {updates} step", "`a` is 78.7 in off", "`b` is ", "Too early"]
    assert all(fact in text for fact in expect)
    assert "stayed lost" not in text
    assert headline({"a": replace(lost, has_truth=False)}, INCHES).endswith("too early to say anything.")


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_four_different_ends_have_room_in_two_lines(count):
    ends = [wrong(STAYS), wrong(BACK, end=NEAR), wrong(STAYS, end=NEAR), wrong(BACK, BACK, end=NEAR)][:count]
    labels = ["calibrated", "robust", "thesis", "refined"]
    text = headline(dict(zip(labels, ends, strict=False)), INCHES)
    assert len(text) <= TWO_LINES
    assert all(f"`{label}`" in text for label in labels[:count] if count > 1)


def test_no_episode_that_was_declared_lost_is_told_as_found_again_alone():
    back = replace(GOOD, episodes=(LONG,), end=NEAR)
    assert "`b` was lost, and found itself again" in headline({"a": GOOD, "b": back}, INCHES)
    both = headline({"a": back, "b": back}, INCHES)
    assert both == "`a` and `b` were lost, and found themselves again (at step 76)."
