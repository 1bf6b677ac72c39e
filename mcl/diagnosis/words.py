"""Complaints in words: what is wrong with odometry, times or camera, the evidence, and what mends it."""

from __future__ import annotations

import numpy as np

from .findings import Finding
from .odometry import TURNS as FACTORS
from .odometry import Agreement, Reading

SCALES = {0.001: "millimeters", 0.01: "centimeters", 0.0254: "inches", 0.3048: "feet", 1000.0: "kilometers"}
LEAST_FORWARD = np.radians(1)  # of steps along fixed axes
SAME_SCALE = 0.25  # natural log of a ratio: a slipping robot is not a wrong unit
TURNS = {
    "clockwise": ("turns are counted clockwise", "multiply the turn (heading) by -1"),
    "degrees": ("turns are in degrees", "multiply the turn (heading) by pi / 180"),
    "clockwise degrees": (
        "turns are in degrees and counted clockwise",
        "multiply the turn (heading) by -pi / 180",
    ),
}
FRAMES = {
    "absolute": (
        "odometry holds absolute poses where motions since the last record are expected",
        "write the difference to the pose before, turned into the robot's frame",
    ),
    "world": (
        "odometry holds steps along fixed axes where steps in the robot's own frame are expected",
        "turn each step by minus the heading at its start: forward = dx cos h + dy sin h, "
        "left = dy cos h - dx sin h",
    ),
}
IN_LOG = "in what wrote the log: "
ARE = {"absolute": "poses", "world": "steps"}


def turn_complaint(turn: str, evidence: str, **numbers: float) -> Finding:
    """Say that turns are not counter-clockwise radians."""
    what, mend = TURNS[turn]
    code, options = f"turn-{turn.replace(' ', '-')}", {"turn_scale": FACTORS[turn]}
    return Finding(code, what, evidence, IN_LOG + mend, numbers, options)


def frame_complaint(frame: str, evidence: str, offset_rad: float = 0.0, **numbers: float) -> Finding:
    """Say that odometry is not made of motions in the robot's frame.

    `offset_rad` is the true direction of travel minus that of steps whose heading began at zero.
    """
    what, mend = FRAMES[frame]
    options: dict[str, float | str] = {"odometry_are": ARE[frame]}
    if abs(offset_rad) > LEAST_FORWARD:
        options["odometry_forward_rad"] = _whole_degrees(-offset_rad)
    return Finding(f"frame-{frame}", what, evidence, IN_LOG + mend, numbers, options)


def _whole_degrees(angle_rad: float) -> float:
    return float(np.radians(round(float(np.degrees(angle_rad)))))


def direction_complaint(offset_rad: float, evidence: str, **numbers: float) -> Finding:
    """Say that what odometry calls forward is another direction."""
    degrees = round(float(np.degrees(offset_rad)))
    numbers = {"offset_deg": degrees, **numbers}
    near = 90 * round(degrees / 90)  # what is nearly swapped or backward is just that
    forward = -near if near and abs(degrees - near) <= 20 else -degrees
    forward = 180 if forward == -180 else forward
    options = {"odometry_forward_rad": float(np.radians(forward))}
    if abs(abs(degrees) - 90) <= 20:
        mend = (
            "write forward = -left, left = forward"
            if degrees > 0
            else "write forward = left, left = -forward"
        )
        return Finding(
            "frame-swapped", "forward and left are swapped", evidence, IN_LOG + mend, numbers, options
        )
    if abs(degrees) >= 160:
        mend = "multiply forward and left by -1"
        return Finding("frame-backward", "forward points backward", evidence, IN_LOG + mend, numbers, options)
    what = f"odometry's forward is {degrees:+d} deg off the robot's"
    mend = f"turn forward and left by {degrees:+d} deg; with poses, add {-degrees:+d} deg to the heading"
    return Finding("frame-turned", what, evidence, IN_LOG + mend, numbers, options)


def offset_complaint(offset_rad: float, evidence: str) -> Finding:
    """Say that odometry and camera do not go by the same forward; which of them is wrong is not known."""
    found = direction_complaint(offset_rad, evidence)
    degrees = round(float(np.degrees(offset_rad)))
    what = f"{found.what}, or the camera looks {-degrees:+d} deg off"
    mend = f"{found.mend}; if it is the camera, --camera-yaw {-degrees} mends it as well"
    return Finding(found.code, what, evidence, mend, found.numbers, found.options)


def scale_name(scale: float) -> tuple[str, float] | None:
    """Return the name of a unit of length by what it has in meters, and that; None for no unit's ratio."""
    near = min(SCALES, key=lambda one: abs(np.log(scale / one)))
    return (SCALES[near], near) if abs(np.log(scale / near)) < SAME_SCALE else None


def scale_complaint(scale: float, evidence: str, *, truth: bool = False, **numbers: float) -> Finding:
    """Say that lengths are no meters, or over-read by far."""
    whose = "the truth" if truth else "odometry"
    named = scale_name(scale)
    numbers = {"scale": scale, **numbers}
    field = "truth_scale" if truth else "odometry_scale"
    if named is None:
        what = f"lengths of {whose} have to be multiplied by {scale:.3g}"
        mend = (
            "check wheel diameter and ticks per turn; `maurice-replay calibrate motion SESSION` measures it"
        )
        return Finding("scale", what, evidence, mend, numbers, {field: round(scale, 4)})
    unit, factor = named
    mend = IN_LOG + f"multiply the lengths of {whose} by {factor:g}"
    code, what = "truth-scale" if truth else "scale", f"lengths of {whose} are in {unit}"
    return Finding(code, what, evidence, mend, numbers, {field: factor})


def gain_complaint(gain: float, expected: float, evidence: str) -> Finding:
    """Say that turns over-read or under-read by far."""
    what = f"turns have to be multiplied by {gain:.2f}, and the motion model does so by {expected:.2f}"
    mend = "`maurice-replay calibrate motion SESSION` measures it on a drive with truth; --motion takes it"
    numbers, options = {"gain": gain, "expected": expected}, {"turn_gain": round(gain / expected, 3)}
    return Finding("turn-gain", what, evidence, mend, numbers, options)


def delay_complaint(found: Agreement, usual: Agreement) -> Finding:
    """Say that odometry's clock is not the truth's."""
    late = round(found.shift_s, 2)
    what = f"odometry is {abs(late):.2g} s too {'late' if late > 0 else 'early'} for the truth"
    why = (
        f"unexplained movement {usual.unexplained:.1%} as it is, "
        f"{found.unexplained:.1%} moved by {-late:+.2g} s"
    )
    mend = f"{IN_LOG}{_take(late, 'the odometry')}; --truth-offset {late:g} if pictures go with the odometry"
    return Finding("odometry-delay", what, why, mend, {"delay_s": late}, {"odometry_offset_s": -late})


def picture_delay_complaint(late_s: float, evidence: str) -> Finding:
    """Say that pictures' times are wrong."""
    late = round(late_s, 6)
    what = f"pictures are stamped {abs(late):.2g} s too {'late' if late > 0 else 'early'}"
    mend = f"{IN_LOG}{_take(late, 'the pictures')}"
    return Finding("picture-delay", what, evidence, mend, {"delay_s": late}, {"picture_offset_s": -late})


def yaw_complaint(yaw_rad: float, evidence: str) -> Finding:
    """Say that the camera does not look forward."""
    degrees = round(float(np.degrees(yaw_rad)) / 5) * 5
    what = f"the camera looks {degrees:+d} deg off where the library's pictures look at the same heading"
    mend = f"survey with the same mounting, or `maurice-replay library build SURVEY --yaw {degrees}`"
    options = {"camera_yaw_rad": float(np.radians(degrees))}
    return Finding("camera-yaw", what, evidence, mend, {"yaw_deg": degrees}, options)


def _take(late_s: float, whose: str) -> str:
    if late_s > 0:
        return f"take {late_s:.2g} s from the t of {whose}"
    return f"add {-late_s:.2g} s to the t of {whose}"


def told(found: Agreement, usual: Agreement | None = None) -> str:
    """Write the numbers of a comparison with truth."""
    text = (
        f"over {found.legs} legs of truth, true turn / measured turn {found.gain:.2f}, "
        f"true way / measured way {found.scale:.3g}; "
        f"unexplained: turning {found.turn_unexplained:.1%}, way {found.way_unexplained:.1%}"
    )
    if usual is None or usual.reading == Reading() == found.reading:
        return text
    return f"{text}; as it stands {usual.turn_unexplained:.0%} and {usual.way_unexplained:.0%}"


def told_gain(nats: float, sigmas: float, pictures: int) -> str:
    """Write what is gained at the pictures."""
    return (
        f"so the true poses explain {pictures} pictures better by {nats:.2f} nats each "
        f"({sigmas:.0f} standard errors)"
    )
