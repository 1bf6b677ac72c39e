"""Why a robot with a laser was lost: each rule about scans, on a run that is healthy but for it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from maurice_mcl.reasons.causes import CAUSES
from maurice_mcl.reasons.diagnosis import decide, stories_of
from maurice_mcl.reasons.evidence import Surprise, UpdateEvidence
from maurice_mcl.scoring.episodes import EpisodeFinder
from maurice_mcl.scoring.metrics import StepScore
from maurice_mcl.scoring.near_truth import NearTruth
from maurice_mcl.sensor.laser.fit import Mounting, ScanFit
from maurice_viz.style import Scale, units_named
from maurice_viz.text.causes import say_cause, say_evidence, say_remedy

RIGHT, OFF = StepScore(0.1, 0.0, True, True, False), StepScore(2.0, 0.0, True, False, True)
HELD, GONE = NearTruth(900, (0.9, 0.95, 0.95), 0.02), NearTruth(0, (0.0, 0.0, 0.0), 1.5)
SHARES = {"agrees": 0.95, "short": 0.03, "beyond": 0.0, "unknown": 0.0, "miss": 0.02, "unseen": 0.01}
# a scan that fits the truth, and the estimate of a lost filter by far not
FITS = ScanFit(0.02, 60.0, 60.0, 70.0, 0.98, 60.0, 2.0, (3.0, 4.0), 0.4, SHARES)
BAD = replace(
    FITS, off=0.5, ahead=-3.0, own_ahead=-3.0, own_says=9.0, skill=0.6, shares=SHARES | {"short": 0.5}
)
LOST_AT, UPDATES = 11, 24
ALL, SINCE = range(1, UPDATES), range(9, UPDATES)


def update(step):
    return UpdateEvidence(
        step=step,
        after_s=8.0,
        repeated=False,
        events=(),
        tilt_deg=None,
        floor="",
        broken=False,
        zero=False,
        cloud_left=False,
        score=RIGHT if step < LOST_AT else OFF,
        lost_m=0.9,
        size=1000,
        inside=1000,
        ess=500.0,
        spread_nats=0.0,
        best=0.0,
        cloud=0.0,
        gray=0.0,
        moved_m=0.3,
        driven_m=0.3,
        surprise=Surprise(0.5, -0.3, 0.8, 1.0),
        near=HELD if step < LOST_AT else GONE,
        scan=FITS,
    )


def failure_of(scan, steps, everywhere=None):
    """Diagnose a run that is lost from 11 on, with another fit of its scans at some steps."""
    updates = [replace(update(step), **(everywhere or {})) for step in ALL]
    updates = [replace(one, scan=scan) if one.step in steps else one for one in updates]
    finder = EpisodeFinder()
    for one in updates:
        finder.see(one.step, one.score)
    (story,) = stories_of(updates, finder.episodes)
    return decide(story)


TURNED = replace(BAD, mounting=Mounting(np.radians(-90), False, -2.0, -70.0))
MIRRORED = replace(BAD, mounting=Mounting(0.0, True, -2.0, -70.0))
CASES = {
    "no particle": ("impoverished", FITS, ALL),
    "out of the mapped part": ("left_map", replace(BAD, shares=SHARES | {"unknown": 0.6}), SINCE),
    "turned": ("mount", TURNED, ALL),
    "upside down": ("mount", MIRRORED, ALL),
    "turned by less than the steps": (
        "changed_view",
        replace(BAD, mounting=Mounting(np.radians(5), False, -2.0, -70.0)),
        SINCE,
    ),
    "wrong map": ("wrong_map", replace(BAD, skill=0.1), ALL),
    "a part of the map is wrong": ("changed_view", replace(BAD, skill=0.1), SINCE),
    "glass": ("unseen_walls", replace(BAD, shares=SHARES | {"beyond": 0.3}), SINCE),
    "dark walls": ("unseen_walls", replace(FITS, shares=SHARES | {"unseen": 0.6}), SINCE),
    "people": ("changed_view", BAD, SINCE),
    "people, after it was lost": ("impoverished", BAD, range(22, UPDATES)),
    "twin": ("ambiguity", replace(FITS, ahead=1.0, own_ahead=1.0), SINCE),
    "corridor": ("ambiguity", replace(FITS, ahead=1.0, own_ahead=1.0, between=2.0), SINCE),
    "flat": ("flat_sensor", replace(FITS, own_ahead=1.0, own_says=1.5), SINCE),
    "a sensor that prefers the wrong place": (
        "impoverished",
        replace(FITS, own_ahead=-3.0, own_says=1.5),
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
    assert say_remedy(failure, True)
    assert not say_remedy(failure, False)


def test_a_corridor_is_told_from_a_twin_by_what_is_between():
    twin, corridor = (failure_of(CASES[name][1], SINCE) for name in ("twin", "corridor"))
    assert "corridor" in corridor.evidence
    assert "corridor" not in twin.evidence


def test_a_start_is_wrong_only_where_the_cloud_was_together_at_first():
    lost = {"score": OFF, "near": GONE}
    assert failure_of(FITS, ALL, lost | {"began_together": True}).kind == "wrong_start"
    assert failure_of(FITS, ALL, lost).kind == "impoverished"


def test_a_robot_with_a_laser_is_never_told_of_the_view():
    assert failure_of(BAD, SINCE).title == "the map changed"
