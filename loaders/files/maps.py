"""Maps from files: wall segments, ROS `map.yaml` with its picture, occupancy grids; how large they may be."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from maurice_mcl.values.arrays import F64, Bool
from maurice_mcl.values.geometry import rotated
from maurice_mcl.values.map import Arena, open_arena

from ..errors import FieldError, InputError, PictureError
from .pictures import expect_size, picture_file, picture_size
from .text import MOST, expect_regular, number, read_number_rows, show, text, up_to

# How much ground a survey may cover: one wild pose would make the map's cells larger than the rooms.

MOST_SPAN_M = 10_000.0  # from its middle to its border, float32 still resolves half a millimeter


def check_span(file: Path, poses: F64, arena: Arena | None = None) -> None:
    """Raise InputError if poses (L, 2 or 3) and map are together over 10 km wide or deep."""
    xy = poses[:, :2]
    span_m = _span(xy)
    expected = f"expected at most {MOST_SPAN_M:g} m; are they in meters?"
    if span_m > MOST_SPAN_M:
        off = np.abs(xy - np.median(xy, axis=0)).max(axis=1).argmax()
        at = ", ".join(f"{v:.15g}" for v in xy[off])
        raise InputError(file, f"found poses {span_m:g} m apart, the farthest off at ({at}), {expected}")
    if arena is not None:
        span_m = _span(np.concatenate([xy, _corners(arena)]))
        if span_m > MOST_SPAN_M:
            raise InputError(file, f"found a map and poses that together span {span_m:g} m, {expected}")


def _span(points: F64) -> float:
    return float(np.ptp(points, axis=0).max())


def _corners(arena: Arena) -> F64:
    regions = (*arena.obstacles, *arena.floors, *arena.rooms)
    borders = np.array(arena.bounds).reshape(2, 2)
    return np.concatenate([borders, arena.walls.reshape(-1, 2), *(region.polygon for region in regions)])


# A map that is given with poses: a ROS map if its suffix says so, else a file of wall segments.

METERS = {"m": 1.0, "mm": 0.001}
ROS_ENDINGS = (".yaml", ".yml")


def read_map(file: Path, unit: str, poses: F64) -> Arena:
    """Read a ROS `map.yaml`, or a file of segments in `unit`, for poses (L, 2 or 3). Raises InputError."""
    if file.suffix.lower() in ROS_ENDINGS:
        arena = read_ros_map(file)
        check_span(file, poses, arena)
        return arena
    return arena_from_lines(file, unit, poses)


def arena_from_lines(file: Path, unit: str, poses: F64) -> Arena:
    """Read `x1 y1 x2 y2` per line, in "m" or "mm". InputError names a bad line.

    The bounds reach a margin beyond the poses (L, 2 or 3); walls entirely outside are left out.
    """
    if unit not in METERS:
        raise ValueError(f"found map unit {unit!r}, expected one of {', '.join(METERS)}")
    rows = read_number_rows(file, "a map", "a map", 4, "four numbers x1 y1 x2 y2", commas=True)
    segments = np.array(rows, np.float64).reshape(-1, 4)
    bounds = open_arena(poses, 1.0).bounds
    arena = Arena(bounds, _near(segments * METERS[unit], bounds))
    check_span(file, poses, arena)
    return arena


def _near(walls: F64, bounds: tuple[float, float, float, float]) -> F64:
    x_min, y_min, x_max, y_max = bounds
    x, y = walls[:, [0, 2]], walls[:, [1, 3]]
    meets_x = (x.max(axis=1) >= x_min) & (x.min(axis=1) <= x_max)
    meets_y = (y.max(axis=1) >= y_min) & (y.min(axis=1) <= y_max)
    near: F64 = walls[meets_x & meets_y]
    return near


# ROS's map.yaml, as map_server and map_saver write it: flat keys, of which one is a list of three numbers.

MOST_MAP_BYTES = 2**16
THRESHOLDS = {"occupied_thresh": 0.65, "free_thresh": 0.196}  # defaults of map_server
MODES = ("trinary", "scale")  # which differ only in what lies between free and occupied
_LINE = re.compile(r"(?P<key>\w+)\s*:(?:\s+(?P<value>.*))?$")
_ITEM = re.compile(r"\s*-\s+(?P<value>.*)$")
_COMMENT = re.compile(r"(?:^|\s)#.*$")
_QUOTED = re.compile(r"""(["'])(.*)\1$""")


def read_ros_map(file: Path) -> Arena:
    """Read `map.yaml` and its picture (PGM, PNG and others) as walls. Raises InputError.

    Robots can only be in free cells. Walls run along the borders between free cells and those that are
    occupied or unknown; the bounds are those of the free cells.
    """
    try:
        values = _yaml_values(file)
        side_m = number(values.get("resolution"), "resolution")
        origin = [number(item, "origin") for item in _three(values.get("origin"))]
        occupied, free = (number(values.get(key, usual), key) for key, usual in THRESHOLDS.items())
        mode, picture = str(values.get("mode", MODES[0])), text(values.get("image"), "image")
        if not 1e-4 <= side_m <= 1e3 or mode not in MODES or not 0 <= free <= occupied <= 1:
            expected = f"resolution of 0.1 mm to 1 km, mode {' or '.join(MODES)}, 0 <= free <= occupied <= 1"
            raise FieldError(
                f"found {side_m:g} m, mode {mode!r}, {free:g} and {occupied:g}, expected {expected}"
            )
    except FieldError as problem:
        raise InputError(file, f"{problem}; is this a ROS map?") from None
    shade = _shades(file, file.parent / picture)
    taken = shade if values.get("negate") in (1.0, "true") else 1 - shade
    is_free = np.flipud(taken < free)  # the picture's top row is the farthest in y
    rows, columns = (np.flatnonzero(is_free.any(axis=axis)) for axis in (1, 0))
    if not len(rows):
        fault = f"found no free cell in {picture} ({(taken > occupied).mean():.0%} occupied)"
        raise InputError(file, f"{fault}, expected some; see negate and free_thresh")
    low = np.array([columns[0], rows[0]], np.float64)
    cropped = is_free[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    walls, frame = cell_walls(cropped, side_m, low * side_m, (origin[0], origin[1], origin[2]), np.all)
    return Arena(frame, walls)


def _yaml_values(file: Path) -> dict[str, Any]:
    expect_regular(file, "a map")
    try:
        data = file.read_bytes()[: MOST_MAP_BYTES + 1]
        lines = data.decode("utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as problem:
        raise InputError(file, f"cannot be read as a map: {problem}") from None
    if len(data) > MOST_MAP_BYTES:
        raise InputError(file, "found more than 64 KiB, expected a map.yaml")
    found: dict[str, Any] = {}
    key = ""
    for at, line in enumerate(lines, 1):
        words = _COMMENT.sub("", line).rstrip()
        if not words or words.startswith(("---", "%")):
            continue
        if item := _ITEM.match(words):
            found[key] = [*(found.get(key) or []), _yaml_value(item["value"])]
        elif pair := _LINE.match(words):
            key = pair["key"]
            found[key] = _yaml_value(pair["value"] or "")
        else:
            raise InputError(file, f"found {show(line)}, expected KEY: VALUE as in a ROS map", at)
    return found


def _yaml_value(words: str) -> Any:
    words = words.strip()
    if words.startswith("[") and words.endswith("]"):
        return [_yaml_value(word) for word in words[1:-1].split(",")]
    if quoted := _QUOTED.match(words):
        return quoted[2]
    try:
        return float(words)
    except ValueError:
        return words or None


def _three(value: Any) -> Sequence[Any]:
    if not isinstance(value, list) or len(value) != 3:
        raise FieldError(f"found origin {show(value)}, expected [x, y, yaw]")
    return value


PGM = re.compile(rb"P[1-6](?:\s|#[^\n]*\n)+(\d{1,9})(?:\s|#[^\n]*\n)+(\d{1,9})\s")  # its width and height


def _shades(file: Path, picture: Path) -> F64:
    """Read a map's picture as shades (H, W), 0 black to 1 white; transparent pixels are unknown, 0.5."""
    try:
        data = picture_file(picture)
        pgm = PGM.match(data)
        expect_size(*((int(pgm[1]), int(pgm[2])) if pgm else picture_size(data)))
        image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    except (PictureError, cv2.error) as problem:
        reason = str(problem) if isinstance(problem, PictureError) else "it is not a picture"
        raise InputError(file, f"its image {picture} cannot be read: {reason}") from None
    if image is None or image.dtype not in (np.uint8, np.uint16):
        raise InputError(file, f"its image {picture} cannot be read as a picture, expected PGM or PNG")
    shades: F64 = np.asarray(image, np.float64) / (255 if image.dtype == np.uint8 else 65535)
    if shades.ndim == 2:
        return shades
    gray: F64 = shades[..., :3].mean(axis=2)
    return np.where(shades[..., 3] > 0, gray, 0.5) if shades.shape[2] == 4 else gray


# Cells as walls.

MOST_WALLS = 20_000  # segments; a finer grid is coarsened
MOST_CELLS = 2**28


def cell_walls(
    cells: Bool,
    side_m: float,
    low: F64,
    origin: tuple[float, float, float],
    joined: Callable[..., Any],
) -> tuple[F64, tuple[float, float, float, float]]:
    """Return the borders between cells (rows, columns) and others as walls (W, 4), and the cells' bounds.

    `low` (2,) is the cells' corner in the grid's frame, `origin` the pose of that frame in the map. If there
    are too many walls, `joined` (np.any or np.all) merges four cells into one.
    """
    height, width = cells.shape
    size = np.array([[0, 0, width, 0], [width, height, 0, height]], np.float64) * side_m
    while len(edges := _edges(cells)) > MOST_WALLS:
        cells, side_m = _coarser(cells, joined), 2 * side_m
    walls, frame = (_placed(part + np.tile(low, 2), origin) for part in (edges * side_m, size))
    if not np.abs(frame).max() <= MOST:
        raise ValueError(f"found a map at {np.abs(frame).max():g} m, expected {up_to()}")
    x, y = frame[:, 0::2], frame[:, 1::2]
    return walls, (float(x.min()), float(y.min()), float(x.max()), float(y.max()))


def _edges(cells: Bool) -> F64:
    """Return the borders between cells and others as segments (W, 4), each as long as possible."""
    padded = np.pad(cells, 1)
    level = _runs(padded[1:, 1:-1] != padded[:-1, 1:-1])
    upright = _runs((padded[1:-1, 1:] != padded[1:-1, :-1]).T)
    lying = np.column_stack([level[:, 1], level[:, 0], level[:, 2], level[:, 0]])
    return np.concatenate(
        [lying, np.column_stack([upright[:, 0], upright[:, 1], upright[:, 0], upright[:, 2]])]
    )


def _runs(border: Bool) -> F64:
    """Return the runs (K, 3) of a border: its row, where it begins, where it ends."""
    steps = np.diff(np.pad(border, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    row, begin = np.nonzero(steps == 1)
    _, end = np.nonzero(steps == -1)
    return np.column_stack([row, begin, end]).astype(np.float64)


def _coarser(cells: Bool, joined: Callable[..., Any]) -> Bool:
    height, width = cells.shape
    even = np.pad(cells, ((0, height % 2), (0, width % 2)))
    return np.asarray(joined(even.reshape(even.shape[0] // 2, 2, -1, 2), axis=(1, 3)))


def _placed(segments: F64, origin: tuple[float, float, float]) -> F64:
    """Transform segments (W, 4) from the grid's frame to the map's."""
    x_m, y_m, heading = origin
    x, y = rotated(segments[:, 0::2], segments[:, 1::2], heading)
    return np.stack([x_m + x, y_m + y], axis=2).reshape(-1, 4)
