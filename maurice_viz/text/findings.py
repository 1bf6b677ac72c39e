"""What is wrong with a recording, in words: the evidence, and how to fix it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from maurice_loaders.doctor.findings import Finding
from maurice_loaders.doctor.fixing import fixed_options
from maurice_loaders.reading.options import Reading

from ..style import Units, units_named

IN_LOG = "in what wrote the log: "
Values = Mapping[str, Any]
Text = str | Callable[[Values], str]  # a template of a sentence, or what fills it


def describe(finding: Finding) -> str:
    """Return one sentence: what is wrong."""
    values: Values = {**finding.numbers, **finding.details}
    return TURNS[finding.code][0] if finding.code in TURNS else _filled(WHAT[finding.code], values)


def evidence_for(finding: Finding, display_units: str = "m") -> str:
    """Return the numbers that support a finding, as text, with lengths in the units of a session."""
    units = units_named(display_units)
    parts = [_filled(EVIDENCE[part.kind], {**part.values, "units": units}) for part in finding.evidence]
    return "; ".join(parts)


def fix_for(finding: Finding) -> str:
    """Return how to fix it without reading options: in the program that wrote the log, or otherwise."""
    if finding.code in TURNS:
        return f"{IN_LOG}multiply the turn (heading) by {TURNS[finding.code][1]}"
    values: Values = {**finding.numbers, **finding.details}
    return _filled(FIX[finding.code], values)


def brief(finding: Finding) -> str:
    """Return in one line what is wrong and how to fix it, by options where there are some."""
    options = " ".join(fixed_options(Reading(), [finding]).corrections)
    return f"{describe(finding)} [{finding.code}]; fix: {options or fix_for(finding)}"


def _filled(text: Text, values: Values) -> str:
    return text.format_map(values) if isinstance(text, str) else text(values)


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


def _whose(values: Values) -> str:
    return "the truth" if values["whose"] == "truth" else "odometry"


def _scale(values: Values) -> str:
    if "unit" in values:
        return f"lengths of {_whose(values)} are in {values['unit']}"
    return f"lengths of {_whose(values)} have to be multiplied by {values['scale']:.3g}"


def _scale_fix(values: Values) -> str:
    if "unit" in values:
        return f"{IN_LOG}multiply the lengths of {_whose(values)} by {values['factor']:g}"
    return "check wheel diameter and ticks per turn; `maurice-replay calibrate drive SESSION` measures it"


def _shift(late_s: float, whose: str) -> str:
    if late_s > 0:
        return f"subtract {late_s:.2g} s from the t of {whose}"
    return f"add {-late_s:.2g} s to the t of {whose}"


def _place(values: Values) -> str:
    """Write a place on the robot in meters, as the options that fix it have it."""
    ahead, left = values["ahead_m"], values["left_m"]
    parts = [f"{abs(ahead):.2f} m {'ahead of' if ahead > 0 else 'behind'}"] if abs(ahead) >= 0.005 else []
    parts += [f"{abs(left):.2f} m {'left' if left > 0 else 'right'} of"] if abs(left) >= 0.005 else []
    return " and ".join(parts)


def _jump(v: Values) -> str:
    turned = f" and turns by {v['turn_deg']:+.0f} deg" if abs(v["turn_deg"]) >= 30 else ""
    more = f", its longest jump of {v['jumps']}" if v["jumps"] > 1 else ""
    again = ", back to zero: it began again there" if v["began_again"] == "True" else ""
    jump = f"odometry jumps {v['jump_m']:.3g} m{turned} in {v['within_s']:.2g} s"
    return f"{jump}, at {v['at_s']:.1f} s of the drive{again}{more}"


WHAT: Mapping[str, Text] = {
    "odometry-jump": _jump,
    "out-of-plane": "the motion leaves the plane: pitch, roll or height, which no pose in the plane has",
    "times-fall": "times fall {falls} times",
    "times-coarse": lambda v: (
        f"times have too few digits: {v['records']} records of the {v['name']} share "
        f"{'one time' if v['times'] == 1 else str(v['times']) + ' times'}"
    ),
    "too-large": "{records} records hold numbers of more than {most:g}",
    "broken": "{records} records cannot be read",
    "map-unusable": "the map that goes with the recording cannot be used",
    "time-unit": "times are in {unit}",
    "odometry-clock": "{sees} and odometry have no time in common",
    "truth-clock": "{sees} and truth have no time in common",
    "truth-apart": "{sees} have no truth",
    "truth-degrees": "the truth's headings are in degrees",
    "truth-mast": lambda v: f"the truth is of a place {_place(v)} the wheels' center, not of that center",
    "disagreement": "odometry and truth do not describe the same drive",
    "frame-absolute": "odometry holds absolute poses where motions since the last record are expected",
    "frame-world": "odometry holds steps along fixed axes where steps in the robot's own frame are expected",
    "frame-swapped": "forward and left are swapped",
    "frame-backward": "forward points backward",
    "frame-turned": "odometry's forward is {offset_deg:+d} deg off the robot's",
    "scale": _scale,
    "truth-scale": _scale,
    "turn-gain": "turns have to be multiplied by {gain:.2f}, and the motion model does so by {expected:.2f}",
    "odometry-delay": lambda v: f"odometry is {abs(v['delay_s']):.2g} s too {_late(v)} for the truth",
    "picture-delay": lambda v: f"pictures are stamped {abs(v['delay_s']):.2g} s too {_late(v)}",
    "scan-yaw": "the laser is turned by {yaw_deg:+.0f} deg from where the recording has it on the robot",
    "scan-place": lambda v: f"the laser is {_place(v)} where the recording has it on the robot",
    "scans-unused": lambda v: _UNUSED[str(v["why"])][0].format_map(v),
    "scan-mirrored": "the scans are mirrored: the laser is upside down, or its beams are counted clockwise",
    "scan-delay": lambda v: f"scans are stamped {abs(v['delay_s']):.2g} s too {_late(v)} for the odometry",
    "odometry-is-truth": "odometry repeats the truth: it was made from it, and has no errors to localize by",
    "max-range": "beams that hit nothing read {range_m:.4g} m or little more, as if something were there",
    "scans-empty": "{scans:.0f} scans in a row hit nothing, from {from_s:.1f} to {to_s:.1f} s of the drive",
    "own-body": "{share:.0%} of the beams see the robot itself",
    "map-scale": "the scans fit the map if its cells are {cell_m:.4g} m: {scale:g} times as large",
    "map-mirrored": "the map is {how}",
    "map-frame": (
        "the scans fit the map, but not where the truth has them, where {agree:.0%} of the beams agree: "
        "the map or the truth is turned or moved"
    ),
    "map-changed": lambda v: (
        f"{v['short']:.0%} of the beams end before the map's walls, {v['beyond']:.0%} behind them: the map "
        "is not as the place is now"
    ),
    "map-place": "the scans fit nowhere on the map better than by chance: it is of another place",
    "camera-yaw": (
        "the camera looks {yaw_deg:+d} deg ({low_deg:+.0f} to {high_deg:+.0f}) off where the library's "
        "pictures look at the same heading"
    ),
}

_FLIPPED: Mapping[str, str] = {
    "mirrored left to right": "mogrify -flop map.pgm (ImageMagick)",
    "mirrored upside down": "mogrify -flip map.pgm (ImageMagick): its first row has the largest y",
    "turned by 180 deg": "mogrify -rotate 180 map.pgm (ImageMagick)",
    "mirrored": "mogrify -flip map.pgm (ImageMagick), or -flop where x is mirrored",
}

_UNUSED: Mapping[str, tuple[str, str]] = {
    "hits": (
        "only {share:.0%} of the scans have {hits} beams or more that hit something",
        "check range_min and range_max, and that ranges are in meters",
    ),
    "pictures": (
        "only {share:.0%} of pictures and scans have the other within {near_s:g} s",
        "--reading picture_offset_s=... if a clock is off; max_dt_s=... lets them be farther apart",
    ),
    "odometry": (
        "only {share:.0%} of scans and odometry have the other within {near_s:g} s",
        "--reading odometry_offset_s=... if a clock is off; max_dt_s=... lets them be farther apart",
    ),
}

_BY = {
    "pictures": "the offset puts records at the times of {sees}",
    "movement": "the offset makes odometry and truth move together",
    "beginnings": "the offset aligns their beginnings; whether they began together is for you to know",
}

FIX: Mapping[str, Text] = {
    "odometry-jump": (
        "start the odometry before the recording, and never again in it; the option takes the robot to stand "
        "still during a jump"
    ),
    "out-of-plane": (
        "use a part of the drive that is level; --reading plane=... if the motion is in another plane"
    ),
    "times-coarse": "write times with all their digits where the log is made, by one clock",
    "times-fall": "sort the records by t; if they are of several clocks, put these on one first",
    "too-large": "`maurice-replay inspect SESSION` names the lines; --keep-going leaves them out",
    "broken": "`maurice-replay inspect SESSION` lists them; --keep-going leaves them out",
    "time-unit": IN_LOG + "divide times by {per_s:.0e}",
    "odometry-clock": lambda v: _BY[v["by"]].format_map(v),
    "truth-clock": lambda v: _BY[v["by"]].format_map(v),
    "truth-apart": (
        "--reading truth_offset_s=..., or the same in the log, if a clock is late; else more frequent truth"
    ),
    "truth-degrees": IN_LOG + "multiply the truth's heading by pi / 180",
    "truth-mast": IN_LOG + "write the pose of the wheels' center; so too for the drive of a library",
    "disagreement": "check that odometry and truth belong to one drive and one clock",
    "frame-absolute": IN_LOG + "write the difference to the pose before, turned into the robot's frame",
    "frame-world": (
        f"{IN_LOG}turn each step by minus the heading at its start: forward = dx cos h + dy sin h, "
        "left = dy cos h - dx sin h"
    ),
    "frame-swapped": lambda v: IN_LOG + _swapped(v),
    "frame-backward": IN_LOG + "multiply forward and left by -1",
    "frame-turned": lambda v: (
        f"{IN_LOG}turn forward and left by {v['offset_deg']:+d} deg; "
        f"with poses, add {-v['offset_deg']:+d} deg to the heading"
    ),
    "scale": _scale_fix,
    "truth-scale": _scale_fix,
    "turn-gain": (
        "`maurice-replay calibrate drive SESSION --model maurice` measures it; use it with --set motion=FILE"
    ),
    "odometry-delay": lambda v: (
        f"{IN_LOG}{_shift(v['delay_s'], 'the odometry')}; "
        f"--reading truth_offset_s={v['delay_s']:g} if pictures go with the odometry"
    ),
    "picture-delay": lambda v: f"{IN_LOG}{_shift(v['delay_s'], 'the pictures')}",
    "scan-yaw": "correct the transform from base_link to the laser by {yaw_deg:+.0f} deg",
    "scan-place": "correct the transform from base_link to the laser; a wrong wheel base looks the same",
    "scans-unused": lambda v: _UNUSED[str(v["why"])][1].format_map(v),
    "scan-mirrored": "turn the roll of the laser's transform by 180 deg, or negate angle_increment",
    "scan-delay": lambda v: f"{IN_LOG}{_shift(v['delay_s'], 'the scans')}",
    "odometry-is-truth": "take wheel odometry; --reading odometry_from_truth=true makes some with noise",
    "max-range": "--set sensor.laser.laser_max_range={range_m:.5g}, or a range_max below it in the scans",
    "scans-empty": "look at the laser and its driver at that time; the filter goes by odometry alone there",
    "own-body": (
        "--set sensor.laser.laser_min_range={range_m:.2f}, as in AMCL, or leave these beams out of the scans"
    ),
    "map-scale": "resolution: {cell_m:.4g} in map.yaml, and origin to match",
    "map-unusable": "name another with --map map.yaml; correct what publishes this one",
    "map-mirrored": lambda v: _FLIPPED[str(v["how"])],
    "map-frame": "correct origin in map.yaml, or give the truth in the map's frame",
    "map-changed": "map the place anew; until then --preset laser, or likelihood_field_prob with do_beamskip",
    "map-place": (
        "give the map.yaml of this drive; this one is {width_m:.3g} m x {height_m:.3g} m: is its resolution "
        "right? `map build` makes one from scans with truth"
    ),
    "camera-yaw": "survey with the same mounting, or `maurice-replay library build SURVEY --yaw {yaw_deg}`",
}


def _agreement(v: Values) -> str:
    text = (
        f"over {v['segments']} segments of truth, true turn / measured turn {v['gain']:.2f}, "
        f"true distance / measured distance {v['scale']:.3g}; "
        f"unexplained: turning {v['turn_unexplained']:.1%}, distance {v['way_unexplained']:.1%}"
    )
    if "usual_turn" not in v:
        return text
    return f"{text}; as it stands {v['usual_turn']:.0%} and {v['usual_way']:.0%}"


def _map(v: Values, text: str) -> str:
    return text.format(_length(v, v["map_m"])) if math.isfinite(v["map_m"]) else ""


def _length(v: Values, length_m: float) -> str:
    """Write a length with its unit, also one that is far too long because it was read wrongly."""
    units: Units = v["units"]
    length = length_m * units.per_m
    if 0 < abs(length) < 10 ** (1 - units.digits):  # that would have one digit, or none
        return f"{length:.2g} {units.name}"
    return f"{length:,.{units.digits}f} {units.name}"


def _speed(v: Values, speed_m_s: float) -> str:
    units: Units = v["units"]
    speed = speed_m_s * units.per_m
    return f"{speed:,.0f} {units.name}/s" if speed >= 1000 else f"{speed:.3g} {units.name}/s"


EVIDENCE: Mapping[str, Text] = {
    "jump": lambda v: (
        f"between all other of the {v['records']} records it goes at most at {_speed(v, v['fastest_m_s'])}"
    ),
    "off-plane": lambda v: (
        f"{v['name']}: one pose in twenty is tilted by more than {v['tilt_deg']:.0f} deg from the mean; "
        f"nine in ten are within {_length(v, v['height_m'])} of height"
    ),
    "steps": lambda v: (
        f"from one time to the next it is {v['step_s']:.3g} s (median), with {v['each']:.0f} records a time"
        if v["step_s"]
        else f"the robot moves between {v['each']:.0f} records, and all are of one time"
    ),
    "falling": "every reader refuses a time that falls",
    "limits": "a session log may not hold them; truth and odometry are at most {most:g} in size",
    "first-problem": "the first: {problem}",
    "map-problem": "{problem}",
    "spans": (
        "{sees} go from {pictures_from_s:.3f} to {pictures_to_s:.3f} s, "
        "{name} from {from_s:.3f} to {to_s:.3f} s"
    ),
    "no-truth": (
        "{share:.0%} of {pictures} {sees} have truth at their time or within "
        "{gap_s:g} s before and after; the truth before them is {age_s:.2g} s old (median)"
    ),
    "degrees": (
        "headings up to {largest:.0f}; odometry leaves {if_degrees:.1%} of the movement "
        "unexplained if they are degrees, {if_radians:.0%} if radians"
    ),
    "moved": "unexplained movement {before:.1%} as it is, {after:.1%} moved by {by_s:+.2g} s",
    "agreement": _agreement,
    "travel": "true travel is {off_deg:+.0f} deg off the measured one",
    "swing": lambda v: (
        f"in turns odometry misses the true steps by {_length(v, v['before_m'])} (median), and by "
        f"{_length(v, v['after_m'])} with the truth moved back; standard error {_length(v, v['error_m'])}"
    ),
    "span": lambda v: f"truth spans {_length(v, v['span'])}{_map(v, ', the map {}')}",
    "explained": (
        "so the true poses explain {pictures} pictures better by {nats:.2f} nats each "
        "({sigmas:.0f} standard errors)"
    ),
    "scan-pairs": lambda v: (
        f"in {v['pairs']} pairs of scans walls are {_length(v, v['before'])} apart, "
        f"and {_length(v, v['after'])} if this is so"
    ),
    "at-truth": (
        "at {scans} true poses a scan lacks {lack_before:.0f} nats on the map, "
        "and {lack_after:.0f} if this is so"
    ),
    "map-at-truth": (
        "at {scans} true poses {before:.0%} of the beams disagree with the map, and {after:.0%} if this is so"
    ),
    "scans-at-truth": "of {scans} scans at their true poses",
    "equal-steps": "{share:.0%} of {steps} steps are those of the truth, to 2 mm",
    "capped": (
        "{share:.0%} of the beams that hit something read about {range:.4g} m, and hardly any a little less; "
        "the reach is {reach:.4g} m"
    ),
    "empty": lambda v: (
        f"{v['zeros']:.0%} of their ranges are 0 and {v['nan']:.0%} no number; "
        f"{v['all']:.0f} of {v['of']} scans hit nothing"
    ),
    "same-range": "in {scans} scans of different headings they read the same, less than {range_m:.2f} m",
    "fit-where": "where each of {scans} scans fits best on the map",
    "scans-hits": "so few are a model's least, and a scan with fewer says nothing",
    "scans-pictures": "pictures make the steps, each with the scan nearest to it",
    "scans-odometry": "a scan is used at its place by the odometry",
    "fit-anywhere": (
        "where each of {scans} scans fits best {off:.0%} of its beams disagree; "
        "of mirrored scans, which fit by chance alone, {chance:.0%} do"
    ),
    "slow": lambda v: (
        f"the robot would go at {_speed(v, v['m_s'])} and turn at {v['rad_s']:.2g} rad/s; in {v['unit']} "
        f"it is {_speed(v, v['m_s'] * v['per_s'])} and {v['rad_s'] * v['per_s']:.2g} rad/s"
    ),
    "sideways": "{aside:.0%} of the distance would go sideways, and {then:.0%} does if this is so",
    "spins": "the robot would turn at {rad_s:.3g} rad/s; in degrees it is {in_degrees:.2g}",
    "one-way": (
        "nearly all of the motion is {off_deg:+.0f} deg off the forward direction, "
        "{aside:.0%} of it sideways; for a robot that can drive sideways this is no error"
    ),
    "fast": lambda v: (
        f"the robot would go at {_speed(v, v['m_s'])}{_map(v, ', on a map of {}')}; "
        f"so it is {_speed(v, v['then_m_s'])}"
    ),
}
