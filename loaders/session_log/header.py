"""The header, the first line of a log, and the map as JSON."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal

import numpy as np

from maurice_mcl.values import Arena, Camera, Region, SessionInfo

from ..errors import FieldError, InputError
from ..files.maps import read_ros_map
from ..files.ros_maps import ENDINGS
from ..files.text import flag, items, mapping, number, numbers, show, text, whole_characters

REGIONS = ("obstacles", "floors", "rooms")
SESSION_LOG = "session.log"  # what a folder that holds a session calls it


def session_in(path: Path) -> Path:
    """Return the session log in a folder that holds one, as `simulate` writes it; else the path itself."""
    log = path / SESSION_LOG
    return log if log.is_file() else path


def drive_name(path: Path) -> str:
    """Return what files about a recording are named after: itself, or the folder of a `session.log`."""
    path = session_in(path).absolute()
    if path.name == SESSION_LOG:
        return path.parent.name
    return path.name if path.is_dir() else path.stem


def arena_to_json(arena: Arena) -> dict[str, Any]:
    """Return the header's `map` object: `bounds_m`, `walls_m`, `obstacles`, `floors`, `rooms`."""
    return {"bounds_m": [float(v) for v in arena.bounds], "walls_m": arena.walls.tolist()} | {
        name: [{"name": r.name, "polygon_m": r.polygon.tolist()} for r in getattr(arena, name)]
        for name in REGIONS
    }


def arena_from_json(value: Any) -> Arena:
    """Read a `map` object; all but `bounds_m` may be left out. Raises FieldError."""
    fields = mapping(value, "map")
    x_min, y_min, x_max, y_max = numbers(fields.get("bounds_m"), 4, "map.bounds_m")
    if x_min >= x_max or y_min >= y_max:
        raise FieldError(f"found map.bounds_m {fields['bounds_m']}, expected x_min < x_max and y_min < y_max")
    walls = [numbers(w, 4, "map.walls_m") for w in items(fields.get("walls_m", []), "map.walls_m")]
    regions = (tuple(_regions(fields, key)) for key in REGIONS)
    return Arena((x_min, y_min, x_max, y_max), np.array(walls, np.float64).reshape(-1, 4), *regions)


def _regions(values: dict[str, Any], key: str) -> Iterator[Region]:
    what = f"map.{key}"
    for value in items(values.get(key, []), what):
        region = mapping(value, what)
        corners = [
            numbers(c, 2, f"{what}.polygon_m") for c in items(region.get("polygon_m"), f"{what}.polygon_m")
        ]
        if len(corners) < 3:
            raise FieldError(f"found {len(corners)} corners in {what}.polygon_m, expected at least 3")
        yield Region(text(region.get("name"), f"{what}.name"), np.array(corners, np.float64))


FORMAT = "maurice-session-log"
VERSION = 1
Kind = Literal["session", "survey"]
KINDS: tuple[Kind, ...] = ("session", "survey")
UNITS = ("m", "in")


def header_of(name: str, **known: Any) -> dict[str, Any]:
    """Return the header of a session of which little is known."""
    return {"format": FORMAT, "version": VERSION, "kind": "session", "name": name} | known


def header_to_json(info: SessionInfo, kind: Kind, folder: Path) -> dict[str, Any]:
    """Return the header of a log in `folder`: what is known, and the survey's path relative to it."""
    header = header_of(info.name, kind=kind)
    header["robot"] = {"name": info.robot} | ({} if info.motion is None else {"motion": info.motion})
    header["cameras"] = {camera.name: camera_to_json(camera) for camera in info.cameras}
    header["display_units"] = info.display_units
    if info.survey is not None:
        header["survey"] = _relative(info.survey, folder)
    header["start"] = None if info.start is None else [float(v) for v in info.start]
    if info.arena is not None:
        header["map"] = arena_to_json(info.arena)
    header["notes"] = list(info.notes)
    return header | ({"captured": True} if info.captured else {})


def header_from_json(value: Any, path: Path) -> tuple[SessionInfo, Kind]:
    """Read the header object of the log at `path`. Unknown keys are ignored; raises FieldError."""
    fields = mapping(value, "a header")
    if fields.get("format") != FORMAT:
        text = f"found format {show(fields.get('format'))}, expected {FORMAT!r}; is this a session log?"
        raise FieldError(text)
    if fields.get("version") != VERSION or isinstance(fields["version"], bool):
        version = show(fields.get("version"))
        text = f"found format version {version}, expected {VERSION}; a newer maurice-replay may read it"
        raise FieldError(text)
    kind = next((k for k in KINDS if k == fields.get("kind")), None)
    if kind is None:
        raise FieldError(f"found kind {show(fields.get('kind'))}, expected 'session' or 'survey'")
    return _info(fields, path), kind


def _info(values: dict[str, Any], path: Path) -> SessionInfo:
    robot = mapping(values.get("robot") or {}, "robot")
    motion, (start, arena, survey) = robot.get("motion"), map(values.get, ("start", "map", "survey"))
    return SessionInfo(
        name=text(values.get("name", drive_name(path)), "name"),
        display_units=_units(values.get("display_units", "m")),
        robot=text(robot.get("name", "robot"), "robot.name"),
        motion=None if motion is None else _motion(motion),
        cameras=tuple(
            camera_from_json(whole_characters(n, "cameras"), c)
            for n, c in mapping(values.get("cameras") or {}, "cameras").items()
        ),
        start=None if start is None else np.array(numbers(start, 3, "start")),
        survey=None if survey is None else _path(path.parent, survey, "survey"),
        arena=_arena(path.parent, arena),
        notes=tuple(text(n, "notes") for n in items(values.get("notes") or [], "notes")),
        captured=flag(values.get("captured", False), "captured"),
    )


def _arena(folder: Path, value: Any) -> Arena | None:
    """Read the map: an object, or the path of a ROS map.yaml beside the log."""
    if not isinstance(value, str):
        return None if value is None else arena_from_json(value)
    file = _path(folder, value, "map")
    if file.suffix.lower() not in ENDINGS:
        raise FieldError(f"found map {show(value)}, expected an object, or the path of a map.yaml")
    try:
        return read_ros_map(file)
    except InputError as problem:
        raise FieldError(f"found map {show(value)}, which cannot be used: {problem}") from None


def _motion(value: Any) -> dict[str, Any]:
    motion = mapping(value, "robot.motion")
    whole_characters(json.dumps(motion, ensure_ascii=False), "robot.motion")
    return motion


def _path(folder: Path, value: Any, what: str) -> Path:
    """Return the path of a file that a header names, from the folder of its log. FieldError."""
    name = text(value, what)
    try:
        file = (folder / name).resolve()
        file.exists()  # which a name that is too long fails at
        return file
    except (OSError, RuntimeError, ValueError):  # a zero in it, links in a ring, too long
        raise FieldError(f"found {what} {show(value)}, expected the path of a file") from None


def _units(value: Any) -> str:
    if value not in UNITS:
        raise FieldError(f"found display_units {show(value)}, expected 'm' or 'in'")
    return str(value)


def camera_to_json(camera: Camera) -> dict[str, Any]:
    """Return what is known of a camera, without its name."""
    keys = ("width_px", "height_px", "horizontal_fov_rad", "yaw_rad", "height_m")
    return {key: getattr(camera, key) for key in keys if getattr(camera, key) is not None}


def camera_from_json(name: str, value: Any) -> Camera:
    """Read a camera. Raises FieldError."""
    fields = mapping(value, f"cameras.{name}")

    def size(key: str) -> int | None:
        pixels = optional(key)
        if pixels is not None and (pixels != int(pixels) or pixels < 1):
            raise FieldError(f"found cameras.{name}.{key} {pixels}, expected a whole number of pixels")
        return None if pixels is None else int(pixels)

    def optional(key: str) -> float | None:
        return None if fields.get(key) is None else number(fields[key], f"cameras.{name}.{key}")

    return Camera(
        name=name,
        width_px=size("width_px"),
        height_px=size("height_px"),
        horizontal_fov_rad=optional("horizontal_fov_rad"),
        yaw_rad=optional("yaw_rad") or 0.0,
        height_m=optional("height_m"),
    )


def _relative(survey: Path, folder: Path) -> str:
    if not survey.is_absolute():
        return survey.as_posix()
    try:
        return Path(os.path.relpath(survey.resolve(), folder.resolve())).as_posix()
    except ValueError:  # another drive
        return survey.as_posix()
