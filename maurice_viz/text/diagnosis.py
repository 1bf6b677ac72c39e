"""A diagnosis in words: what is wrong, the evidence for it, and how to fix it in the log itself.

`maurice_mcl.diagnosis` and `maurice_loaders.doctor` return findings as codes and numbers.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from maurice_mcl.diagnosis.findings import Evidence, Finding

IN_LOG = "in what wrote the log: "
Values = Mapping[str, Any]


def describe(finding: Finding) -> str:
    """Return one sentence: what is wrong."""
    if finding.code in TURNS:
        return TURNS[finding.code][0]
    return WHAT[finding.code]({**finding.numbers, **finding.details})


def evidence_for(finding: Finding) -> str:
    """Return the numbers that support a finding, as text."""
    return "; ".join(_observed(one) for one in finding.evidence)


def fix_for(finding: Finding) -> str:
    """Return how to fix it without reading options: in the program that wrote the log, or otherwise."""
    if finding.code in TURNS:
        return f"{IN_LOG}multiply the turn (heading) by {TURNS[finding.code][1]}"
    return FIX[finding.code]({**finding.numbers, **finding.details})


def _observed(one: Evidence) -> str:
    return EVIDENCE[one.kind](one.values)


TURNS = {
    "turn-clockwise": ("turns are counted clockwise", "-1"),
    "turn-degrees": ("turns are in degrees", "pi / 180"),
    "turn-clockwise-degrees": ("turns are in degrees and counted clockwise", "-pi / 180"),
}


def _late(values: Values) -> str:
    return "late" if values["delay_s"] > 0 else "early"


def _swapped(values: Values) -> str:
    if values["offset_deg"] > 0:
        return "write forward = -left, left = forward"
    return "write forward = left, left = -forward"


def _or_camera(what: str, values: Values) -> str:
    if values.get("or") != "camera":
        return what
    return f"{what}, or the camera looks {-values['offset_deg']:+d} deg off"


def _camera_too(fix: str, values: Values) -> str:
    if values.get("or") != "camera":
        return IN_LOG + fix
    return f"{IN_LOG}{fix}; for the camera: --reading camera_yaw_deg={-values['offset_deg']}"


def _whose(values: Values) -> str:
    return "the truth" if values["whose"] == "truth" else "odometry"


def _scale(values: Values) -> str:
    if "unit" in values:
        return f"lengths of {_whose(values)} are in {values['unit']}"
    return f"lengths of {_whose(values)} have to be multiplied by {values['scale']:.3g}"


def _scale_fix(values: Values) -> str:
    if "unit" in values:
        return f"{IN_LOG}multiply the lengths of {_whose(values)} by {values['factor']:g}"
    return "check wheel diameter and ticks per turn; `maurice-replay calibrate motion SESSION` measures it"


def _picture_delay(values: Values) -> str:
    what = f"pictures are stamped {abs(values['delay_s']):.2g} s too {_late(values)}"
    if values.get("or") != "odometry":
        return what
    return f"{what}, or the odometry as much too {'early' if values['delay_s'] > 0 else 'late'}"


def _shift(late_s: float, whose: str) -> str:
    if late_s > 0:
        return f"subtract {late_s:.2g} s from the t of {whose}"
    return f"add {-late_s:.2g} s to the t of {whose}"


def _no_common_time(name: str) -> Callable[[Values], str]:
    return lambda values: f"pictures and {name} have no time in common"


WHAT: Mapping[str, Callable[[Values], str]] = {
    "times-fall": lambda v: f"times fall {v['falls']} times",
    "too-large": lambda v: f"{v['records']} records hold numbers of more than {v['most']:g}",
    "broken": lambda v: f"{v['records']} records cannot be read",
    "time-unit": lambda v: f"times are in {v['unit']}",
    "odometry-clock": _no_common_time("odometry"),
    "truth-clock": _no_common_time("truth"),
    "truth-apart": lambda v: "pictures have no truth",
    "truth-degrees": lambda v: "the truth's headings are in degrees",
    "disagreement": lambda v: "odometry and truth do not describe the same drive",
    "frame-absolute": lambda v: (
        "odometry holds absolute poses where motions since the last record are expected"
    ),
    "frame-world": lambda v: (
        "odometry holds steps along fixed axes where steps in the robot's own frame are expected"
    ),
    "frame-swapped": lambda v: _or_camera("forward and left are swapped", v),
    "frame-backward": lambda v: _or_camera("forward points backward", v),
    "frame-turned": lambda v: _or_camera(
        f"odometry's forward is {v['offset_deg']:+d} deg off the robot's", v
    ),
    "scale": _scale,
    "truth-scale": _scale,
    "turn-gain": lambda v: (
        f"turns have to be multiplied by {v['gain']:.2f}, and the motion model does so by {v['expected']:.2f}"
    ),
    "odometry-delay": lambda v: f"odometry is {abs(v['delay_s']):.2g} s too {_late(v)} for the truth",
    "picture-delay": _picture_delay,
    "camera-yaw": lambda v: (
        f"the camera looks {v['yaw_deg']:+d} deg off where the library's pictures look at the same heading"
    ),
}

_BY = {
    "pictures": "the offset puts records at the times of pictures",
    "movement": "the offset makes odometry and truth move together",
    "beginnings": "the offset aligns their beginnings; whether they began together is for you to know",
}

FIX: Mapping[str, Callable[[Values], str]] = {
    "times-fall": lambda v: "sort the records by t; if they are of several clocks, put these on one first",
    "too-large": lambda v: "`maurice-replay inspect SESSION` names the lines; --keep-going leaves them out",
    "broken": lambda v: "`maurice-replay inspect SESSION` lists them; --keep-going leaves them out",
    "time-unit": lambda v: f"{IN_LOG}divide times by {v['per_s']:.0e}",
    "odometry-clock": lambda v: _BY[v["by"]],
    "truth-clock": lambda v: _BY[v["by"]],
    "truth-apart": lambda v: (
        "--reading truth_offset_s=..., or the same in the log, if a clock is late; else more frequent truth"
    ),
    "truth-degrees": lambda v: f"{IN_LOG}multiply the truth's heading by pi / 180",
    "disagreement": lambda v: "check that odometry and truth belong to one drive and one clock",
    "frame-absolute": lambda v: (
        f"{IN_LOG}write the difference to the pose before, turned into the robot's frame"
    ),
    "frame-world": lambda v: (
        f"{IN_LOG}turn each step by minus the heading at its start: forward = dx cos h + dy sin h, "
        "left = dy cos h - dx sin h"
    ),
    "frame-swapped": lambda v: _camera_too(_swapped(v), v),
    "frame-backward": lambda v: _camera_too("multiply forward and left by -1", v),
    "frame-turned": lambda v: _camera_too(
        f"turn forward and left by {v['offset_deg']:+d} deg; "
        f"with poses, add {-v['offset_deg']:+d} deg to the heading",
        v,
    ),
    "scale": _scale_fix,
    "truth-scale": _scale_fix,
    "turn-gain": lambda v: (
        "`maurice-replay calibrate motion SESSION` measures it with truth; use it with --set motion=FILE"
    ),
    "odometry-delay": lambda v: (
        f"{IN_LOG}{_shift(v['delay_s'], 'the odometry')}; "
        f"--reading truth_offset_s={v['delay_s']:g} if pictures go with the odometry"
    ),
    "picture-delay": lambda v: f"{IN_LOG}{_shift(v['delay_s'], 'the pictures')}",
    "camera-yaw": lambda v: (
        f"survey with the same mounting, or `maurice-replay library build SURVEY --yaw {v['yaw_deg']}`"
    ),
}


def _spans(v: Values) -> str:
    return (
        f"pictures go from {v['pictures_from_s']:.3f} to {v['pictures_to_s']:.3f} s, "
        f"{v['name']} from {v['from_s']:.3f} to {v['to_s']:.3f} s"
    )


def _agreement(v: Values) -> str:
    text = (
        f"over {v['segments']} segments of truth, true turn / measured turn {v['gain']:.2f}, "
        f"true distance / measured distance {v['scale']:.3g}; "
        f"unexplained: turning {v['turn_unexplained']:.1%}, distance {v['way_unexplained']:.1%}"
    )
    if "usual_turn" not in v:
        return text
    return f"{text}; as it stands {v['usual_turn']:.0%} and {v['usual_way']:.0%}"


def _map(v: Values, text: str, digits: int) -> str:
    return text.format(f"{v['map_m']:.{digits}f}") if math.isfinite(v["map_m"]) else ""


EVIDENCE: Mapping[str, Callable[[Values], str]] = {
    "falling": lambda v: "every reader refuses a time that falls",
    "limits": lambda v: (
        f"a session log may not hold them; truth and odometry are at most {v['most']:g} in size"
    ),
    "first-problem": lambda v: f"the first: {v['problem']}",
    "spans": _spans,
    "no-truth": lambda v: (
        f"{v['share']:.0%} of {v['pictures']} pictures have truth at their time or within "
        f"{v['gap_s']:g} s before and after; the truth before a picture is {v['age_s']:.2g} s old (median)"
    ),
    "foreseen": lambda v: (
        f"a short localization predicts {v['pictures']} pictures better by {v['gained']:.2f} nats each "
        f"({v['as_it_stands']:.2f} as it stands)"
    ),
    "degrees": lambda v: (
        f"headings up to {v['largest']:.0f}; odometry leaves {v['if_degrees']:.1%} of the movement "
        f"unexplained if they are degrees, {v['if_radians']:.0%} if radians"
    ),
    "moved": lambda v: (
        f"unexplained movement {v['before']:.1%} as it is, {v['after']:.1%} moved by {v['by_s']:+.2g} s"
    ),
    "agreement": _agreement,
    "travel": lambda v: f"true travel is {v['off_deg']:+.0f} deg off the measured one",
    "span": lambda v: f"truth spans {v['span']:.4g}{_map(v, ', the map {} m', 2)}",
    "explained": lambda v: (
        f"so the true poses explain {v['pictures']} pictures better by {v['nats']:.2f} nats each "
        f"({v['sigmas']:.0f} standard errors)"
    ),
    "slow": lambda v: (
        f"the robot would go at {v['m_s']:.2g} m/s and turn at {v['rad_s']:.2g} rad/s; in {v['unit']} "
        f"it is {v['m_s'] * v['per_s']:.2g} m/s and {v['rad_s'] * v['per_s']:.2g} rad/s"
    ),
    "sideways": lambda v: (
        f"{v['aside']:.0%} of the distance would go sideways, and {v['then']:.0%} does if this is so"
    ),
    "spins": lambda v: (
        f"the robot would turn at {v['rad_s']:.3g} rad/s; in degrees it is {v['in_degrees']:.2g}"
    ),
    "one-way": lambda v: (
        f"nearly all of the distance goes {v['off_deg']:+.0f} deg off what is called forward, "
        f"{v['aside']:.0%} of it sideways; a robot that can do so on purpose is fine"
    ),
    "fast": lambda v: (
        f"the robot would go at {v['m_s']:.3g} m/s{_map(v, ', on a map of {} m', 1)}; "
        f"so it is {v['then_m_s']:.2g} m/s"
    ),
}
