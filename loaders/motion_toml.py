"""Motion parameters as a TOML file: what a session header holds under robot.motion, kept apart."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from .errors import LogError
from .regular import expect_regular

TABLE = "robot.motion"


def motion_to_toml(values: Mapping[str, Any], comments: tuple[str, ...] = ()) -> str:
    """Write motion parameters, as a header holds them, as TOML that begins with comments."""
    plain = {key: value for key, value in values.items() if not isinstance(value, Mapping)}
    lines = [*(f"# {' '.join(text.splitlines())}" for text in comments), f"[{TABLE}]"]
    lines += [f"{key} = {_value(value)}" for key, value in plain.items()]
    for floor, drift in values.get("drift", {}).items():
        lines += ["", f"[{TABLE}.drift.{_quoted(floor)}]"]
        lines += [f"{key} = {_value(value)}" for key, value in drift.items()]
    return "\n".join(lines) + "\n"


def read_motion(file: Path) -> dict[str, Any]:
    """Read the table robot.motion; what its fields mean is the motion model's to check.

    LogError where the file is no TOML, or holds no such table.
    """
    expect_regular(file, "a TOML file")
    try:
        found = tomllib.loads(file.read_text(encoding="utf-8-sig"))
    except FileNotFoundError:
        raise LogError(file, "found no such file, expected motion parameters; check the path") from None
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError, RecursionError) as problem:
        raise LogError(file, f"cannot be read as TOML: {problem}") from None
    robot = found.get("robot")
    motion = robot.get("motion") if isinstance(robot, dict) else None
    if not isinstance(motion, dict) or not motion:
        names = ", ".join(found) or "nothing"
        raise LogError(file, f"found {names}, expected a table [{TABLE}], as calibrate motion writes it")
    return motion


def _value(value: Any) -> str:
    return _quoted(value) if isinstance(value, str) else repr(float(value))


def _quoted(text: str) -> str:
    """Quote a text for TOML, whose basic strings are escaped as JSON's are, but for DEL."""
    return json.dumps(text).replace("\x7f", "\\u007f")
