from __future__ import annotations

from dataclasses import replace

import pytest

from helpers import expect_facts
from maurice_mcl.reasons.causes import (
    AMBIGUITY,
    CARRIED,
    KIDNAPPED,
    LIBRARY_GAP,
    PROPOSAL,
    SENSOR,
    UNKNOWN,
    Failure,
    Incident,
    InObstacle,
)
from maurice_mcl.reasons.verdict import Ambiguity, RunVerdict, SureAndWrong
from maurice_mcl.scoring.comparison import ErrorDifference, OdometryAlone
from maurice_mcl.scoring.episodes import PROBABLY_LOST, Episode
from maurice_mcl.scoring.metrics import StepScore
from maurice_viz.style import UNITS, Scale
from maurice_viz.text.causes import say_cause
from maurice_viz.text.verdict import say_verdict, verdict_line

INCHES = Scale(UNITS["in"])
INCH_M = 0.0254
NEAR, OFF = (StepScore(2 * INCH_M, 0.1, True, True, False), StepScore(81 * INCH_M, 0.1, True, False, True))
ERRORS = {"error_mean_m": 4 * INCH_M, "error_most_m": 9 * INCH_M, "most_at": 41, "end": NEAR}
GOOD = RunVerdict(updates=90, has_truth=True, localized=1, first=1, **ERRORS)


def wrong(*episodes, end=OFF, **more):
    carried = tuple(Incident(CARRIED, one.first, one.first) for one in episodes if one.kind == "kidnapped")
    facts = {"updates": 90, "has_truth": True, "localized": 1, "first": 1, "last": 90, "incidents": carried}
    return RunVerdict(**facts, end=end, episodes=episodes, **more)


BOTH = InObstacle("sofa", 20, 27), InObstacle("desk", 40, 40)
BACK = wrong(Episode("kidnapped", 61, 62, 61, localized=63, steps=2, fresh=100, sure=1))
STAYS = Episode("kidnapped", 61, 90, 61, 63, 64, steps=30, sure=29)
SURE = wrong(STAYS)
HOW = "wrong from step 61", "noticed without truth at step 63", "declared lost at step 64"


RIGHT = "right at every step", "4.0 in off", "9.0 in", "step 41"
CAMERA = OdometryAlone(INCH_M, 2 * INCH_M, ErrorDifference(3 * INCH_M, (0.01, 0.1), 2, 87, 9, 78))
TWICE = Episode("lost", 38, 49, 38, 37, 41, 50), Episode("lost", 70, 90, 70, lost=73)


@pytest.mark.parametrize(
    ("verdict", "facts"),
    [
        (RunVerdict(), ["No step"]),
        (GOOD, RIGHT),
        (replace(GOOD, odometry_alone=CAMERA), ["camera", "worse", "4.0 in", "1.0 in by odometry", *RIGHT]),
        (BACK, ["kidnapped at step 61", HOW[0], "localized again", "step 63", "100 fresh", "step 62"]),
        (SURE, ["kidnapped at step 61", *HOW, "still lost at the end", "81.0 in", "sure of a wrong place"]),
        (
            wrong(*TWICE, left_map=(77, 78)),
            ["wrong from step 38", "doubted without truth at step 37", "lost at step 41", "from step 50",
             "wrong from step 70", "lost at step 73", "still lost at the end", "81.0 in",
             "No particle", "steps 77 and 78"],
        ),
        (replace(GOOD, off=2), ["never lost", *RIGHT[1:]]),
        (replace(GOOD, off=2, beyond=1), ["beyond the lost radius at 1 step", "never at four", *RIGHT[1:]]),
        (
            replace(GOOD, left_map=(25,), in_obstacles=BOTH),
            [*RIGHT, "the sofa", "steps 20 to 27", "1 more time", "--set map.obstacles=movable"],
        ),
        (RunVerdict(updates=9, converged_share=0.5), ["converged at 50%", "no truth"]),
        (
            RunVerdict(updates=3, has_truth=True, end=OFF, off=3, beyond=3),
            ["never localized", "81.0 in", "at 3 steps"],
        ),
        (replace(GOOD, unjudged=GOOD.updates - 3), ["right at each of the 3 steps with a true pose"]),
        (replace(GOOD, localized=53), ["localized from step 53", "right at the end", "2.0 in"]),
    ],
)  # fmt: skip
def test_one_run_in_one_line(verdict, facts):
    line = say_verdict(verdict, INCHES)
    expect_facts(line, *facts)
    assert line[0].isupper()
    assert line.endswith(".")
    assert "\n" not in line


def test_several_runs_share_the_kidnapping():
    line = verdict_line({"robust": BACK, "thesis": SURE}, INCHES)
    assert line.count("kidnapped at step 61") == 1
    expect_facts(line, "kidnapped", "`robust`", HOW[0], "step 63", "100 fresh", "`thesis`", *HOW, "81.0 in")


def test_runs_of_different_drives_do_not():
    line = verdict_line({"a": BACK, "b": GOOD}, INCHES)
    expect_facts(line, "`a`", "kidnapped at step 61", HOW[0], "localized again", "step 63", "`b`", "right")


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
    for bereft in (True, False):
        worst = SureAndWrong(70, 50 * INCH_M, 0.97, bereft)
        run = wrong(Episode("lost", 61, 90, 61, lost=64, steps=30, sure=29, bereft=20), sure_and_wrong=worst)
        line = say_verdict(run, INCHES)
        expect_facts(line, "sure of a wrong place", "step 70", "97% of the weight", "50.0 in")
        assert ("no particle near" in line) is bereft


SEARCH = Episode("searching", 1, 90, lost=4, steps=90, sure=60, bereft=80)
DIED = Failure(
    PROPOSAL, 10, SEARCH, {"ever": "yes", "held_until": 9, "died": 10, "nearest_m": 1.0, "particles": 150}
)


def test_the_cause_of_a_failure_is_the_why_of_the_verdict():
    run = replace(wrong(SEARCH, failures=(DIED,)), localized=None, off=90)
    for line in (say_verdict(run, INCHES), verdict_line({"a": run, "b": GOOD}, INCHES)):
        expect_facts(line, "81.0 in off at the end", say_cause(DIED, INCHES))
    expect_facts(say_cause(DIED, INCHES), "last particle", "died at step 10")


@pytest.mark.parametrize(
    ("kind", "evidence", "facts"),
    [
        (PROPOSAL, {"ever": "late", "came": 9}, ["no particle", "before step 9"]),
        (
            AMBIGUITY,
            {"rival_x_m": 0.0, "rival_y_m": 1.0, "pictures": 9},
            ["another place looks like the true one", "9 pictures", "x 0.0 in, y 39.4 in", "never decided"],
        ),
    ],
)
def test_a_search_without_an_end_is_explained(kind, evidence, facts):
    failure = Failure(kind, 1, SEARCH, {"nearest_m": 1.0, "particles": 150, **evidence})
    expect_facts(say_cause(failure, INCHES), *facts)


def test_what_befell_the_robot_is_not_told_twice():
    carried = Failure(KIDNAPPED, 61, STAYS, {"moved_m": 2.0})
    run = wrong(STAYS, failures=(carried,))
    assert "Why" not in say_verdict(run, INCHES)


TWINS = Ambiguity(3, 3, 5, (0.47, 0.38), 64 * INCH_M, 2)


def test_two_places_that_look_alike_have_a_sentence_of_their_own():
    run = replace(GOOD, localized=9, ambiguity=TWINS)
    places = "wo places looked alike at step 3", "47%", "38%", "64.0 in", "truth is in the second"
    ends = "localized from step 9", "right at the end", "2.0 in"
    expect_facts(say_verdict(run, INCHES), *places, *ends)
    alike = replace(run, ambiguity=replace(TWINS, fits=(0.81, 0.82), usual=0.48))
    expect_facts(say_verdict(alike, INCHES), "about as well", "0.81 and 0.82", "0.48")
    parted = replace(run, ambiguity=replace(TWINS, fits=(0.81, 0.62), usual=0.48))
    assert "about as well" not in say_verdict(parted, INCHES)
    expect_facts(verdict_line({"a": run, "b": GOOD}, INCHES), "`a`", *places, ends[0], "`b`", "right")


def test_runs_without_truth_are_told_by_name():
    blind = RunVerdict(updates=9, converged_share=0.5)
    facts = "converged at 50%", "no truth"
    expect_facts(verdict_line({"a": blind, "b": blind}, INCHES), "`a`", *facts, "`b`", *facts)


def test_without_truth_the_verdict_says_where_it_was_probably_lost_and_shows_that_step():
    failures = tuple(
        Failure(UNKNOWN, k, Episode(PROBABLY_LOST, k, k + 9, noticed=k), truth_known=False) for k in (5, 20)
    )
    blind = RunVerdict(updates=40, converged_share=0.5, failures=failures, left_map=(30,))
    text = say_verdict(blind, INCHES)
    expect_facts(text, "probably lost", "step 5 to 14", "1 more time", "not known", "without ground truth")
    assert blind.decisive == 5


def test_bins_that_cost_most_have_names():
    evidence = {"behind_nats": 5.0, "channel": "color", "rank": 40, "references": 600, "pictures": 9}
    evidence |= {"of_pictures": 10, "elements": "1, 2, 28", "of_elements": 84, "elements_share": 0.413}
    text = say_cause(Failure(SENSOR, 1, SEARCH, evidence), INCHES)
    expect_facts(text, "color", "41%", "red 24 to 39", "green 16 to 23", "rank 40 of 600")


def test_a_heading_that_no_reference_has_is_said_without_a_distance():
    evidence = {"none_looks_that_way": 4, "spacing_m": 0.4572, "updates": 5}
    text = say_cause(Failure(LIBRARY_GAP, 2, SEARCH, evidence), INCHES)
    expect_facts(text, "no reference looks the way", "step 2", "4 of 5 steps", "18.0 in")
    evidence = {"to_reference_m": 1.0, "none_looks_that_way": 1, "spacing_m": 0.4572, "updates": 5}
    text = say_cause(Failure(LIBRARY_GAP, 2, SEARCH, evidence), INCHES)
    expect_facts(text, "no reference near the true place", "step 2", "39.4 in", "18.0 in")
