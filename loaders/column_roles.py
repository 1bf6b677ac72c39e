"""What is in the columns of a table: told on the command line, or by their names."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from maurice_mcl.geometry import INCH_M

from .errors import LogError
from .time_bases import PER_SECOND

LENGTHS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": INCH_M}
ANGLES = {"rad": 1.0, "deg": math.pi / 180}
BEFORE = ("", "truth_", "true_", "gt_", "pose_", "pos_", "position_", "t")  # before x, y and the heading
NAMES: dict[str, tuple[str, ...]] = {  # role: names that tell it, without units, lower case
    "time": ("time", "t", "timestamp", "stamp"),
    "image": ("image", "picture", "file", "filename", "image_file", "image_path", "img"),
    "frame": ("frame", "frame_number"),
    **{axis: tuple(f"{before}{axis}" for before in BEFORE) for axis in "xy"},
    "heading": tuple(f"{before}{word}" for word in ("heading", "yaw", "theta") for before in BEFORE),
    **{f"q{axis}": (f"q{axis}", f"q_{axis}", f"quat_{axis}", f"orientation_{axis}") for axis in "wxyz"},
    "odometry_x": ("odometry_x", "odom_x"),
    "odometry_y": ("odometry_y", "odom_y"),
    "odometry_heading": ("odometry_heading", "odom_heading", "odometry_yaw", "odom_yaw", "odom_theta"),
    **{f"odometry_q{axis}": (f"odometry_q{axis}", f"odom_q{axis}", f"odom_q_{axis}") for axis in "wxyz"},
    "forward": ("forward", "dx"),
    "left": ("left", "dy"),
    "turn": ("turn", "dtheta", "dyaw"),
}
TRUTH: tuple[str, ...] = ("x", "y", "heading")
ODOMETRY: tuple[str, ...] = ("odometry_x", "odometry_y", "odometry_heading")
MOTION = ("forward", "left", "turn")
QUATERNIONS = {group: tuple(f"{group[0][:-1]}q{axis}" for axis in "wxyz") for group in (TRUTH, ODOMETRY)}
ANGULAR = ("heading", "odometry_heading", "turn")
_UNIT = re.compile(r"^(.+?)(?:[_ ]+|\s*[\[(])(ns|us|ms|s|m|cm|mm|in|deg|rad)[\])]?$")


@dataclass(frozen=True, slots=True)
class Column:
    """Where a role's values stand, and what makes them metres, radians or seconds."""

    at: int
    name: str
    unit: str | None  # None: not said


def roles_of(file: Path, header: Sequence[str], asked: Mapping[str, str]) -> dict[str, Column]:
    """Give the column of each role: the one that was asked for, or the first whose name tells it.

    `asked` is column or column:unit by role. LogError for a role or column that is not there, and for
    angles without a unit.
    """
    names = [name.strip().lstrip("#").strip() for name in header]
    found = {role: _asked(file, names, role.replace("-", "_"), value) for role, value in asked.items()}
    found = {role.replace("-", "_"): column for role, column in found.items()}
    for role in NAMES:
        named = _named(names, role)
        if role not in found and named is not None:
            found[role] = named
    for group in (TRUTH, ODOMETRY):
        _whole(found, group)
    for role in ANGULAR:
        if role in found and found[role].unit not in ANGLES:
            text = f"found column {found[role].name!r} without a unit; say --columns {role}="
            raise LogError(file, f"{text}{found[role].name}:deg or :rad", 1)
    return found


def factor(role: str, column: Column) -> float:
    """Give what a role's values are multiplied by; lengths without a unit are metres."""
    return ANGLES.get(column.unit or "", 1.0) if role in ANGULAR else LENGTHS.get(column.unit or "", 1.0)


def _asked(file: Path, names: Sequence[str], role: str, value: str) -> Column:
    if role not in NAMES:
        raise LogError(file, f"there is no role {role!r} for a column; there are {', '.join(NAMES)}")
    name, _, unit = value.rpartition(":") if value not in names and ":" in value else (value, "", "")
    if name not in names:
        raise LogError(file, f"found columns {', '.join(names) or 'none'}, expected also {name!r}", 1)
    units = PER_SECOND if role == "time" else ANGLES if role in ANGULAR else LENGTHS
    if unit and unit not in units:
        raise LogError(file, f"found unit {unit!r} of {role}, expected one of {', '.join(units)}")
    return Column(names.index(name), name, unit or _split(name)[1])


def _named(names: Sequence[str], role: str) -> Column | None:
    for known in NAMES[role]:
        for at, name in enumerate(names):
            base, unit = _split(name)
            if known in (base, name.lower()):
                return Column(at, name, unit)
    return None


def _split(name: str) -> tuple[str, str | None]:
    """Take the unit off a name: heading_deg, x [m], time(ns)."""
    matched = _UNIT.match(name.lower())
    return (name.lower(), None) if matched is None else (matched[1], matched[2])


def _whole(found: dict[str, Column], group: tuple[str, ...]) -> None:
    """Take out a pose of which something is missing, a frame number that is called x, say.

    A quaternion is as good as a heading, and is taken where both are there.
    """
    turned = QUATERNIONS[group]
    unneeded = group[2:] if all(role in found for role in turned) else turned
    for role in unneeded:
        found.pop(role, None)
    if any(role not in found for role in (*group[:2], *(turned if unneeded != turned else group[2:]))):
        for role in (*group, *turned):
            found.pop(role, None)
