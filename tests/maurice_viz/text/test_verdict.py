from __future__ import annotations

from dataclasses import replace

import pytest

from helpers import expect_facts
from maurice_mcl.reasons.causes import (
    AMBIGUITY,
    CARRIED,
    DARK,
    KIDNAPPED,
    LIBRARY_GAP,
    MOTION,
    PROPOSAL,
    SENSOR,
    UNKNOWN,
    Failure,
    Incident,
    InObstacle,
)
from maurice_mcl.reasons.verdict import Ambiguity, RunVerdict, SureAndWrong
from maurice_mcl.scoring.episodes import Episode
from maurice_mcl.scoring.metrics import StepScore
from maurice_mcl.scoring.table import PROBABLY_LOST, SEARCHING, Standing
from maurice_viz.style import UNITS, Scale
from maurice_viz.text.causes import say_cause
from maurice_viz.text.verdict import account, headline

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


TWICE = Episode("lost", 38, 49, 38, 37, 41, 50), Episode("lost", 70, 90, 70, lost=73)
SEARCH = Episode("searching", 1, 90, lost=4, steps=90, sure=60, bereft=80)
DIED = Failure(
    PROPOSAL, 10, SEARCH, {"ever": "yes", "held_until": 9, "died": 10, "nearest_m": 1.0, "particles": 150}
)


def unknown(*episodes):
    return tuple(Failure(UNKNOWN, episode.onset, episode) for episode in episodes)


@pytest.mark.parametrize(
    ("verdict", "sentences"),
    [
        (RunVerdict(), []),
        (GOOD, []),
        (BACK, [["Kidnapped", "step 61"]]),
        (
            replace(SURE, failures=unknown(STAYS)),
            [["Kidnapped", "step 61"], [*HOW, "not localized again", "not explained"]],
        ),
        (
            wrong(*TWICE, left_map=(77, 78), failures=unknown(*TWICE)),
            [
                ["Wrong from step 38", "doubted without truth at step 37", "lost at step 41", "from step 50"],
                ["Wrong from step 70", "lost at step 73"],
                ["No particle", "steps 77 and 78"],
            ],
        ),
        (
            replace(GOOD, left_map=(25,), in_obstacles=BOTH),
            [["the sofa", "steps 20 to 27", "1 more time", "--set map.obstacles=movable"]],
        ),
        (
            replace(wrong(SEARCH, failures=(DIED,)), localized=None, off=90),
            [["last particle", "died at step 10"]],
        ),
    ],
)
def test_each_event_has_a_sentence(verdict, sentences):
    lines = account({"robust": verdict}, INCHES)
    assert len(lines) == len(sentences)
    for line, facts in zip(lines, sentences, strict=True):
        expect_facts(line.casefold(), *(fact.casefold() for fact in facts))
        assert line[0].isupper()
        assert line.endswith(".")


def test_what_befell_the_robot_is_told_once_and_what_a_run_did_by_its_name():
    twins = replace(GOOD, failures=unknown(STAYS), incidents=SURE.incidents)
    lines = account({"a": twins, "b": replace(GOOD, incidents=SURE.incidents)}, INCHES)
    assert [line[:4] for line in lines] == ["The ", "`a`:"]


JUMP = {"jump_m": 0.4, "within_s": 0.5}
WAY = 76.7 * INCH_M


@pytest.mark.parametrize(
    ("kind", "evidence"),
    [
        (KIDNAPPED, {"moved_m": WAY, "driven_m": 0.1}),
        (MOTION, JUMP),  # at the same step, by which it is told why the run was lost
        (UNKNOWN, {}),
    ],
)
def test_how_far_the_robot_was_carried_is_told_once_whatever_the_cause_is(kind, evidence):
    failures = (Failure(kind, STAYS.onset, STAYS, evidence),)
    lost = replace(SURE, failures=failures, incidents=(Incident(CARRIED, 61, 61, None, WAY),))
    for verdicts in ({"a": lost}, {"a": lost, "b": replace(lost, failures=(), episodes=())}):
        text = " ".join(account(verdicts, INCHES))
        assert text.count("carried 76.7 in") == text.count("unseen by its odometry") == 1


def test_how_far_the_robot_was_carried_is_not_said_where_no_truth_tells():
    (line,) = account({"a": replace(BACK, incidents=(Incident(CARRIED, 61, 61),))}, INCHES)
    assert line == "The robot was kidnapped at step 61 (as the log says)."


def test_in_the_dark_a_run_is_told_whose_references_score_alike():
    dark = Incident(DARK, 10, 30, 59.0, 28.0)
    runs = {"a": replace(GOOD, incidents=(dark,)), "b": replace(GOOD, incidents=(replace(dark, alike=True),))}
    told, alike = account(runs, INCHES)
    expect_facts(told, "dark at step 10", "59 before", "28 since")
    assert alike == "`b`: In the dark all reference pictures score alike."


def test_a_sure_run_lacks_particles_only_where_it_did_at_that_step():
    for bereft in (True, False):
        worst = SureAndWrong(70, 50 * INCH_M, 0.97, bereft)
        run = wrong(Episode("lost", 61, 90, 61, lost=64, steps=30, sure=29, bereft=20), sure_and_wrong=worst)
        (line,) = account({"a": run}, INCHES)
        expect_facts(line, "Sure of a wrong place", "step 70", "97% of the weight", "50.0 in")
        assert ("no particle near" in line) is bereft


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


TWINS = Ambiguity(3, 3, 5, (0.47, 0.38), 64 * INCH_M, 2)


def test_two_places_that_look_alike_have_a_sentence_of_their_own():
    run = replace(GOOD, localized=9, ambiguity=TWINS)
    places = "Two places looked alike at step 3", "47%", "38%", "64.0 in", "truth is in the second"
    expect_facts(*account({"a": run}, INCHES), *places)
    alike = replace(run, ambiguity=replace(TWINS, fits=(0.81, 0.82), usual=0.48))
    expect_facts(*account({"a": alike}, INCHES), "about as well", "0.81 and 0.82", "0.48")
    parted = replace(run, ambiguity=replace(TWINS, fits=(0.81, 0.62), usual=0.48))
    assert "about as well" not in account({"a": parted}, INCHES)[0]


def test_without_truth_the_account_says_where_it_was_probably_lost_and_shows_that_step():
    failures = tuple(
        Failure(UNKNOWN, k, Episode(PROBABLY_LOST, k, k + 9, noticed=k), truth_known=False) for k in (5, 20)
    )
    blind = RunVerdict(updates=40, converged_share=0.5, failures=failures, left_map=(30,))
    first, second, _ = account({"a": blind}, INCHES)
    expect_facts(first, "Probably lost", "step 5 to 14", "not known", "without ground truth")
    expect_facts(second, "Probably lost", "step 20 to 29")
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


def test_a_run_that_may_be_at_several_places_says_so():
    torn = RunVerdict(updates=40, converged_share=1.0, now=Standing(SEARCHING, 12, places=3))
    said = headline({"laser": torn}, INCHES)
    assert said.startswith("The filter ended at one of 3 places that its scans cannot tell apart")
