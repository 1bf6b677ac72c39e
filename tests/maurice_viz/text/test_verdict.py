from __future__ import annotations

from dataclasses import replace

import pytest

from maurice_mcl.analysis.dead_reckoning import OdometryAlone
from maurice_mcl.analysis.failures.ambiguity import Ambiguity
from maurice_mcl.analysis.failures.causes import InObstacle
from maurice_mcl.analysis.failures.kinds import AMBIGUITY, KIDNAPPED, LIBRARY_GAP, PROPOSAL, SENSOR, Failure
from maurice_mcl.analysis.failures.verdict import RunVerdict, SureAndWrong, Trouble
from maurice_mcl.analysis.run_comparison import ErrorDifference
from maurice_viz.style import UNITS, Scale
from maurice_viz.text.failure import say_cause
from maurice_viz.text.verdict import said, verdict_line

INCHES = Scale(UNITS["in"])
INCH_M = 0.0254
GOOD = RunVerdict(
    updates=90,
    has_truth=True,
    found=1,
    first=1,
    error_mean_m=4 * INCH_M,
    error_end_m=2 * INCH_M,
    error_most_m=9 * INCH_M,
    most_at=41,
)


def troubled(*troubles, **more):
    return RunVerdict(
        updates=90, has_truth=True, found=1, first=1, error_end_m=81 * INCH_M, troubles=troubles, **more
    )


BOTH = InObstacle("sofa", 20, 27), InObstacle("desk", 40, 40)
BACK = troubled(Trouble("kidnapped", 61, 63, True, 100, 2, 1))
SURE = troubled(Trouble("kidnapped", 61, None, True, 0, 30, 29))


@pytest.mark.parametrize(
    ("verdict", "line"),
    [
        (RunVerdict(), "No update yet."),
        (GOOD, "The robot stayed localized: 4.0 in off on average, 9.0 in at most (step 41)."),
        (
            replace(
                GOOD,
                odometry_alone=OdometryAlone(
                    INCH_M, 2 * INCH_M, ErrorDifference(3 * INCH_M, (0.01, 0.1), 2, 87, 9, 78)
                ),
            ),
            "The camera made it worse: 4.0 in off on average, 1.0 in by odometry alone. "
            "The robot stayed localized: 4.0 in off on average, 9.0 in at most (step 41).",
        ),
        (BACK, "The robot was kidnapped at 61. It found itself at 63 by 100 fresh particles."),
        (
            SURE,
            "The robot was kidnapped at 61. It stayed lost, sure of a wrong place (81.0 in off at the end).",
        ),
        (
            troubled(Trouble("kidnapped", 88)),
            "The robot was kidnapped at 88. It did not find itself again (81.0 in off at the end).",
        ),
        (
            troubled(Trouble("lost", 38, 50, True), Trouble("lost", 70, None, True), left_map=(77, 78)),
            "The robot went wrong at 38 and found itself at 50, then went wrong at 70 and stayed lost "
            "(81.0 in off at the end). No particle was left on the map at 77 and 78, so the cloud was kept "
            "in place.",
        ),
        (
            replace(GOOD, left_map=(25,), in_obstacles=BOTH),
            "The robot stayed localized: 4.0 in off on average, 9.0 in at most (step 41). "
            "The map has the sofa where the robot was from 20 to 27 and 1 more time, "
            "so no particle could be there: "
            "--set map.obstacles=movable allows it.",
        ),
        (
            RunVerdict(updates=9, converged_share=0.5),
            "The cloud was converged in 50% of the updates, and there is no truth to judge it by.",
        ),
        (
            RunVerdict(updates=9, has_truth=True, error_end_m=81 * INCH_M),
            "The robot was never localized "
            "(81.0 in off at the end, wrong and confident in 0% of the updates).",
        ),
    ],
)
def test_one_run_in_one_line(verdict, line):
    assert said(verdict, INCHES) == line


def test_several_runs_share_the_kidnapping():
    line = verdict_line({"robust": BACK, "thesis": SURE}, INCHES)
    assert line == (
        "The robot was kidnapped at 61. `robust` found itself at 63 by 100 fresh particles; "
        "`thesis` stayed lost, sure of a wrong place (81.0 in off at the end)."
    )


def test_runs_of_different_drives_do_not():
    assert verdict_line({"a": BACK, "b": GOOD}, INCHES).startswith("`a` was kidnapped at 61 and found itself")


def test_a_sure_run_is_said_to_lack_particles_only_where_it_did_at_that_step():
    for bereft, end in ((True, ", with no particle near (81.0 in off"), (False, " (81.0 in off")):
        worst = SureAndWrong(70, 50 * INCH_M, 0.97, bereft)
        run = troubled(Trouble("lost", 61, None, True, 0, 30, 29, 20), sure_and_wrong=worst)
        line = "sure of a wrong place: at step 70, 97% of the weight lay 50.0 in from the truth"
        assert f"{line}{end}" in said(run, INCHES)


DIED = Failure(
    PROPOSAL, 10, 90, 20, {"ever": "yes", "held_until": 9, "died": 10, "nearest_m": 1.0, "particles": 150}
)


def test_the_cause_of_a_failure_is_the_why_of_the_verdict():
    run = troubled(Trouble("searching", 20, None, True, 0, 30, 29, 29), failures=(DIED,))
    says = "the last particle at the true place died at 10, and no other came there"
    assert f"(81.0 in off at the end). Why: {says}." in said(run, INCHES)
    assert f"(81.0 in off at the end) ({says})" in verdict_line({"a": run, "b": GOOD}, INCHES)


@pytest.mark.parametrize(
    ("kind", "evidence", "says"),
    [
        (PROPOSAL, {"ever": "late", "came": 9}, "no particle with any weight was at the true place before 9"),
        (
            AMBIGUITY,
            {"rival_x_m": 0.0, "rival_y_m": 1.0, "pictures": 9},
            "another place looks like the true one in 9 pictures, at 0.0 in, 39.4 in: "
            "the cloud never decided",
        ),
    ],
)
def test_a_search_without_an_end_is_explained(kind, evidence, says):
    failure = Failure(kind, 1, 90, 1, {"nearest_m": 1.0, "particles": 150, **evidence})
    assert say_cause(failure, INCHES) == says


def test_what_befell_the_robot_is_not_told_twice():
    carried = Failure(KIDNAPPED, 61, 90, 61, {"moved_m": 2.0})
    run = troubled(Trouble("kidnapped", 61, None, True, 0, 30, 29, 29), failures=(carried,))
    assert "Why" not in said(run, INCHES)


TWINS = Ambiguity(3, 3, 5, (0.47, 0.38), 64 * INCH_M, 2)


def test_two_places_that_look_alike_have_a_sentence_of_their_own():
    run = replace(GOOD, found=9, ambiguity=TWINS)
    places = "wo places looked alike at 3: 47% of the weight at one, 38% at the other, 64.0 in away"
    found = "found itself at 9 and stayed localized (2.0 in off at the end)"
    assert said(run, INCHES) == f"T{places}; the truth is in the second. The robot {found}."
    alike = replace(run, ambiguity=replace(TWINS, fits=(0.81, 0.82), usual=0.48))
    fits = "; both fit about as well (q 0.81 and 0.82; a typical place 0.48)"
    assert fits in said(alike, INCHES)
    parted = replace(run, ambiguity=replace(TWINS, fits=(0.81, 0.62), usual=0.48))
    assert "about as well" not in said(parted, INCHES)
    line = verdict_line({"a": run, "b": GOOD}, INCHES)
    assert line.startswith(f"`a`: t{places}; the truth is in the second; it {found}; `b` stayed localized:")


def test_runs_without_truth_are_told_by_name():
    blind = RunVerdict(updates=9, converged_share=0.5)
    line = "the cloud was converged in 50% of the updates, and there is no truth to judge it by"
    assert verdict_line({"a": blind, "b": blind}, INCHES) == f"`a`: {line}; `b`: {line}."


def test_without_truth_the_verdict_says_where_it_was_probably_lost_and_shows_that_step():
    failures = tuple(Failure(KIDNAPPED, k, k + 9, k, truth_known=False) for k in (5, 20))
    blind = RunVerdict(updates=40, converged_share=0.5, failures=failures, left_map=(30,))
    assert (
        "no truth to judge it by; it was probably lost from 5 to 14, and 1 more time: the pictures from 5 on "
        "fit other places, as after a kidnapping (without ground truth)." in said(blind, INCHES)
    )
    assert blind.decisive == 5


def test_bins_that_cost_most_have_names():
    evidence = {"behind_nats": 5.0, "channel": "color", "rank": 40, "references": 600, "pictures": 9}
    evidence |= {"of_pictures": 10, "elements": "1, 2, 28", "of_elements": 84, "elements_share": 0.413}
    text = say_cause(Failure(SENSOR, 1, 9, 1, evidence), INCHES)
    assert "most by color, 41% of it in red 24 to 39 and green 16 to 23; the truth has rank 40 of 600" in text


def test_a_heading_that_no_reference_has_is_said_without_a_distance():
    evidence = {"none_looks_that_way": 4, "spacing_m": 0.4572, "updates": 5}
    assert say_cause(Failure(LIBRARY_GAP, 2, 9, 4, evidence), INCHES) == (
        "no reference looks the way that the robot did from 2 on "
        "(at 4 of 5 updates; references are usually 18.0 in apart)"
    )
    evidence = {"to_reference_m": 1.0, "none_looks_that_way": 1, "spacing_m": 0.4572, "updates": 5}
    assert say_cause(Failure(LIBRARY_GAP, 2, 9, 4, evidence), INCHES) == (
        "the library has no reference near the true place from 2 on "
        "(39.4 in to the nearest, usually 18.0 in apart)"
    )
