"""Options of every command that opens a recording: its format, topics, columns, times, and which pictures."""

from __future__ import annotations

import inspect
import math
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from maurice_loaders.reading import MAX_DT_S, MOTIONS_ARE, ReadingOptions, option_name, option_value
from maurice_loaders.transforms.clocks import PER_SECOND

from .gathering import Command, in_place_of

READING = "opening"  # the parameter of a command that takes them all, an ReadingOptions


def _checked_unit(value: str | None) -> str | None:
    if value is not None and value not in PER_SECOND:
        raise typer.BadParameter(f"a unit of time is one of {', '.join(PER_SECOND)}, found {value!r}")
    return value


def _checked_factor(value: float) -> float:
    if not math.isfinite(value) or not value:
        raise typer.BadParameter(f"a factor is a number other than 0, found {value:g}")
    return value


def _checked_finite(value: float) -> float:
    if not math.isfinite(value):
        raise typer.BadParameter(f"expected a finite number, found {value:g}")
    return value


def _checked_motions(value: str | None) -> str | None:
    if value not in (None, *MOTIONS_ARE):
        raise typer.BadParameter(f"what motions are is one of {', '.join(MOTIONS_ARE)}, found {value!r}")
    return value


def _checked_columns(value: str | None) -> str | None:
    columns_of(value)
    return value


def columns_of(text: str | None) -> dict[str, str]:
    """Read `--columns image=file,heading=yaw:deg`; a usage error for anything else."""
    found: dict[str, str] = {}
    for part in (text or "").split(",") if text else ():
        role, equals, column = part.partition("=")
        if not equals or not role.strip() or not column.strip():
            raise typer.BadParameter(f"--columns is role=column, with commas between them; found {part!r}")
        found[role.strip()] = column.strip()
    return found


def _option(kind: Any, name: str, text: str, default: Any = None, **more: Any) -> inspect.Parameter:
    word = name.removeprefix("--").replace("-", "_")
    annotation = Annotated[kind, typer.Option(name, help=text, **more)]
    return inspect.Parameter(word, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=annotation)


def _number(name: str, text: str) -> inspect.Parameter:
    return _option(float, name, text, 0.0, callback=_checked_finite)


def _factor(name: str, text: str) -> inspect.Parameter:
    return _option(float, name, text, 1.0, callback=_checked_factor)


_TEXT, _FILE = str | None, Path | None
CORRECTIONS = (
    _number("--odometry-offset", "Seconds added to odometry's times."),
    _number("--truth-offset", "Seconds added to the truth's times."),
    _number("--picture-offset", "Seconds added to the pictures' times."),
    _factor("--odometry-scale", "Multiplies odometry's lengths; 0.001: they are millimetres."),
    _factor("--turn-scale", "Multiplies odometry's turns; -1: clockwise, 0.0174533: degrees."),
    _factor("--turn-gain", "True turn over measured; of poses, the way is bent with it."),
    _number("--odometry-forward", "Degrees: where the robot's forward points in the odometry's frame."),
    _option(
        _TEXT,
        "--odometry-are",
        "What odometry's motions really hold: poses, or steps along fixed axes.",
        metavar="poses|steps",
        callback=_checked_motions,
    ),
    _factor("--truth-scale", "Multiplies the truth's lengths."),
    _factor("--truth-turn-scale", "Multiplies the truth's headings."),
    _number("--camera-yaw", "Degrees by which the camera looks off forward; headings become the camera's."),
)
OPTIONS = (
    _option(_TEXT, "--format", "The recording's format, where the guess is wrong; see `formats`."),
    _option(_TEXT, "--camera", "Whose pictures are read. [default: the first one's]"),
    _option(_TEXT, "--image-topic", "Of a bag: the pictures. [default: guessed, and said]"),
    _option(_TEXT, "--odometry-topic", "Of a bag: the odometry. [default: guessed, and said]"),
    _option(_TEXT, "--truth-topic", "Of a bag: the truth. [default: guessed, and said]"),
    _option(_FILE, "--table", "A CSV table of poses or odometry, for a folder or video.", metavar="FILE.csv"),
    _option(
        _TEXT,
        "--columns",
        "What is in a table's columns: image=file,x=px,heading=yaw:deg. [default: by their names]",
        metavar="ROLE=COLUMN,...",
        callback=_checked_columns,
    ),
    _option(
        _TEXT,
        "--time-unit",
        "Unit of the times: s, ms, us or ns. [default: told from them]",
        callback=_checked_unit,
    ),
    _option(float, "--max-dt", "Most seconds between a picture and its odometry.", MAX_DT_S, min=0.0),
    _option(float, "--min-distance", "Metres to go before a picture is used.", 0.0, min=0.0),
    _option(float, "--min-angle", "Degrees to turn before a picture is used.", 0.0, min=0.0),
    _option(
        bool, "--odometry-from-truth", "Where there is none: make odometry from the truth, with noise.", False
    ),
    _option(int, "--odometry-seed", "Of that noise.", 0, min=0, max=2**32 - 1),
    *CORRECTIONS,
)


def open_options(*, keep_going: bool = False, **given: Any) -> ReadingOptions:
    """Put the options together from what was typed, by parameter name."""
    return ReadingOptions(
        format=given["format"],
        camera=given["camera"],
        image_topic=given["image_topic"],
        odometry_topic=given["odometry_topic"],
        truth_topic=given["truth_topic"],
        table=given["table"],
        columns=columns_of(given["columns"]),
        time_unit=given["time_unit"],
        odometry_offset_s=given["odometry_offset"],
        truth_offset_s=given["truth_offset"],
        picture_offset_s=given["picture_offset"],
        odometry_scale=given["odometry_scale"],
        turn_scale=given["turn_scale"],
        turn_gain=given["turn_gain"],
        odometry_forward_rad=float(np.deg2rad(given["odometry_forward"])),
        odometry_are=given["odometry_are"],
        truth_scale=given["truth_scale"],
        truth_turn_scale=given["truth_turn_scale"],
        camera_yaw_rad=float(np.deg2rad(given["camera_yaw"])),
        max_dt_s=given["max_dt"],
        min_distance_m=given["min_distance"],
        min_angle_rad=float(np.deg2rad(given["min_angle"])),
        odometry_from_truth=given["odometry_from_truth"],
        odometry_seed=given["odometry_seed"],
        keep_going=keep_going,
    )


def typed(opening: ReadingOptions) -> list[str]:
    """Give options of reading as they are typed, all but those that are as usual; `keep_going` is no such."""
    words, usual = [], ReadingOptions()
    for name in (one.name for one in fields(usual) if one.name != "keep_going"):
        value = getattr(opening, name)
        if value == getattr(usual, name):
            continue
        words.append(option_name(name))
        if isinstance(value, Mapping):
            words.append(",".join(f"{role}={column}" for role, column in value.items()))
        elif not isinstance(value, bool):
            words.append(option_value(name, value))
    return words


def reads_recordings(command: Command) -> Command:
    """Give a command all options of reading, in place of its parameter `opening`.

    Where the command has `keep_going`, that goes into the options as well.
    """
    options = {one.name: (one.annotation, one.default) for one in OPTIONS}
    return in_place_of(READING, options, open_options, command, also=["keep_going"])
