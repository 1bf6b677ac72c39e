"""Causes in words where a robot has a laser, and what its owner can do: with AMCL's names of parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from maurice_mcl.filter.recovery import DRAWS_NEVER, DRAWS_WHERE_LIKELY
from maurice_mcl.reasons.causes import (
    AMBIGUITY,
    FLAT,
    KIDNAPPED,
    LEFT_MAP,
    MOTION,
    MOUNT,
    NUMERIC,
    PROPOSAL,
    RESAMPLING,
    START,
    UNSEEN,
    VIEW,
    WRONG_MAP,
    Failure,
)
from maurice_mcl.reasons.verdict import RunVerdict

from ...style import Scale

NAMES: Mapping[str, str] = {  # of evidence
    "scans": "scans that say so",
    "unknown_beams": "share of the beams that end where nobody has mapped",
    "unseen_beams": "share of the beams that pass through walls, or miss them",
    "short_beams": "share of the beams that end short of the wall",
    "short_m": "short of the wall by",
    "off_beams": "share of the beams that disagree with the map, at the truth or else at the estimate",
    "skill": "fit at the truth (1: perfect, 0: as anywhere)",
    "ahead_m": "the laser would have to be farther ahead by",
    "left_m": "and farther left by",
    "placed_nats": "then a scan has",
    "yaw_deg": "the laser would have to be turned by (deg)",
    "beams": "its beams would have to be counted",
    "turned_nats": "then a scan has",
    "scan_nats": "as it is it has",
    "start_off_m": "the first pose was off by",
    "start_turned_deg": "its heading was off by (deg)",
    "cut_beams": "share of the beams that hit something beyond laser_max_range",
    "says_nats": "the model of the laser says of a scan at most",
    "needs_nats": "the motion noise between scans takes away",
    "own_nats": "truth before the estimate, by that model",
    "ahead_nats": "truth before the estimate, by a calibrated model",
    "between_m": "way between scans",
    "apart_m": "the other place is away by",
    "turned_deg": "the other pose is turned by (deg)",
    "corridor": "all between fits as well",
}


@dataclass(frozen=True, slots=True)
class Advice:
    """What the owner of a robot can do, where a run does not do so already."""

    text: str
    helps: Callable[[RunVerdict], bool] = lambda run: True


def _never_draws(run: RunVerdict) -> bool:
    return run.draws_new in (DRAWS_NEVER, None)


def _asks_no_scan(run: RunVerdict) -> bool:
    return run.draws_new != DRAWS_WHERE_LIKELY


def _asks_scans(run: RunVerdict) -> bool:
    return run.draws_new == DRAWS_WHERE_LIKELY


def _has_amcls_model(run: RunVerdict) -> bool:
    return run.laser is None or run.laser.model != "calibrated"


def _is_flat(run: RunVerdict) -> bool:
    return run.laser is None or run.laser.model not in ("calibrated", PROB)


def _skips_no_beams(run: RunVerdict) -> bool:
    skips = run.laser is not None and (run.laser.model, run.laser.do_beamskip) == (PROB, True)
    return _has_amcls_model(run) and not skips


PROB = "likelihood_field_prob"
BEAMSKIP = Advice(f"laser_model_type {PROB} with do_beamskip", _skips_no_beams)
ASK_THE_SCAN = Advice("--preset laser, which draws particles where the scan fits", _asks_no_scan)
REMEDIES: Mapping[str, tuple[Advice, ...]] = {  # of failures of a robot with a laser
    KIDNAPPED: (
        ASK_THE_SCAN,  # first, as by itself AMCL's recovery found the robot in neither of two drives
        Advice("recovery_alpha_slow 0.001, recovery_alpha_fast 0.1", _never_draws),
        Advice("a pose given anew, as by RViz's 2D Pose Estimate", _asks_scans),
    ),
    LEFT_MAP: (Advice("map that part, too, and load the larger map.yaml"),),
    MOTION: (Advice("larger alpha1 to alpha4 (calibrate drive fits them); look at the wheels"),),
    NUMERIC: (
        Advice("a larger sigma_hit or z_rand: likelihoods that are less sharp", _has_amcls_model),
        Advice("fewer max_beams"),
    ),
    MOUNT: (Advice("correct the transform from base_link to the laser; doctor says how"),),
    WRONG_MAP: (Advice("the map.yaml of this place; its resolution and origin"),),
    UNSEEN: (Advice("laser_max_range below what it sees"), BEAMSKIP, Advice("draw glass walls into the map")),
    VIEW: (BEAMSKIP, Advice("a larger z_rand", _has_amcls_model), Advice("a new map")),
    START: (
        Advice("set_initial_pose with the right initial_pose"),
        Advice("a global start and more max_particles; doctor with --map tells a wrong map"),
    ),
    FLAT: (
        Advice(f"laser_model_type {PROB}", _is_flat),
        Advice("a smaller update_min_d, or smaller alpha1 to alpha4"),
    ),
    AMBIGUITY: (Advice("a known initial_pose; in a corridor better odometry and a smaller alpha3"),),
    PROPOSAL: (Advice("more max_particles, or a known initial_pose"), ASK_THE_SCAN),
    RESAMPLING: (Advice("more min_particles, resample_interval 2"),),
}
REMEDIES_BY: Mapping[str, str] = {  # of a number among the evidence, rather than of the kind
    "jump_m": "--reading odometry_are=jumping, which leaves the jump out; doctor shows when it was",
    "cut_beams": "laser_max_range -1, which takes the scans' own range_max",
    "start_turned_deg": "the right yaw (in radians) of initial_pose, or --start X,Y,HEADING",
}
NEAR_0 = 0.05  # m, of a place on the robot: it is not told
NEAR_M = 0.25  # of a start: at the true place
Clause = Callable[[Failure, Mapping[str, Any], Scale], str]


def _left_map(failure: Failure, e: Mapping[str, Any], scale: Scale) -> str:
    beams = f"{e['unknown_beams']:.0%} of the beams end where nobody has mapped"
    return f"the robot left the mapped part at step {failure.first} ({beams})"


def _mount(failure: Failure, e: Mapping[str, Any], scale: Scale) -> str:
    if "ahead_m" in e:
        sides = {"ahead of": e["ahead_m"], "left of": e["left_m"]}
        opposite = {"ahead of": "behind", "left of": "right of"}
        where = " and ".join(
            f"{scale.say(abs(v))} {side if v > 0 else opposite[side]}"
            for side, v in sides.items()
            if abs(v) > NEAR_0
        )
        nats = f"{e['scan_nats']:.0f} nats a scan as it is, {e['placed_nats']:.0f} then"
        return f"the scans fit the true places once the laser is {where} its place in the recording ({nats})"
    mirrored = ["upside down"] if "beams" in e else []
    turned = [f"turned by {e['yaw_deg']:+.0f} deg"] if e["yaw_deg"] or not mirrored else []
    nats = f"{e['scan_nats']:.0f} nats a scan as it is, {e['turned_nats']:.0f} then"
    return f"the scans fit the true places once the laser is {' and '.join(mirrored + turned)} ({nats})"


def _wrong_map(failure: Failure, e: Mapping[str, Any], scale: Scale) -> str:
    off = f"{e['off_beams']:.0%} of the beams disagree with the map at the true places"
    return f"{off}, as many as anywhere: it is another map, or its resolution or origin is wrong"


def _unseen(failure: Failure, e: Mapping[str, Any], scale: Scale) -> str:
    beams = f"{e['unseen_beams']:.0%} of the beams pass through walls of the map or come back from nothing"
    return f"{beams} from step {failure.first} on: glass, dark surfaces, or a short reach"


def _view(failure: Failure, e: Mapping[str, Any], scale: Scale) -> str:
    by = f" by {scale.say(e['short_m'])}" if "short_m" in e else ""
    short = f"{e['short_beams']:.0%} end short of the wall{by}"
    off = f"{e['off_beams']:.0%} of the beams disagree with the map at the true places"
    return f"{off} from step {failure.first} on ({short}): something stands in view, or was moved"


def _ambiguity(failure: Failure, e: Mapping[str, Any], scale: Scale) -> str:
    if "turned_deg" in e:
        turned = f"{e['turned_deg']:.0f} deg"
        return f"{e['scans']} scans fit the true place as well with the robot turned by {turned}"
    where = f"{e['scans']} scans fit {scale.say(e['apart_m'])} from the true place as well"
    if "corridor" in e:
        return f"{where}, and all between: along a corridor only odometry tells"
    return f"{where}, at x {scale.say(e['rival_x_m'])}, y {scale.say(e['rival_y_m'])}"


def _start(failure: Failure, e: Mapping[str, Any], scale: Scale) -> str:
    if "start_turned_deg" in e:
        at = f"at the true place (off by {scale.say(e['start_off_m'])})"
        near = at if e["start_off_m"] < NEAR_M else f"{scale.say(e['start_off_m'])} from the true place"
        return f"the filter began {near}, but {e['start_turned_deg']:.0f} deg off its heading, and sure of it"
    return f"the filter began {scale.say(e['start_off_m'])} from the true place, and sure of it"


def _flat(failure: Failure, e: Mapping[str, Any], scale: Scale) -> str:
    if "cut_beams" in e:
        cut = f"laser_max_range leaves out {e['cut_beams']:.0%} of the beams that hit something"
        return f"{cut}, and what is left hardly tells the place"
    says = f"the model of the laser says at most {e['says_nats']:.1f} nats a scan"
    apart = f"with scans {scale.say(e['between_m'])} apart the motion noise needs {e['needs_nats']:.1f}"
    return f"{says}, and {apart}"


CLAUSES: Mapping[str, Clause] = {
    LEFT_MAP: _left_map,
    MOUNT: _mount,
    WRONG_MAP: _wrong_map,
    UNSEEN: _unseen,
    VIEW: _view,
    AMBIGUITY: _ambiguity,
    START: _start,
    FLAT: _flat,
}  # of failures whose evidence is of scans
