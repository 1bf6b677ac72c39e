"""How a recording is read: `Reading`, and its TOML file.

Each field of `Reading` is one option. The command line, the manifest of a saved run and the file
(docs/formats.md) follow from it.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, get_type_hints

from maurice_mcl.values import Rule, checked
from maurice_mcl.values import setting_rules as rules

from ..errors import FieldError, InputError
from ..files.text import MOST, MOST_T_S, mapping, read_toml, toml_value, whole_characters
from ..files.writing import write_whole
from .plane import PLANES

MAX_DT_S = 0.1  # two samples of odometry at 10 Hz, which is slow
TIME_UNITS = ("s", "ms", "us", "ns")
JUMPING = "jumping"
MOTIONS_ARE = ("poses", "steps", JUMPING)  # what odometry may hold: the first two where motions are expected
TABLE = "reading"  # of the TOML file
RETIRED = ("odometry_from_pictures", "picture_step_m", "camera_height_m")  # in manifests of older versions

Group = Literal["source", "table", "pictures", "made odometry", "correction", "errors"]


class Meaning(NamedTuple):
    """What a field of `Reading` stands for."""

    text: str  # one line, as the command line's help shows it; angles are typed in degrees
    group: Group
    choices: tuple[str, ...] = ()  # for texts
    least: float = -math.inf  # for numbers; a number whose default is 1 is a factor, never 0


Text = str | None


@dataclass(frozen=True, slots=True)
class Reading:
    """How a recording is read; the defaults detect what they can and change nothing.

    Meters, radians, seconds. `FIELDS` holds the meaning of each.

        >>> from maurice_loaders import Reading
        >>> Reading(turn_scale=-1.0, camera_yaw_rad=1.5707963).corrections
        ('--reading turn_scale=-1', '--reading camera_yaw_deg=89.9999985')
    """

    format: Annotated[Text, Meaning("Format of the recording, if the detected one is wrong.", "source")] = (
        None
    )
    camera: Annotated[Text, Meaning("Camera whose pictures are read. [default: the first]", "source")] = None
    image_topic: Annotated[
        Text, Meaning("Topic of a bag's pictures. [default: detected, printed]", "source")
    ] = None
    scan_topic: Annotated[
        Text, Meaning("Topic of a bag's laser scans. [default: detected, printed]", "source")
    ] = None
    odometry_topic: Annotated[
        Text, Meaning("Topic of a bag's odometry. [default: detected, printed]", "source")
    ] = None
    truth_topic: Annotated[
        Text, Meaning("Topic of a bag's true poses. [default: detected, printed]", "source")
    ] = None
    localizer_topic: Annotated[
        Text, Meaning("Topics of recorded localizers, with commas. [default: detected, printed]", "source")
    ] = None
    readings: Annotated[
        Text, Meaning("Topics of a bag's numbers, as left=/ir/left. [default: all]", "source")
    ] = None
    plane: Annotated[
        Text,
        Meaning("Axes of the plane that poses in space move in. [default: auto, printed]", "source", PLANES),
    ] = None
    table: Annotated[
        Path | None, Meaning("CSV table of poses or odometry, for pictures in a folder or video.", "table")
    ] = None
    columns: Annotated[Mapping[str, str], Meaning("Columns of a table by role.", "table")] = field(
        default_factory=dict
    )
    time_unit: Annotated[Text, Meaning("Unit of the times. [default: detected]", "table", TIME_UNITS)] = None
    odometry_offset_s: Annotated[
        float, Meaning("Seconds added to the times of the odometry.", "correction")
    ] = 0.0
    truth_offset_s: Annotated[float, Meaning("Seconds added to the times of the truth.", "correction")] = 0.0
    picture_offset_s: Annotated[
        float, Meaning("Seconds added to the times of pictures and scans.", "correction")
    ] = 0.0
    odometry_scale: Annotated[
        float, Meaning("Factor for lengths of the odometry; 0.001 for millimeters.", "correction")
    ] = 1.0
    turn_scale: Annotated[
        float, Meaning("Factor for turns of the odometry; -1: clockwise, 0.0174533: degrees.", "correction")
    ] = 1.0
    turn_gain: Annotated[
        float, Meaning("True turn over measured turn; also bends a path of poses.", "correction")
    ] = 1.0
    odometry_forward_rad: Annotated[
        float, Meaning("Direction of the robot's forward in the odometry's frame.", "correction")
    ] = 0.0
    odometry_are: Annotated[
        Text,
        Meaning(
            "What odometry holds: poses or steps along fixed axes for motions, or jumps, which are left out.",
            "correction",
            MOTIONS_ARE,
        ),
    ] = None
    truth_scale: Annotated[float, Meaning("Factor for lengths of the truth.", "correction")] = 1.0
    truth_turn_scale: Annotated[float, Meaning("Factor for headings of the truth.", "correction")] = 1.0
    truth_ahead_m: Annotated[
        float, Meaning("Place on the robot that truth is of: ahead of the wheels' center.", "correction")
    ] = 0.0
    truth_left_m: Annotated[float, Meaning("The same, left of the wheels' center.", "correction")] = 0.0
    camera_yaw_rad: Annotated[
        float,
        Meaning("Direction of the camera relative to forward; headings become the camera's.", "correction"),
    ] = 0.0
    scan_yaw_rad: Annotated[
        float, Meaning("Turn of the laser on the robot, added to that of its mount.", "correction")
    ] = 0.0
    max_dt_s: Annotated[
        float, Meaning("Most seconds between a picture or scan and its odometry.", "pictures", least=0.0)
    ] = MAX_DT_S
    min_distance_m: Annotated[
        float | None,
        Meaning(
            "Least distance between pictures or scans used. [default: scans 0.25]", "pictures", least=0.0
        ),
    ] = None
    min_angle_rad: Annotated[
        float | None,
        Meaning("Least turn between pictures or scans used. [default: scans 11.5]", "pictures", least=0.0),
    ] = None
    pictures_outside: Annotated[
        bool, Meaning("Read pictures that a recording names outside its folder.", "pictures")
    ] = False
    odometry_from_truth: Annotated[
        bool, Meaning("Make odometry from the truth, with noise, if there is none.", "made odometry")
    ] = False
    odometry_seed: Annotated[int, Meaning("Seed of that noise.", "made odometry", least=0)] = 0
    camera_fov_rad: Annotated[
        float, Meaning("Horizontal field of view, for landmarks. [default: the header's]", "pictures")
    ] = 0.0
    keep_going: Annotated[bool, Meaning("Skip broken parts and report how many.", "errors")] = False

    @property
    def changed(self) -> tuple[str, ...]:
        """The names of the fields that differ from their defaults."""
        usual = Reading()
        return tuple(name for name in FIELDS if getattr(self, name) != getattr(usual, name))

    @property
    def words(self) -> tuple[str, ...]:
        """All that differs from the defaults, as typed: "--reading", "turn_scale=-1"."""
        return tuple(word for name in self.changed for word in _typed(self, name).split(" ", 1))

    @property
    def corrections(self) -> tuple[str, ...]:
        """All corrections as they are typed: "--reading turn_scale=-1"."""
        return tuple(_typed(self, name) for name in self.changed if name in CORRECTIONS)


FIELDS: dict[str, Meaning] = {
    name: hint.__metadata__[0] for name, hint in get_type_hints(Reading, include_extras=True).items()
}
Reading.__doc__ = f"{Reading.__doc__}\n    Fields:\n\n" + "\n".join(
    f"        {name}: {meaning.text}" for name, meaning in FIELDS.items()
)
CORRECTIONS = tuple(name for name, meaning in FIELDS.items() if meaning.group == "correction")


def _text(key: str, value: Any) -> str:
    if not rules.text(key, value):
        raise ValueError(f"{key}: found an empty text, expected one with characters")
    return whole_characters(value, key)


def _columns(key: str, value: Any) -> dict[str, str]:
    """Take columns by role; as text: "image=file,heading=yaw:deg"."""
    if isinstance(value, str):
        parts = [part.partition("=") for part in value.split(",")]
        if not all(role.strip() and column.strip() for role, _, column in parts):
            raise ValueError(f"{key}: found {value!r}, expected ROLE=COLUMN, with commas between them")
        return {role.strip(): column.strip() for role, _, column in parts}
    return {role: _text(key, column) for role, column in rules.table(key, value).items()}


def _factor(key: str, value: Any) -> float:
    factor: float = rules.number(-MOST, MOST)(key, value)
    if not factor:
        raise ValueError(f"{key}: found {value!r}, expected a number other than 0")
    return factor


def _rule_of(name: str) -> Rule:
    usual, meaning = getattr(Reading(), name), FIELDS[name]
    if isinstance(usual, bool):
        return rules.truth
    if isinstance(usual, Mapping):
        return _columns
    if isinstance(usual, int):
        return rules.whole(0, 2**32 - 1)
    if isinstance(usual, float) or meaning.least > -math.inf:
        most = MOST_T_S if name.endswith("_s") else MOST
        return _factor if usual == 1 else rules.number(max(meaning.least, -most), most)
    if name == "table":
        return lambda key, value: Path(_text(key, value))
    return rules.choice(*meaning.choices) if meaning.choices else _text


RULES: Mapping[str, Rule] = {name: _rule_of(name) for name in FIELDS}  # of values given as text, or typed


def option_name(name: str) -> str:
    """Return the command-line option of a field: `camera_yaw_rad` is `--reading camera_yaw_deg`."""
    return "--reading " + (name.removesuffix("_rad") + "_deg" if name.endswith("_rad") else name)


def _typed(options: Reading, name: str) -> str:
    return f"{option_name(name)}={option_value(name, getattr(options, name))}"


def option_value(name: str, value: object) -> str:
    """Return a value as it is typed, angles in degrees."""
    if isinstance(value, Mapping):
        return ",".join(f"{role}={column}" for role, column in value.items())
    if not isinstance(value, float):
        return str(value).lower() if isinstance(value, bool) else str(value)
    return f"{round(math.degrees(value) if name.endswith('_rad') else value, 7):.15g}"


# The file: one TOML table, [reading], whose keys are the fields.


def read_reading(path: str | Path) -> Reading:
    """Read options from a TOML file; missing keys have their defaults.

    The path of `table` counts from the file's folder. Raises InputError for a file that is no such TOML and
    for unknown keys or bad values.

        >>> from maurice_loaders import Reading, read_reading, write_reading
        >>> write_reading("reading.toml", Reading(turn_scale=-1.0), force=True)
        >>> read_reading("reading.toml").turn_scale
        -1.0
    """
    path = Path(path)
    tables = read_toml(path, "options of reading")
    if list(tables) != [TABLE]:
        names = ", ".join(tables) or "nothing"
        raise InputError(path, f"found {names}, expected one table [{TABLE}], as doctor -o writes it")
    try:
        options = replace(Reading(), **checked(rules.table(TABLE, tables[TABLE]), RULES))
    except ValueError as problem:
        raise InputError(path, f"{problem}; correct it there") from None
    return options if options.table is None else replace(options, table=path.parent / options.table)


def write_reading(path: str | Path, options: Reading, *, force: bool = False) -> None:
    """Write the options that differ from their defaults to a TOML file.

    Raises InputError for a file that exists, unless `force`, or cannot be written.

        >>> from maurice_loaders import Reading, read_reading, write_reading
        >>> write_reading("reading.toml", Reading(camera="left"), force=True)
        >>> read_reading("reading.toml") == Reading(camera="left")
        True
    """
    path = Path(path)
    lines = ["# How a recording is read; use it with --reading.", f"[{TABLE}]"]
    for name in options.changed:
        value = getattr(options, name)
        if isinstance(value, Path):
            value = Path(os.path.relpath(value, path.parent)).as_posix()
        degrees = f"  # {option_value(name, value)} degrees" if name.endswith("_rad") else ""
        lines.append(f"{name} = {toml_value(value)}{degrees}")
    write_whole(path, ("\n".join(lines) + "\n").encode(), force=force)


# The same in the manifest of a saved run.

ELSEWHERE = ("table", "keep_going")  # options that a manifest has under names of their own


def reading_to_json(options: Reading) -> dict[str, Any]:
    """Return the options as a manifest holds them, all but `ELSEWHERE`."""
    values = {name: getattr(options, name) for name in FIELDS if name not in ELSEWHERE}
    return {name: dict(value) if isinstance(value, Mapping) else value for name, value in values.items()}


def reading_from_json(value: Any) -> Reading:
    """Return the options that `reading_to_json` wrote. FieldError for unknown names and bad values."""
    usual, known = Reading(), {name: rule for name, rule in RULES.items() if name not in ELSEWHERE}
    values = {
        name: choice
        for name, choice in mapping(value, TABLE).items()
        if name not in RETIRED and (choice is not None or getattr(usual, name, None) is not None)
    }
    try:
        return replace(usual, **checked(values, known))
    except ValueError as problem:
        raise FieldError(str(problem)) from None
