"""Why a robot with a laser was lost: each rule about scans, on a run that is healthy but for it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from helpers.lost_runs import ALL, GONE, HELD, OFF, SINCE, UPDATES, healthy, stories
from maurice_mcl.filter.recovery import DRAWS_EVENLY, DRAWS_NEVER, DRAWS_WHERE_LIKELY
from maurice_mcl.reasons.causes import CAUSES, FLAT, KIDNAPPED, PROPOSAL, UNKNOWN, VIEW
from maurice_mcl.reasons.evidence import Surprise
from maurice_mcl.reasons.rules import decide, suspected
from maurice_mcl.reasons.suspicion import scan_doubts
from maurice_mcl.reasons.verdict import RunVerdict
from maurice_mcl.scoring.metrics import StepScore
from maurice_mcl.sensor.laser.fit import Mounting, ScanFit
from maurice_mcl.sensor.laser.parameters import LaserParameters
from maurice_viz.style import Scale, units_named
from maurice_viz.text.causes import say_cause, say_evidence, say_remedy

SHARES = {"agrees": 0.95, "short": 0.03, "beyond": 0.0, "unknown": 0.0, "miss": 0.02, "unseen": 0.01}
# a scan that fits the truth, and the estimate of a lost filter by far not
FITS = ScanFit(0.02, 60.0, 60.0, 70.0, 0.98, 60.0, 2.0, (3.0, 4.0), 0.4, SHARES)
BAD = replace(
    FITS, off=0.5, ahead=-3.0, own_ahead=-3.0, own_over_typical=9.0, skill=0.6, shares=SHARES | {"short": 0.5}
)


def failure_of(scan, steps, **everywhere):
    """Diagnose a run that is lost from 11 on, with another fit of its scans at some steps."""
    (story,) = stories([healthy(k, **everywhere, scan=scan if k in steps else FITS) for k in ALL])
    return decide(story)


def mounted(angle_deg, upside_down=False):
    return replace(BAD, mounting=Mounting(np.radians(angle_deg), upside_down, -2.0, -70.0))


CASES = {
    "no particle": ("impoverished", FITS, ALL),
    "out of the mapped part": ("left_map", replace(BAD, shares=SHARES | {"unknown": 0.6}), SINCE),
    "turned": ("mount", mounted(-90), ALL),
    "upside down": ("mount", mounted(0, True), ALL),
    "turned by less than the steps": ("changed_view", mounted(5), SINCE),
    "wrong map": ("wrong_map", replace(BAD, skill=0.1), ALL),
    "a part of the map is wrong": ("changed_view", replace(BAD, skill=0.1), SINCE),
    "glass": ("unseen_walls", replace(BAD, shares=SHARES | {"beyond": 0.3}), SINCE),
    "dark walls": ("unseen_walls", replace(FITS, shares=SHARES | {"unseen": 0.6}), SINCE),
    "people": ("changed_view", BAD, SINCE),
    "people, after it was lost": ("impoverished", BAD, range(22, UPDATES)),
    "twin": ("ambiguity", replace(FITS, ahead=1.0, own_ahead=1.0), SINCE),
    "corridor": ("ambiguity", replace(FITS, ahead=1.0, own_ahead=1.0, between=2.0), SINCE),
    "flat": ("flat_sensor", replace(FITS, own_ahead=1.0, own_over_typical=1.5), SINCE),
    "a range that is cut": ("flat_sensor", replace(FITS, cut=0.85), ALL),
    "a range that is cut somewhat": ("impoverished", replace(FITS, cut=0.4), ALL),
    "a sensor that prefers the wrong place": (
        "impoverished",
        replace(FITS, own_ahead=-3, own_over_typical=1.5),
        SINCE,
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_each_cause_is_named_by_its_own_evidence_and_said_of_scans(case):
    kind, scan, steps = CASES[case]
    failure = failure_of(scan, steps)
    assert failure.kind == kind
    assert failure.title in {CAUSES[kind].title, "the map changed", "scans fit elsewhere"}
    scale = Scale(units_named("m"))
    text = " ".join([say_cause(failure, scale), *say_evidence(failure, scale)])
    for word in ("picture", "camera", "reference", "library"):
        assert word not in text
    assert say_remedy(failure, RunVerdict(has_laser=True))
    assert not say_remedy(failure, RunVerdict())


@pytest.mark.parametrize(
    ("kind", "has", "told", "untold"),
    [
        (KIDNAPPED, {"draws_new": DRAWS_NEVER}, ["recovery_alpha_slow", "--preset laser"], ["2D Pose"]),
        (KIDNAPPED, {"draws_new": DRAWS_EVENLY}, ["--preset laser"], ["recovery_alpha", "2D Pose"]),
        (KIDNAPPED, {"draws_new": DRAWS_WHERE_LIKELY}, ["2D Pose"], ["recovery_alpha", "--preset"]),
        (PROPOSAL, {"draws_new": DRAWS_WHERE_LIKELY}, ["max_particles"], ["--preset"]),
        (FLAT, {"laser": LaserParameters("likelihood_field")}, ["likelihood_field_prob", "alpha1"], []),
        (FLAT, {"laser": LaserParameters("likelihood_field_prob")}, ["alpha1"], ["laser_model_type"]),
        (VIEW, {"laser": LaserParameters()}, ["a new map"], ["z_rand", "do_beamskip"]),
        (VIEW, {"laser": LaserParameters("likelihood_field_prob")}, ["do_beamskip", "z_rand"], []),
        (
            VIEW,
            {"laser": LaserParameters("likelihood_field_prob", do_beamskip=True)},
            ["z_rand"],
            ["do_beamskip"],
        ),
    ],
)
def test_a_run_is_advised_what_it_does_not_do_yet(kind, has, told, untold):
    failure = replace(failure_of(*CASES["twin"][1:]), kind=kind)
    advice = say_remedy(failure, RunVerdict(has_laser=True, **has))
    for word in told:
        assert word in advice
    for word in untold:
        assert word not in advice


@pytest.mark.parametrize(
    ("says_nats", "needs_nats", "kind"), [(1.2, 5.0, FLAT), (4.9, 5.0, FLAT), (5.1, 5.0, UNKNOWN)]
)
def test_a_run_that_is_right_and_never_sure_has_a_flat_likelihood(says_nats, needs_nats, kind):
    """Its estimate is at the truth: only what its own model says beside its motion noise tells why."""
    here = replace(FITS, ahead=0.4, own_ahead=0.1, own_over_typical=says_nats)
    unsure, moves = StepScore(0.1, 0.0, False, True, False), Surprise(0.5, -0.3, 0.8, needs_nats)
    failure = failure_of(here, ALL, score=unsure, near=HELD, surprise=moves)
    assert failure.kind == kind
    if kind == FLAT:
        text = say_cause(failure, Scale(units_named("m")))
        assert f"at most {says_nats:.1f} nats a scan" in text
        assert f"{needs_nats:.1f}" in text


def test_a_corridor_is_told_from_a_twin_by_what_is_between():
    twin, corridor = (failure_of(CASES[name][1], SINCE) for name in ("twin", "corridor"))
    assert "corridor" in corridor.evidence
    assert "corridor" not in twin.evidence


def test_off_the_mapped_part_nothing_is_said_of_what_the_map_has_otherwise():
    unmapped = replace(BAD, skill=0.1, own_ahead=1.0, own_over_typical=1.5, shares=SHARES | {"unknown": 0.6})
    failure = failure_of(unmapped, SINCE)
    assert failure.kind == "left_map"
    assert not {"changed_view", "wrong_map", "flat_sensor"}.intersection(failure.also)
    assert "changed_view" in failure_of(replace(unmapped, shares=SHARES | {"beyond": 0.3}), SINCE).also


def test_a_start_is_wrong_only_where_the_cloud_was_together_at_first():
    lost = {"score": OFF, "near": GONE}
    wrong = failure_of(FITS, ALL, **lost, began_together=True)
    assert wrong.kind == "wrong_start"
    assert "the filter began" in say_cause(wrong, Scale(units_named("m")))
    assert failure_of(FITS, ALL, **lost).kind == "impoverished"
    assert failure_of(BAD, SINCE).title == "the map changed"  # nothing is said of a view


def placed(ahead_m, left_m, nats):
    return replace(
        BAD, skill=0.1, mounting=replace(mounted(0).mounting, place=(ahead_m, left_m), placed_nats=nats)
    )


def test_a_laser_that_stands_elsewhere_is_no_wrong_map():
    found = failure_of(
        replace(placed(0.4, -0.2, -3.0), mounting=replace(placed(0.4, -0.2, -3.0).mounting, nats=-60)), ALL
    )
    assert (found.kind, found.title) == ("mount", "laser misplaced")
    assert not {"wrong_map", "changed_view"}.intersection(found.also)
    text = say_cause(found, Scale(units_named("m")))
    assert "once the laser is 0.40 m ahead of and 0.20 m right of its place in the recording" in text
    worse = placed(0.4, -0.2, -50.0)
    assert failure_of(replace(worse, mounting=replace(worse.mounting, nats=-60)), ALL).kind == "wrong_map"


def test_a_start_at_the_right_place_in_a_wrong_heading_is_said_so():
    around = replace(OFF, error_m=0.01, heading_error_rad=np.pi)
    wrong = failure_of(FITS, ALL, score=around, near=GONE, began_together=True)
    text = say_cause(wrong, Scale(units_named("m")))
    assert text.startswith("the filter began at the true place (off by 0.01 m), but 180 deg off its heading")
    assert "yaw" in say_remedy(wrong, RunVerdict(has_laser=True))


WITHOUT_TRUTH = {
    "carried off": (BAD, SINCE),
    "out of the mapped part": (replace(BAD, shares=SHARES | {"unknown": 0.6}), SINCE),
    "from the start": (BAD, ALL),
    "little by little": (BAD, [*range(SINCE[0] - 4, SINCE[0], 2), *SINCE]),
}


@pytest.mark.parametrize("case", WITHOUT_TRUTH)
def test_without_truth_the_scans_at_the_estimate_tell_since_when_and_no_cause(case):
    """A wrong start, a robot that was carried and wheels that slip all make scans disagree with the map."""
    scan, steps = WITHOUT_TRUTH[case]
    updates = [replace(healthy(k), scan_here=scan if k in steps else FITS) for k in ALL]
    doubts = scan_doubts(updates)
    assert [first for first, _ in doubts] == [SINCE[0] if steps is not ALL else updates[0].step]
    (failure,) = suspected(updates, doubts)
    assert (failure.kind, failure.truth_known) == ("unknown", False)
    assert "50% of the beams disagree with the map" in say_cause(failure, Scale(units_named("m")))
    scale = Scale(units_named("m"))
    text = " ".join([say_cause(failure, scale), *say_evidence(failure, scale)])
    for word in ("picture", "camera", "reference", "library", "true place"):
        assert word not in text


def test_two_scans_that_do_not_fit_are_no_doubt():
    updates = [replace(healthy(k), scan_here=BAD if k in (20, 21) else FITS) for k in ALL]
    assert scan_doubts(updates) == ()


@pytest.mark.parametrize(("driven_m", "kind"), [(0.3, "kidnapped"), (1.6, "data")])
def test_a_robot_that_stood_still_before_it_was_carried_is_no_gap_in_the_recording(driven_m, kind):
    """Its scans wait until it has gone as far as between others; where it drove on, scans are missing."""
    scans_alone = {"spread_nats": 0.0, "best": -0.0}
    late = {"after_s": 90.0, "driven_m": driven_m, "moved_m": 2.0, "surprise": Surprise(9.0, 30.0, 0.8, 1.0)}
    updates = [healthy(k, **scans_alone, **(late if k == SINCE[0] else {})) for k in ALL]
    (story,) = stories([replace(one, scan=BAD if one.step in SINCE else FITS) for one in updates])
    assert decide(story).kind == kind
    unknown = [replace(one, scan_here=BAD if one.step in SINCE else FITS, moved_m=None) for one in updates]
    (failure,) = suspected(unknown, scan_doubts(unknown))
    assert failure.kind == (kind if kind == "data" else "unknown")


def test_scans_that_say_nothing_are_no_evidence_that_another_place_fits():
    """Their fit is that of no comparison: 0 nats, 0 m from the truth."""
    nothing = ScanFit(0.0, shares={"unseen": 0.1})
    assert failure_of(nothing, SINCE).kind != "ambiguity"
    assert failure_of(replace(FITS, ahead=1.0, apart_m=2.0), SINCE).kind == "ambiguity"
    turned = failure_of(replace(FITS, ahead=1.0, apart_m=0.01), SINCE)
    assert "turned by" in say_cause(turned, Scale(units_named("m")))
