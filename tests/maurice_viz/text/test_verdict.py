from __future__ import annotations

from dataclasses import replace

import pytest

from maurice_mcl.reasons.causes import AMBIGUITY, CARRIED, KIDNAPPED, LIBRARY_GAP, PROPOSAL, SENSOR, Failure
from maurice_mcl.reasons.incidents import Incident, InObstacle
from maurice_mcl.reasons.verdict import Ambiguity, RunVerdict, SureAndWrong
from maurice_mcl.scoring.comparison import ErrorDifference
from maurice_mcl.scoring.dead_reckoning import OdometryAlone
from maurice_mcl.scoring.episodes import PROBABLY_LOST, Episode
from maurice_mcl.scoring.metrics import StepScore
from maurice_viz.style import UNITS, Scale
from maurice_viz.text.causes import say_cause
from maurice_viz.text.verdict import say_verdict, verdict_line

INCHES = Scale(UNITS["in"])
INCH_M = 0.0254
GOOD = RunVerdict(
    updates=90,
    has_truth=True,
    found=1,
    first=1,
    error_mean_m=4 * INCH_M,
    end=StepScore(2 * INCH_M, 0.1, True, True, False),
    error_most_m=9 * INCH_M,
    most_at=41,
)


OFF = StepScore(81 * INCH_M, 0.1, True, False, True)


def wrong(*episodes, end=OFF, **more):
    carried = tuple(Incident(CARRIED, one.first, one.first) for one in episodes if one.kind == "kidnapped")
    facts = {"updates": 90, "has_truth": True, "found": 1, "first": 1, "last": 90, "incidents": carried}
    return RunVerdict(**facts, end=end, episodes=episodes, **more)


BOTH = InObstacle("sofa", 20, 27), InObstacle("desk", 40, 40)
BACK = wrong(Episode("kidnapped", 61, 62, 61, localized=63, steps=2, fresh=100, sure=1))
STAYS = Episode("kidnapped", 61, 90, 61, 63, 64, steps=30, sure=29)
SURE = wrong(STAYS)
HOW = "wrong from step 61, noticed without truth at step 63, declared lost at step 64"


@pytest.mark.parametrize(
    ("verdict", "line"),
    [
        (RunVerdict(), "No step yet."),
        (GOOD, "The filter was right at every step: 4.0 in off on average, 9.0 in at most (step 41)."),
        (
            replace(
                GOOD,
                odometry_alone=OdometryAlone(
                    INCH_M, 2 * INCH_M, ErrorDifference(3 * INCH_M, (0.01, 0.1), 2, 87, 9, 78)
                ),
            ),
            "The camera made it worse: 4.0 in off on average, 1.0 in by odometry alone. "
            "The filter was right at every step: 4.0 in off on average, 9.0 in at most (step 41).",
        ),
        (
            BACK,
            "The robot was kidnapped at step 61. The filter was wrong from step 61, localized again from "
            "step 63 on, after 100 fresh particles up to step 62.",
        ),
        (
            SURE,
            f"The robot was kidnapped at step 61. The filter was {HOW}, still lost at the end (81.0 in off), "
            "sure of a wrong place.",
        ),
        (
            wrong(
                Episode("lost", 38, 49, 38, 37, 41, 50),
                Episode("lost", 70, 90, 70, lost=73),
                left_map=(77, 78),
            ),
            "The filter was wrong from step 38, doubted without truth at step 37, declared lost at step 41, "
            "localized again from step 50 on; then it was wrong from step 70, declared lost at step 73, "
            "still lost at the end (81.0 in off). No particle was left on the map at steps 77 and 78, so the "
            "cloud was kept in place.",
        ),
        (replace(GOOD, off=2), "The filter was never lost: 4.0 in off on average, 9.0 in at most (step 41)."),
        (
            replace(GOOD, off=2, beyond=1),
            "The filter was beyond the lost radius at 1 step, but never at four in a row: "
            "4.0 in off on average, 9.0 in at most (step 41).",
        ),
        (
            replace(GOOD, left_map=(25,), in_obstacles=BOTH),
            "The filter was right at every step: 4.0 in off on average, 9.0 in at most (step 41). "
            "The map has the sofa where the robot was at steps 20 to 27 and 1 more time, "
            "so no particle could be there: "
            "--set map.obstacles=movable allows it.",
        ),
        (
            RunVerdict(updates=9, converged_share=0.5),
            "The cloud was converged at 50% of the steps, and there is no truth to judge it by.",
        ),
        (
            RunVerdict(updates=3, has_truth=True, end=OFF),
            "The filter was not localized in 3 steps (81.0 in off at the end).",
        ),
        (
            replace(GOOD, found=53),
            "The filter was localized from step 53 on, and right at the end (2.0 in off).",
        ),
    ],
)
def test_one_run_in_one_line(verdict, line):
    assert say_verdict(verdict, INCHES) == line


def test_several_runs_share_the_kidnapping():
    line = verdict_line({"robust": BACK, "thesis": SURE}, INCHES)
    assert line == (
        "The robot was kidnapped at step 61. `robust` was wrong from step 61, localized again from step 63 "
        f"on, after 100 fresh particles up to step 62; `thesis` was {HOW}, still lost at the end "
        "(81.0 in off), sure of a wrong place."
    )


def test_runs_of_different_drives_do_not():
    line = verdict_line({"a": BACK, "b": GOOD}, INCHES)
    assert line.startswith(
        "`a` was kidnapped at step 61, wrong from step 61, localized again from step 63 on"
    )


def test_the_words_of_the_end_agree_with_the_radii():
    near, between = StepScore(0.1, 0.1, True, True, False), StepScore(0.6, 0.1, True, False, False)
    turned = StepScore(0.1, 1.6, True, False, True)
    for end, words in (
        (near, "right at the end, but not localized again (3.9 in off)"),
        (between, "neither right nor lost at the end (23.6 in off)"),
        (turned, "still lost at the end (3.9 in and 92 deg off)"),
    ):
        assert f"declared lost at step 64, {words}" in say_verdict(wrong(STAYS, end=end), INCHES)


def test_a_sure_run_is_said_to_lack_particles_only_where_it_did_at_that_step():
    for bereft, end in ((True, ", with no particle near."), (False, ".")):
        worst = SureAndWrong(70, 50 * INCH_M, 0.97, bereft)
        run = wrong(Episode("lost", 61, 90, 61, lost=64, steps=30, sure=29, bereft=20), sure_and_wrong=worst)
        line = "sure of a wrong place: at step 70, 97% of the weight lay 50.0 in from the truth"
        assert f"{line}{end}" in say_verdict(run, INCHES)


SEARCH = Episode("searching", 1, 90, lost=4, steps=90, sure=60, bereft=80)
DIED = Failure(
    PROPOSAL, 10, SEARCH, {"ever": "yes", "held_until": 9, "died": 10, "nearest_m": 1.0, "particles": 150}
)


def test_the_cause_of_a_failure_is_the_why_of_the_verdict():
    run = wrong(SEARCH, failures=(DIED,))
    says = "the last particle at the true place died at step 10, and no other came there"
    assert f"(81.0 in off at the end). Why: {says}." in say_verdict(run, INCHES)
    assert f"(81.0 in off at the end) ({says})" in verdict_line({"a": run, "b": GOOD}, INCHES)


@pytest.mark.parametrize(
    ("kind", "evidence", "says"),
    [
        (
            PROPOSAL,
            {"ever": "late", "came": 9},
            "no particle with any weight was at the true place before step 9",
        ),
        (
            AMBIGUITY,
            {"rival_x_m": 0.0, "rival_y_m": 1.0, "pictures": 9},
            "another place looks like the true one in 9 pictures, at 0.0 in, 39.4 in: "
            "the cloud never decided",
        ),
    ],
)
def test_a_search_without_an_end_is_explained(kind, evidence, says):
    failure = Failure(kind, 1, SEARCH, {"nearest_m": 1.0, "particles": 150, **evidence})
    assert say_cause(failure, INCHES) == says


def test_what_befell_the_robot_is_not_told_twice():
    carried = Failure(KIDNAPPED, 61, STAYS, {"moved_m": 2.0})
    run = wrong(STAYS, failures=(carried,))
    assert "Why" not in say_verdict(run, INCHES)


TWINS = Ambiguity(3, 3, 5, (0.47, 0.38), 64 * INCH_M, 2)


def test_two_places_that_look_alike_have_a_sentence_of_their_own():
    run = replace(GOOD, found=9, ambiguity=TWINS)
    places = "wo places looked alike at step 3: 47% of the weight at one, 38% at the other, 64.0 in away"
    found = "was localized from step 9 on, and right at the end (2.0 in off)"
    assert say_verdict(run, INCHES) == f"T{places}; the truth is in the second. The filter {found}."
    alike = replace(run, ambiguity=replace(TWINS, fits=(0.81, 0.82), usual=0.48))
    fits = "; both fit about as well (q 0.81 and 0.82; a typical place 0.48)"
    assert fits in say_verdict(alike, INCHES)
    parted = replace(run, ambiguity=replace(TWINS, fits=(0.81, 0.62), usual=0.48))
    assert "about as well" not in say_verdict(parted, INCHES)
    line = verdict_line({"a": run, "b": GOOD}, INCHES)
    assert line.startswith(
        f"`a`: t{places}; the truth is in the second; it {found}; `b` was right at every step:"
    )


def test_runs_without_truth_are_told_by_name():
    blind = RunVerdict(updates=9, converged_share=0.5)
    line = "the cloud was converged at 50% of the steps, and there is no truth to judge it by"
    assert verdict_line({"a": blind, "b": blind}, INCHES) == f"`a`: {line}; `b`: {line}."


def test_without_truth_the_verdict_says_where_it_was_probably_lost_and_shows_that_step():
    failures = tuple(
        Failure(KIDNAPPED, k, Episode(PROBABLY_LOST, k, k + 9, noticed=k), truth_known=False) for k in (5, 20)
    )
    blind = RunVerdict(updates=40, converged_share=0.5, failures=failures, left_map=(30,))
    text = say_verdict(blind, INCHES)
    assert "it was probably lost from step 5 to 14, and 1 more time: the pictures from step 5 on" in text
    assert "fit other places, as after a kidnapping (without ground truth)." in text
    assert blind.decisive == 5


def test_bins_that_cost_most_have_names():
    evidence = {"behind_nats": 5.0, "channel": "color", "rank": 40, "references": 600, "pictures": 9}
    evidence |= {"of_pictures": 10, "elements": "1, 2, 28", "of_elements": 84, "elements_share": 0.413}
    text = say_cause(Failure(SENSOR, 1, SEARCH, evidence), INCHES)
    assert "most by color, 41% of it in red 24 to 39 and green 16 to 23; the truth has rank 40 of 600" in text


def test_a_heading_that_no_reference_has_is_said_without_a_distance():
    evidence = {"none_looks_that_way": 4, "spacing_m": 0.4572, "updates": 5}
    assert say_cause(Failure(LIBRARY_GAP, 2, SEARCH, evidence), INCHES) == (
        "no reference looks the way that the robot did from step 2 on "
        "(at 4 of 5 steps; references are usually 18.0 in apart)"
    )
    evidence = {"to_reference_m": 1.0, "none_looks_that_way": 1, "spacing_m": 0.4572, "updates": 5}
    assert say_cause(Failure(LIBRARY_GAP, 2, SEARCH, evidence), INCHES) == (
        "the library has no reference near the true place from step 2 on "
        "(39.4 in to the nearest, usually 18.0 in apart)"
    )
