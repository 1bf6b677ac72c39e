"""Each number in a rule, just under and just over it, as docs/diagnose.md and docs/laser.md state it.

`python -m benchmarks.studies.mutants` lists the numbers that could change unnoticed.
"""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from helpers.lost_runs import ALL, GONE, LOST_AT, SINCE, healthy
from maurice_mcl.reasons import drive_rules, laser_rules, picture_rules
from maurice_mcl.reasons.evidence import Story, Surprise
from maurice_mcl.reasons.rules import suspected
from maurice_mcl.reasons.surroundings import LightFit, PlaceFit, UsualFit
from maurice_mcl.scoring.episodes import Episode
from maurice_mcl.scoring.metrics import StepScore
from maurice_mcl.scoring.modes import NearTruth
from maurice_mcl.sensor.laser.fit import Mounting, ScanFit

# What is usual: 8 s and 0.3 m between updates, references 0.45 m apart, pictures that cost 0.8 nats.
FITS = PlaceFit(0.8, -1.0, 0.0, 2, 600, 0, (3.0, 3.0), "color", 0.1)
POOR = replace(FITS, cost=4.0, behind=5.0, rank=200)
LIT = LightFit(0.02, 100.0, 98.0, 0.8, -1.0)
USUAL = UsualFit(0.8, 0.05, {"color": 0.1})
STILL = Surprise(0.0, 0.0, 0.0, 1.0)
SCAN = ScanFit(0.02, 60.0, 60.0, 70.0, 0.98, 60.0, 2.0, (3.0, 4.0), 0.4, {"agrees": 0.95})
BAD = replace(SCAN, off=0.5, ahead=-3.0, own_ahead=-3.0, own_over_typical=9.0, skill=0.6)


def run(changes, steps=(LOST_AT,), usual=USUAL, **everywhere):
    """Return a run that is lost from 11 on, with something else at some steps."""
    seen = {"fit": FITS, "light": LIT, "alike": 0.7, "surprise": STILL, "outside": False, "reference_m": 0.2}
    everywhere = seen | everywhere
    updates = [healthy(k, **(everywhere | (changes if k in steps else {}))) for k in ALL]
    episode = Episode("lost", LOST_AT, updates[-1].step, LOST_AT, lost=LOST_AT + 3)
    return Story(updates, episode, spacing_m=0.45, usual=usual)


def poor(**changes):
    return {"fit": replace(POOR, **changes)}


def lit(cost=4.0, alike=0.7, *, ratio=-0.5, colors=1.0):
    """Return pictures that cost 3.2 nats over the usual, and so much once the brightness is corrected."""
    return {"fit": POOR, "alike": alike, "light": replace(LIT, ratio=ratio, cost=cost, colors=colors)}


def shares(**changes):
    return {"scan": replace(BAD, shares=changes)}


def mounted(nats=-2.0, yaw_deg=90.0, place=(0.0, 0.0), placed=-90.0):
    mounting = Mounting(np.radians(yaw_deg), False, nats, -70.0)
    return {"scan": replace(BAD, mounting=replace(mounting, place=place, placed_nats=placed))}


def flat(ahead=60.0, own=1.0, says=1.5):
    return {"scan": replace(SCAN, ahead=ahead, own_ahead=own, own_over_typical=says)}


def near(after_picture):
    return {"near": NearTruth(3, (0.0, after_picture, 0.0), 0.1)}


BUMP = {"surprise": Surprise(9.0, 0.0, 0.0)}
SLIP = {"events": ("slip 25 deg",)}
# rule, what does not reach it, what does: changes of a healthy run, and the steps that have them
SIDES = {
    "gap of 3 times the usual": ("gap_in_log", ({"after_s": 23.9, **BUMP},), ({"after_s": 24.1, **BUMP},)),
    "gap at the usual speed": (
        "gap_in_log",
        ({"after_s": 24.1, "moved_m": 0.93, **BUMP},),
        ({"after_s": 24.1, "moved_m": 0.88, **BUMP},),
    ),
    "gap of 5.5 times the usual at speed": (
        "gap_in_log",
        ({"after_s": 43.9, "moved_m": 3.3, **BUMP},),
        ({"after_s": 44.1, "moved_m": 3.3, **BUMP},),
    ),
    "long gap at 4 times the usual speed": (
        "gap_in_log",
        ({"after_s": 44.1, "moved_m": 6.7, **BUMP},),
        ({"after_s": 44.1, "moved_m": 6.5, **BUMP},),
    ),
    "3 equal pictures": ("stuck_pictures", ({"repeated": True}, (10, 11)), ({"repeated": True}, (9, 10, 11))),
    "odometry 4 times as fast as ever": (
        "odometry_jumps",
        ({"driven_m": 1.19, "moved_m": 0.0},),
        ({"driven_m": 1.21, "moved_m": 0.0},),
    ),
    "truth leaps 2 times as far as ever": (
        "carried",
        ({"moved_m": 0.59, "driven_m": 0.1},),
        ({"moved_m": 0.61, "driven_m": 0.1},),
    ),
    "off the map at 2 updates": ("off_map", ({"outside": True},), ({"outside": True}, (10, 11))),
    "tilted at a third of 17 updates": (
        "out_of_plane",
        ({"tilt_deg": 20.0}, range(7, 12)),
        ({"tilt_deg": 20.0}, range(7, 13)),
    ),
    "4.5 sd": ("beyond_motion", ({"surprise": Surprise(4.4, 0, 0)},), ({"surprise": Surprise(4.6, 0, 0)},)),
    "5 sd of three movements": (
        "beyond_motion",
        ({"surprise": Surprise(2.85, 0, 0)}, (9, 10, 11)),
        ({"surprise": Surprise(2.95, 0, 0)}, (9, 10, 11)),
    ),
    "three movements at least": (
        "beyond_motion",
        ({"surprise": Surprise(4.2, 0, 0)}, (10, 11)),
        ({"surprise": Surprise(4.2, 0, 0)}, (9, 10, 11)),
    ),
    "2.5 sd where the log tells of a slip": (
        "slipped_as_told",
        ({"surprise": Surprise(2.4, 0, 0), **SLIP},),
        ({"surprise": Surprise(2.6, 0, 0), **SLIP},),
    ),
    "37 nats": ("weights_vanish", ({"spread_nats": 36.9}, ALL), ({"spread_nats": 37.1}, ALL)),
    "half of the window's 6 updates": (
        "weights_vanish",
        ({"spread_nats": 99.0}, (10, 11)),
        ({"spread_nats": 99.0}, (9, 10, 11)),
    ),
    "weight for a copy": ("unlucky", (near(0.00095),), (near(0.00105),)),
    "no reference within 1.5 spacings": (
        "library_gap",
        ({"reference_m": 0.67}, (10, 11)),
        ({"reference_m": 0.68}, (10, 11)),
    ),
    "no reference at 2 updates": ("library_gap", ({"reference_m": 1.0},), ({"reference_m": 1.0}, (10, 11))),
    "brightness by 0.3 in log": ("lighting", (lit(1.0, ratio=-0.29), SINCE), (lit(1.0, ratio=-0.31), SINCE)),
    "4/5 of the cost left": (
        "lighting",
        (lit(3.37, colors=0.0), SINCE),
        (lit(3.35, colors=0.0), SINCE),
    ),
    "0.65 of the usual layout": ("lighting", (lit(alike=0.45), SINCE), (lit(alike=0.46), SINCE)),
    "0.4 of the usual layout": ("lighting", (lit(1.0, 0.275), SINCE), (lit(1.0, 0.285), SINCE)),
    "all colors by half": (
        "lighting",
        (lit(colors=0.49), SINCE),
        (lit(colors=0.51), SINCE),
    ),
    "a fifth as bright": (
        "lighting",
        (lit(alike=0.0, ratio=np.log(0.21)), SINCE),
        (lit(alike=0.0, ratio=np.log(0.19)), SINCE),
    ),
    "rank 2.5 % of 600": (
        "unlike_references",
        ({"fit": replace(FITS, rank=15)}, ALL),
        ({"fit": replace(FITS, rank=16)}, ALL),
    ),
    "rank 10 of few": (
        "unlike_references",
        ({"fit": replace(FITS, rank=10, references=100)}, ALL),
        ({"fit": replace(FITS, rank=11, references=100)}, ALL),
    ),
    "1.6 times the usual cost": (
        "unlike_references",
        ({"fit": replace(FITS, cost=1.27)}, ALL),
        ({"fit": replace(FITS, cost=1.29)}, ALL),
    ),
    "1.5 nats for the estimate": (
        "unlike_references",
        ({"fit": replace(FITS, estimate_behind=1.4)}, ALL),
        ({"fit": replace(FITS, estimate_behind=1.6)}, ALL),
    ),
    "half of 12 pictures": (
        "unlike_references",
        (poor(), range(11, 16)),
        (poor(), range(11, 17)),
    ),
    "alike within a nat": (
        "ambiguity",
        ({"fit": replace(FITS, estimate_behind=1.05)}, ALL),
        ({"fit": replace(FITS, estimate_behind=0.95)}, ALL),
    ),
    "alike at half of 13 pictures": (
        "ambiguity",
        ({"fit": replace(FITS, estimate_behind=0.1)}, range(11, 17)),
        ({"fit": replace(FITS, estimate_behind=0.1)}, range(11, 18)),
    ),
    "beams end in the unknown, 0.4": (
        "left_mapped",
        (shares(unknown=0.39), SINCE),
        (shares(unknown=0.41), SINCE),
    ),
    "in the unknown at half of 12 scans": (
        "left_mapped",
        (shares(unknown=0.6), range(11, 16)),
        (shares(unknown=0.6), range(11, 17)),
    ),
    "mount by 10 degrees": ("wrong_mount", (mounted(yaw_deg=9.9), ALL), (mounted(yaw_deg=10.1), ALL)),
    "mount by 0.15 m": (
        "wrong_mount",
        (mounted(-60.0, 0.0, (0.14, 0.0), -2.0), ALL),
        (mounted(-60.0, 0.0, (0.16, 0.0), -2.0), ALL),
    ),
    "mount gives half of 70 nats": ("wrong_mount", (mounted(-35.1), ALL), (mounted(-34.9), ALL)),
    "fits by chance, 0.35": (
        "wrong_map",
        ({"scan": replace(BAD, skill=0.36)}, ALL),
        ({"scan": replace(BAD, skill=0.34)}, ALL),
    ),
    "walls unseen by 0.2": ("walls_unseen", (shares(beyond=0.19), SINCE), (shares(beyond=0.21), SINCE)),
    "truth ahead by 10 nats": ("too_flat", (flat(9.9), SINCE), (flat(10.1), SINCE)),
    "own model ahead by 4 nats": ("too_flat", (flat(own=4.1), SINCE), (flat(own=3.9), SINCE)),
    "own model says 4 nats": ("too_flat", (flat(says=4.1), SINCE), (flat(says=3.9), SINCE)),
    "range leaves out 0.7": (
        "range_cut",
        ({"scan": replace(SCAN, cut=0.69)}, ALL),
        ({"scan": replace(SCAN, cut=0.71)}, ALL),
    ),
    "scans alike within 5 nats": ("fits_elsewhere", (flat(5.1), SINCE), (flat(4.9), SINCE)),
    "4 scans of another mount": (
        "wrong_mount",
        (mounted(), (12, 13, 14), {"scan": None}),
        (mounted(), (12, 13, 14, 15), {"scan": None}),
    ),
    "a range cut at half of 12": (
        "range_cut",
        ({"scan": replace(SCAN, cut=0.9)}, range(11, 16)),
        ({"scan": replace(SCAN, cut=0.9)}, range(11, 17)),
    ),
    "2 scans in the unknown": (
        "left_mapped",
        (shares(unknown=0.6), (12,), {"scan": None}),
        (shares(unknown=0.6), (12, 13), {"scan": None}),
    ),
    "2 pictures alike": (
        "ambiguity",
        ({"fit": replace(FITS, estimate_behind=0.1)}, (12,), {"fit": None}),
        ({"fit": replace(FITS, estimate_behind=0.1)}, (12, 13), {"fit": None}),
    ),
    "scans alike at half of 13": ("fits_elsewhere", (flat(1.0), range(11, 12)), (flat(1.0), SINCE)),
}
RULES = {
    rule.__name__: rule
    for module in (drive_rules, picture_rules, laser_rules)
    for rule in vars(module).values()
    if callable(rule) and getattr(rule, "__module__", "") == module.__name__ and hasattr(rule, "__name__")
}


@pytest.mark.parametrize("name", SIDES)
def test_a_rule_holds_just_over_its_number_and_not_just_under(name):
    rule, *sides = SIDES[name]
    usual = {"scan": SCAN} if RULES[rule].__module__ == laser_rules.__name__ else {}
    for is_named, (changes, *more) in zip((False, True), sides, strict=True):
        steps, everywhere = (*more, *((LOST_AT,), {})[len(more) :])
        assert (RULES[rule](run(changes, steps, **(usual | everywhere))) is not None) == is_named


def test_odometry_is_known_to_jump_after_five_other_updates_and_a_twentieth_of_them_may_jump_too():
    def jumps(others, faster=()):
        steps = [k for k in ALL if k != LOST_AT][others:]
        told = run({"after_s": None}, steps)
        jump = {LOST_AT: {"driven_m": 2.0}} | {k: {"driven_m": 30.0} for k in faster}
        updates = [replace(one, **jump.get(one.step, {})) for one in told.updates]
        return drive_rules.odometry_jumps(replace(told, updates=updates)) is not None

    assert [jumps(5), jumps(6)] == [False, True]
    assert [jumps(22, (1,)), jumps(22, (1, 2, 3))] == [True, False]


def kind(story):
    return picture_rules.unlike_references(story).kind


def test_a_confused_library_and_pictures_that_were_always_bad_are_no_changed_view():
    bad_fit, fit = poor(cost=1.29), replace(FITS, cost=0.82)
    always = [kind(run(bad_fit, [*range(1, bad + 1), *SINCE], fit=fit)) for bad in (3, 4)]
    assert always == ["changed_view", "sensor"]  # at half of the 8 before
    shares_confused = [kind(run(poor(), SINCE, usual=replace(USUAL, confused=c))) for c in (0.24, 0.26)]
    assert shares_confused == ["changed_view", "sensor"]


@pytest.mark.parametrize(
    ("cost", "steps", "kind_of"),
    [
        (1.27, SINCE, "sensor"),
        (1.29, SINCE, "changed_view"),
        (1.29, range(4, 24), "changed_view"),
        (1.29, range(3, 24), "sensor"),
    ],
)
def test_pictures_changed_where_they_cost_1_6_times_as_much_as_most_of_five_before(cost, steps, kind_of):
    changes = {"fit": replace(POOR, cost=cost)}
    assert kind(run(changes, steps, usual=replace(USUAL, cost=2.0))) == kind_of


@pytest.mark.parametrize(("known", "named"), [(4, True), (5, False)])
def test_five_pictures_before_tell_the_usual_layout_else_it_is_0_6(known, named):
    def story(alike, known=0):
        told = run(lit(alike=alike), SINCE)
        updates = [
            one if one.step in SINCE else replace(one, alike=0.9 if one.step <= known else None)
            for one in told.updates
        ]
        return replace(told, updates=updates)

    assert (picture_rules.lighting(story(0.5, known)) is not None) == named
    sides = [picture_rules.lighting(story(alike)) is not None for alike in (0.385, 0.395)]
    assert sides == [False, True]  # 0.65 of 0.6


def test_scans_that_disagree_before_the_loss_begin_it_where_they_speak_against_the_truth_by_5_nats():
    def began(ahead):
        told = run({"scan": BAD}, SINCE, scan=replace(SCAN, ahead=ahead))
        return laser_rules.scene_changed(told).first

    assert [began(-4.9), began(-5.1)] == [9, 1]


def test_a_wrong_map_was_wrong_at_all_scans_but_two():
    fits = {"scan": replace(BAD, skill=0.1)}
    named = [laser_rules.wrong_map(run(fits, range(first, 24), scan=SCAN)) is not None for first in (3, 4)]
    assert named == [True, False]


def test_a_start_that_is_turned_by_30_degrees_is_told_and_one_whose_cloud_held_the_truth_is_right():
    def start(turned_deg, held=0.0):
        score = StepScore(2.0, np.radians(turned_deg), True, False, True)
        near_truth = NearTruth(9, (held, held, held), 0.1)
        return laser_rules.wrong_start(run({}, score=score, near=near_truth, began_together=True))

    assert ["start_turned_deg" in start(turned).evidence for turned in (29, 31)] == [False, True]
    assert [start(0, held) is None for held in (0.49, 0.5)] == [False, True]


# What a story looks at.


def test_the_windows_of_a_story():
    told = run({})
    assert (told.last_near, told.window, told.pictures) == (9, range(6, 12), range(9, 21))
    held = {"near": NearTruth(500, (0.5, 0.5, 0.5), 0.1)}
    assert run(held, near=GONE).last_near is None
    assert [
        run({"near": NearTruth(9, (0, share, share), 0.1)}, (5,), near=GONE).last_near
        for share in (0.49, 0.5)
    ] == [None, 4]
    long = [healthy(k, near=GONE) for k in range(1, 80)]
    assert Story(long, Episode("lost", 41, 79, 41, lost=44)).window == range(10, 42)  # 30 before it
    searched = Story(long, Episode("lost", 1, 79, 1, lost=4))
    assert (searched.pictures, searched.nearby) == (range(11), range(31))


@pytest.mark.parametrize(
    ("behind", "fits"),
    [
        ([-0.89] * 4, False),  # 0.15 of the spread of 6 nats
        ([-0.91] * 4, True),
        ([-0.91] * 3, False),
        ([-0.91] * 3 + [0.1], True),  # three quarters
        ([-0.91] * 5 + [0.1] * 2, False),
    ],
)
def test_pictures_fit_the_truth_at_four_updates_at_least_and_three_quarters_of_them(behind, fits):
    told = run({})
    of = {LOST_AT + k: replace(FITS, estimate_behind=value) for k, value in enumerate(behind)}
    updates = [replace(one, fit=of.get(one.step, FITS)) for one in told.updates]
    assert replace(told, updates=updates).fits_truth == fits


def test_a_robot_that_waits_goes_less_than_twice_as_far_and_half_a_particle_is_none():
    told = run({"spread_nats": 0.0, "driven_m": 0.59}, spread_nats=0.0)
    late = told.updates[LOST_AT - 1]
    assert [told.waited(replace(late, driven_m=way)) for way in (0.59, 0.61)] == [0.0, 1.0]
    turns = [replace(update, driven_m=0.0) if update.step % 4 else update for update in told.updates]
    turning = replace(told, updates=turns)  # three of four updates are turns on the spot
    assert [turning.waited(replace(late, driven_m=way)) for way in (0.59, 0.61)] == [0.0, 1.0]
    assert run({}).nats_lost == pytest.approx((np.log(0.95 / 0.0005), 0.0))


# Without truth.

BLIND = StepScore(None, None, True, None, None)
LIBRARY = SimpleNamespace(usual=USUAL, levels=np.array([[90.0, 90, 90], [130, 130, 130]]))


def doubted(since, count=14, before=None, first=16):
    """Suspect why a run is doubted from a step on; `before` are changes by step."""
    updates = [healthy(k, score=BLIND, near=None, fit=None, knows=0.9) for k in range(1, first + count)]
    changed = {one.step: {"knows": 0.01, **since} for one in updates[first - 1 :]} | (before or {})
    updates = [replace(one, **changed.get(one.step, {})) for one in updates]
    return suspected(updates, ((first, first + count - 1),), LIBRARY)[0]


@pytest.mark.parametrize(
    ("under", "over", "kind_of"),
    [
        ({"best": -2.69}, {"best": -2.71}, "changed_view"),  # 2 nats below the usual 0.7
        ({"best": -5.0, "gray": 61.0}, {"best": -5.0, "gray": 59.0}, "lighting"),  # 1.5 times as dark as any
        ({"best": -5.0, "gray": 194.0}, {"best": -5.0, "gray": 196.0}, "lighting"),
        ({"best": -5.0, "gray": 136.0}, {"best": -5.0, "gray": 134.0}, "changed_view"),  # 1.35 times as light
        ({"best": -5.0, "gray": 73.0}, {"best": -5.0, "gray": 75.0}, "changed_view"),
        ({"after_s": 43.9}, {"after_s": 44.1}, "data"),  # 5.5 times the usual time
    ],
)
def test_without_truth_too(under, over, kind_of):
    assert doubted(under).kind != kind_of
    assert doubted(over).kind == kind_of


def test_without_truth_at_three_pictures_that_cost_1_6_times_the_usual():
    assert [doubted({"best": -5.0}, count).kind for count in (2, 3)] == ["unknown", "changed_view"]
    cheap = {k: {"best": 2.0} for k in range(1, 16)}
    assert [doubted({"best": best}, before=cheap).kind for best in (-1.27, -1.29)] == [
        "unknown",
        "changed_view",
    ]


def test_without_truth_a_doubt_begins_within_ten_updates_and_the_usual_is_that_of_twenty():
    unsure = {k: {"knows": 0.3} for k in range(20, 45)}
    assert doubted({}, before=unsure, first=45).first == 35
    far = {k: {"best": -4.0} for k in range(1, 25)} | {k: {"best": -0.5} for k in range(25, 36)}
    assert doubted({}, before=far, first=36).evidence["usual_best_nats"] == -0.5  # at 11 of the last 20
