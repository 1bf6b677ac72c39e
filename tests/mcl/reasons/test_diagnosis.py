"""Each rule of a diagnosis, on runs that are healthy but for what the rule is about."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from helpers.lost_runs import ALL, GONE, LOST_AT, OFF, RIGHT, SINCE, UPDATES, stories
from helpers.lost_runs import healthy as healthy_run
from maurice_mcl.reasons.causes import CAUSES, INCIDENTS
from maurice_mcl.reasons.evidence import Surprise
from maurice_mcl.reasons.rules import decide, suspected
from maurice_mcl.reasons.surroundings import LightFit, PlaceFit, UsualFit
from maurice_mcl.scoring.metrics import StepScore
from maurice_mcl.scoring.modes import NearTruth
from maurice_mcl.sensor.laser.fit import ScanFit
from maurice_viz.style import Scale, units_named
from maurice_viz.text.causes import say_cause

METERS = Scale(units_named("m"))

UNSURE, BLIND = StepScore(0.1, 0.0, False, True, False), StepScore(None, None, True, None, None)
FITS = PlaceFit(0.8, -1.0, 0.0, 2, 600, 0, (3.0, 3.0), "color", 0.1)
POOR = replace(FITS, cost=4.0, behind=5.0, estimate_behind=4.0, rank=200, costliest="tiny", costs=3.0)
LIT = LightFit(0.02, 100.0, 98.0, 0.8, -1.0)
DIM = replace(LIT, ratio=-0.5, cost=1.6)
USUAL = UsualFit(0.8, 0.05, {"color": 0.1, "tiny": 0.04})
FEW = NearTruth(3, (0.002, 0.004, 0.0), 0.1)
BUMP = Surprise(9, 3, 1)


def healthy(step, **changes):
    seen = {"outside": False, "reference_m": 0.2, "fit": FITS, "light": LIT, "alike": 0.7}
    return healthy_run(step, **(seen | changes))


def decided(updates):
    """Diagnose a run that is lost once."""
    (story,) = stories(updates)
    return decide(replace(story, spacing_m=0.45, usual=USUAL))


def indexes(updates):
    return [(story.lost, story.end, story.since) for story in stories(updates)]


def failure_of(changes, steps):
    """Diagnose a run that is lost from 11 on, with something else at some steps."""
    return decided([healthy(step, **(changes if step in steps else {})) for step in ALL])


FAR, FARTHER = Surprise(30, 3, 1), Surprise(50, 3, 1)
CASES = {
    "a gap": ("data", {"after_s": 60.0, "moved_m": 1.6, "surprise": BUMP}, [10]),
    "equal pictures": ("data", {"repeated": True}, range(8, 14)),
    "cloud off the map": (
        "left_map",
        {"cloud_left": True, "driven_m": 1.0, "surprise": Surprise(99, 0, 0)},
        [10],
    ),
    "odometry jumps off the map": (
        "motion",
        {"cloud_left": True, "driven_m": 20, "surprise": Surprise(99, 0, 0)},
        [10],
    ),
    "truth off the map": ("left_map", {"outside": True}, range(9, 13)),
    "tilted": ("out_of_plane", {"tilt_deg": 22.0, "surprise": BUMP}, range(7, 14)),
    "odometry jumps": ("motion", {"driven_m": 9.0, "after_s": 1.0, "surprise": FARTHER}, [11]),
    "carried": ("kidnapped", {"moved_m": 3.0, "surprise": FARTHER}, [11]),
    "carried a little": ("kidnapped", {"moved_m": 0.95, "surprise": FAR}, [11]),
    "pushed": ("motion", {"moved_m": 0.7, "surprise": Surprise(14, 3, 1)}, [11]),
    "faster than odometry says": ("motion", {"moved_m": 0.95, "surprise": FAR}, [10, 11]),
    "carried, as the log says": ("kidnapped", {"events": ("kidnapped",)}, [11]),
    "one movement": ("motion", {"surprise": Surprise(0.1, 0.3, -12.0)}, [10]),
    "many movements": ("motion", {"surprise": Surprise(0.1, 0.3, 3.0)}, range(7, 12)),
    "all zero": ("numeric", {"zero": True}, [10]),
    "no numbers": ("numeric", {"broken": True, "cloud_left": True}, range(9, 14)),
    "too sharp": ("numeric", {"spread_nats": 900.0, "ess": 1.0}, ALL),
    "no reference": ("library_gap", {"reference_m": 1.1, "fit": None}, range(9, 14)),
    "dark": ("lighting", {"fit": POOR, "light": DIM}, SINCE),
    "a thing that is darker": ("changed_view", {"fit": POOR, "light": DIM, "alike": 0.1}, SINCE),
    "too dark to see": (
        "lighting",
        {"fit": POOR, "light": replace(DIM, ratio=-2, cost=3.9), "alike": 0.0},
        SINCE,
    ),
    "dark, and edges are gone": ("lighting", {"fit": POOR, "light": replace(DIM, cost=3.9)}, SINCE),
    "a dead color": ("sensor", {"fit": POOR, "light": replace(DIM, cost=3.9, colors=-0.1)}, ALL),
    "a slip that the log tells": (
        "motion",
        {"surprise": Surprise(1, 0, 4.0), "events": ("slip 25 deg",)},
        [10],
    ),
    "people": ("changed_view", {"fit": POOR}, SINCE),
    "a channel": ("sensor", {"fit": POOR}, ALL),
    "twins": ("ambiguity", {"fit": replace(FITS, estimate_behind=0.1, rivals=1)}, ALL),
    "chance": ("resampling", {"near": FEW}, [11]),
    "chance, later": ("resampling", {"near": FEW}, [14]),
    "died out": ("impoverished", {}, []),
}


@pytest.mark.parametrize("name", CASES)
def test_each_cause_is_told_by_its_own_evidence(name):
    kind, changes, steps = CASES[name]
    found = failure_of(changes, steps)
    assert (found.kind, found.episode.onset, found.episode.last) == (kind, LOST_AT, UPDATES - 1), found.also
    if steps and kind not in ("ambiguity", "sensor", "numeric"):
        assert found.first == steps[0]


def test_a_jump_of_odometry_is_far_faster_than_it_ever_was():
    at = 11
    found = failure_of({"driven_m": 9.0, "moved_m": 0.3}, [at])
    assert (found.kind, found.first, found.evidence["jump_m"]) == ("motion", at, 9.0)
    fast = [healthy(step, driven_m=3.0, moved_m=3.0 if step != at else 0.3) for step in ALL]
    assert "jump_m" not in decided(fast).evidence  # wheels that spin go no faster than they do
    for unknown_s in (None, 0.0):  # before the first update, and where all stamps are equal
        untimed = failure_of({"driven_m": 9.0, "moved_m": 0.3, "after_s": unknown_s}, [at])
        assert "jump_m" not in untimed.evidence


def test_the_jump_of_a_recorded_estimate_is_told_and_no_cause_is_made_up():
    changes = {"surprise": None, "near": None, "fit": None, "scan": ScanFit(0.05)}
    updates = [healthy(step, **changes, **({"estimate_m": 5.0} if step == 11 else {})) for step in ALL]
    found = decided(updates)
    assert (found.kind, found.first) == ("unknown", 11)
    assert found.evidence == {"estimate_jump_m": 5.0, "driven_m": 0.3}
    assert "the estimate jumped 5.00 m at step 11, where odometry says 0.30 m" in say_cause(found, METERS)
    own = [healthy(step, **({"estimate_m": 5.0} if step == 11 else {})) for step in ALL]
    assert decided(own).kind == "impoverished"  # of a filter of ours more is known


@pytest.mark.parametrize(("nowhere", "told"), [(2, {"to_reference_m": 1.1}), (4, {})])
def test_a_heading_that_no_reference_has_is_counted_and_is_no_distance(nowhere, told):
    updates = [healthy(step) for step in range(1, UPDATES)]
    for at in range(8, 12):
        away = float("inf") if at - 8 < nowhere else 1.1
        updates[at] = replace(updates[at], reference_m=away, fit=None)
    found = decided(updates)
    assert found.kind == "library_gap"
    assert found.evidence == told | {"none_looks_that_way": nowhere, "spacing_m": 0.45, "updates": 4}


def test_a_kidnapping_is_named_and_what_follows_from_it_only_listed():
    found = failure_of({"moved_m": 3.0, "surprise": FARTHER}, [11])
    assert found.also[:1] == ("motion",)
    assert "impoverished" in found.also


@pytest.mark.parametrize(
    ("shares", "kind"), [((0.8, 0.01, 0.01), "library_gap"), ((0.01, 0.01, 0.01), "motion")]
)
def test_a_slip_where_the_library_has_a_gap_is_weighed_by_what_lost_the_truth(shares, kind):
    updates = [healthy(step, reference_m=1.1, fit=None) for step in ALL]
    updates[9] = replace(updates[9], surprise=Surprise(9, 0, 0), near=NearTruth(900, shares, 0.02))
    found = decided(updates)
    assert found.kind == kind
    assert {found.kind, *found.also} >= {"motion", "library_gap"}


def test_what_befalls_a_run_that_is_not_lost_is_no_failure():
    assert indexes([healthy(step, score=RIGHT, surprise=Surprise(9, 9, 9)) for step in range(1, 20)]) == []


def test_a_robot_that_is_carried_in_the_middle_of_a_search_is_no_reason_why_it_never_ended():
    """The way that it was carried is no movement by odometry; one that odometry missed is."""
    searching = StepScore(2.0, 0.0, False, False, True)
    for moved, is_motion in ((3.0, False), (0.7, True)):
        changes = {11: {"moved_m": moved, "surprise": FARTHER}}
        near = NearTruth(3, (0.9, 0.9, 0.9), 0.1)  # until late: all movements are looked at
        updates = [healthy(step, score=searching, near=near, **changes.get(step, {})) for step in ALL]
        found = decided(updates)
        assert ("motion" in (found.kind, *found.also)) == is_motion, found


def test_a_search_that_ends_well_is_no_failure_but_a_long_time_at_a_wrong_place_is():
    searching = StepScore(2.0, 0.0, False, False, True)

    def run(before):
        scores = [before] * 12 + [RIGHT] * 8
        return [healthy(k, score=score) for k, score in enumerate(scores, 1)]

    assert indexes(run(searching)) == []
    assert indexes(run(OFF)) == [(0, 11, 0)]
    assert indexes(run(searching)[:12]) == [(0, 11, 0)]


def searched(near, fit=FITS, score=UNSURE):
    """Diagnose a search that never was sure, with particles at the true place as told by step."""
    return decided([healthy(step, near=near(step), fit=fit, score=score) for step in ALL])


def test_a_search_that_kept_the_true_place_to_the_end_is_ambiguous_only_where_another_fits_as_well():
    half = NearTruth(400, (0.4, 0.5, 0.5), 0.02)
    assert searched(lambda step: half, replace(FITS, behind=-0.1)).kind == "ambiguity"
    assert searched(lambda step: half, replace(FITS, behind=-3.0)).kind == "unknown"


def test_in_a_search_the_last_particle_died_when_none_was_left_not_at_the_first_step():
    wrong = StepScore(2.0, 0.0, False, False, True)
    some = NearTruth(4, (0.004, 0.004, 0.004), 0.02)
    found = searched(lambda step: some if step < 5 else GONE, score=wrong)
    assert (found.kind, found.evidence["held_until"], found.evidence["died"]) == ("impoverished", 4, 5)
    late = searched(lambda step: GONE if step < 15 else some, score=wrong)
    assert (late.kind, late.evidence["ever"], late.evidence["came"]) == ("impoverished", "late", 15)


def test_the_elements_that_cost_most_are_named_of_the_pictures_that_blame_their_channel():
    costs = np.zeros(12, np.float32)
    costs[[2, 3, 9, 5]] = 3, 4, 2, 1
    found = failure_of({"fit": POOR, "elements": costs}, ALL)
    assert (found.kind, found.evidence["channel"]) == ("sensor", "tiny")
    assert (found.evidence["elements"], found.evidence["of_elements"]) == ("2, 3, 9", 12)
    assert found.evidence["elements_share"] == pytest.approx(0.9)
    assert "elements" not in failure_of({"fit": POOR}, ALL).evidence


LIBRARY = SimpleNamespace(usual=USUAL, levels=np.array([[90.0, 90, 90], [130, 130, 130]]))


def doubted(changes, around=LIBRARY):
    """Suspect why a run without truth is doubted from 16 on, with something else since then."""
    updates = [healthy(step, score=BLIND, near=None, fit=None, knows=0.9) for step in range(1, 30)]
    since = {"knows": 0.01} | changes
    some = [replace(update, **(since if update.step > 15 else {})) for update in updates]
    assert suspected(updates, ()) == ()
    (failure,) = suspected(some, ((16, 29),), around)
    return failure


@pytest.mark.parametrize(
    ("kind", "changes"),
    [
        ("lighting", {"cloud": -9.0, "best": -7.0, "gray": 40.0}),  # darker than any reference
        ("changed_view", {"cloud": -9.0, "best": -7.0}),
        ("unknown", {"cloud": -9.0, "gray": 40.0}),  # darker, and the library shows it
        ("unknown", {"cloud": -9.0}),  # carried, or slipped, or a wrong start
        ("numeric", {"broken": True}),
    ],
)
def test_without_truth_a_cause_is_named_only_where_the_whole_library_speaks_for_it(kind, changes):
    failure = doubted(changes)
    assert (failure.kind, failure.first, failure.truth_known) == (kind, 16, False)


def test_without_truth_one_picture_that_no_reference_shows_is_no_changed_view():
    updates = [healthy(step, score=BLIND, near=None, fit=None, knows=0.9) for step in range(1, 30)]
    updates[15] = replace(updates[15], knows=0.01, cloud=-9.0, best=-7.0)
    assert suspected(updates, ((16, 17),), LIBRARY)[0].kind == "unknown"


def test_without_truth_a_run_that_never_knew_where_it_is_has_what_its_weights_tell():
    updates = [healthy(k, score=BLIND, near=None, fit=None, knows=0.1, broken=True) for k in range(1, 30)]
    assert [failure.kind for failure in suspected(updates, ())] == ["numeric"]
    stuck = [replace(update, broken=False, repeated=True, knows=0.9) for update in updates]
    assert suspected(stuck, ()) == ()  # it knew all the same


def test_without_truth_it_began_where_the_signal_last_said_right_and_the_log_is_believed():
    def run(**changes):
        updates = [healthy(k, score=BLIND, near=None, fit=None, knows=0.9) for k in range(1, 30)]
        for k in range(15, 25):
            updates[k] = replace(updates[k], knows=0.3 if k < 18 else 0.01, cloud=-9.0)
        updates[15] = replace(updates[15], **changes)
        (failure,) = suspected(updates, ((19, 25),))
        return failure

    failure = run()
    assert (failure.kind, failure.first) == ("unknown", 16)
    assert failure.episode.account == "probably lost from step 19 to 25"
    assert (run(after_s=30.0).kind, run(after_s=60.0).kind) == ("unknown", "data")  # carried in less time
    assert run(events=("kidnapped",), after_s=60.0).evidence["told"] == "the log says so"
    assert run(cloud_left=True).kind == "left_map"
    assert run(zero=True, inside=0).kind == "left_map"  # no weight, as no particle is on the map
    slow = "skipped: 30 pictures: the filter was too slow"
    for event, title in (
        (slow, "pictures skipped"),
        ("gap: the source was away for 60.0 s", "the source was away"),
        ("clock: set back by 3.0 s; odometry across it is not known", "clock set back"),
        ("bump", "gap in the recording"),
    ):
        failure = run(after_s=60.0, events=(event,))
        assert (failure.kind, failure.title) == ("data", title)
    assert run(events=(slow,)).title == "pictures skipped"  # most of them, though the time between is usual
    assert run(events=(slow.replace("30", "1"),)).kind == "unknown"


def test_places_that_look_alike_are_two_at_least():
    """The estimate's, which lies between references, is the other one where no reference is."""
    failure = failure_of({"fit": replace(FITS, estimate_behind=0.1, rivals=0)}, ALL)
    assert (failure.kind, failure.evidence["places"]) == ("ambiguity", 2)


def test_a_view_has_changed_only_where_pictures_cost_more_than_usual_or_than_before():
    """A picture that fits other places better, and the true one as usual, shows what is there."""
    elsewhere = replace(POOR, cost=USUAL.cost)
    failure = failure_of({"fit": elsewhere}, SINCE)
    assert (failure.kind, "times_usual" in failure.evidence) == ("sensor", False)
    failure = failure_of({"fit": POOR}, SINCE)
    assert (failure.kind, failure.evidence["times_usual"]) == ("changed_view", pytest.approx(5.0))


@pytest.mark.parametrize(("page", "kinds"), [("diagnose.md", CAUSES), ("commands.md", INCIDENTS)])
def test_the_docs_tell_of_every_kind_in_the_order_of_the_table(page, kinds):
    text = (Path(__file__).parents[3] / "docs" / page).read_text(encoding="utf-8")
    names = dict.fromkeys(re.findall(r"^(?:\| |\* \*\*)`(\w+)`", text, re.MULTILINE))
    assert [name for name in names if name in kinds] == list(kinds)


def test_every_incident_belongs_to_a_cause_and_every_rule_names_one():
    assert {kind.cause for kind in INCIDENTS.values()} < set(CAUSES)
    assert [kind for kind, _, _ in CASES.values() if kind not in CAUSES] == []
