"""Occupancy grids as ROS has them: `map.yaml` with its picture, and the message OccupancyGrid."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from maurice_mcl.values import F64, FREE, MOST_MAP_CELLS, OCCUPIED, U8, UNKNOWN, OccupancyMap, rotated

from ..errors import FieldError, InputError, PictureError
from .pictures import picture_file, picture_size
from .text import MOST, number, show, text, up_to
from .writing import expect_absent, write_whole
from .yaml_text import Section, read_yaml

BLOCK_ROWS = 256
STRAIGHT_RAD = 1e-6  # a grid that is turned by less lies along the axes


@dataclass(frozen=True, slots=True, eq=False)
class PlacedGrid:
    """An occupancy grid in a frame of its own, which may be turned on the map. FieldError for bad sizes."""

    cells: U8  # (H, W) FREE, OCCUPIED or UNKNOWN; row 0 has the lowest y of the grid's frame
    cell_m: float
    origin: tuple[float, float, float]  # x_m, y_m, heading_rad of the outer corner of cell (0, 0) on the map

    def __post_init__(self) -> None:
        """Check what the numbers may be."""
        if not np.isfinite(self.origin).all():
            origin = ", ".join(f"{value:g}" for value in self.origin)
            raise FieldError(f"found its origin at ({origin}), expected numbers")
        if not 1e-4 <= self.cell_m <= 1e3:
            raise FieldError(f"found cells of {self.cell_m:g} m, expected 0.1 mm to 1 km")
        reach_m = max(self.cells.shape) * self.cell_m + max(map(abs, self.origin))
        if not reach_m <= MOST:
            raise FieldError(f"found a map at {reach_m:g} m, expected {up_to()}")

    def aligned(self) -> OccupancyMap:
        """Return the grid along the map's axes; a turned one is resampled to cells of the same size.

        Raises FieldError for a grid that is useless to a laser: without free or without occupied cells.
        """
        for state, name in ((FREE, "free"), (OCCUPIED, "occupied")):
            if not (self.cells == state).any():
                raise FieldError(f"found no {name} cell, expected some; see its thresholds")
        x_m, y_m, heading = self.origin
        if abs(math.remainder(heading, math.tau)) < STRAIGHT_RAD:
            return OccupancyMap(self.cells, self.cell_m, np.array([x_m, y_m]))
        rows, columns = self.cells.shape
        x, y = rotated(np.array([0, columns, 0, columns]), np.array([0, 0, rows, rows]), heading)
        low = np.array([x.min(), y.min()])
        width, height = (math.ceil(float(np.ptp(side)) - 1e-6) for side in (x, y))
        expect_cells(width, height, "a turned map")
        return OccupancyMap(self._turned(low, height, width), self.cell_m, low * self.cell_m + [x_m, y_m])

    def _turned(self, low: F64, height: int, width: int) -> U8:
        """Return what lies at the centers of cells along the map's axes, whose corner is at `low` cells.

        An occupied cell stays occupied: walls of one cell would have holes otherwise.
        """
        cos, sin = math.cos(self.origin[2]), math.sin(self.origin[2])
        turn = np.array([[cos, -sin], [sin, cos]])  # from this grid to the map
        shift = turn.T @ (low + 0.5) - 0.5  # where the first cell's center lies in this grid
        back = np.column_stack([turn.T, shift])
        flags = cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP
        cells = cv2.warpAffine(self.cells, back, (width, height), flags=flags, borderValue=UNKNOWN)
        for first in range(0, len(self.cells), BLOCK_ROWS):  # of large maps, so that memory stays small
            row, column = (np.argwhere(self.cells[first : first + BLOCK_ROWS] == OCCUPIED) + 0.5).T
            ends = np.floor(turn @ [column, row + first] - low[:, None]).astype(int)
            cells[np.clip(ends[1], 0, height - 1), np.clip(ends[0], 0, width - 1)] = OCCUPIED
        return np.asarray(cells, np.uint8)


def expect_cells(width: int, height: int, what: str = "a map") -> None:
    """Raise FieldError for a map without cells, or with more than `MOST_MAP_CELLS`."""
    if not 0 < width * height <= MOST_MAP_CELLS:
        expected = f"expected 1 to {MOST_MAP_CELLS:,}; larger cells make fewer"
        raise FieldError(f"found {what} of {width} x {height} cells, {expected}")


# The message. Its thresholds are those of map_saver, which makes three states of percents as well.

OCCUPIED_FROM, FREE_TO = 65, 25  # percent


def grid_of_message(message: Any) -> PlacedGrid:
    """Return the grid of an OccupancyGrid: percents, of which -1 is unknown. ValueError for a broken one."""
    info = message.info
    width, height = int(info.width), int(info.height)
    expect_cells(width, height)
    percents = np.asarray(message.data)
    if len(percents) != width * height:
        raise FieldError(f"found {len(percents)} cells, expected {width} x {height}")
    at, q = info.origin.position, info.origin.orientation
    heading = math.atan2(2 * (q.w * q.z + q.x * q.y), q.w**2 + q.x**2 - q.y**2 - q.z**2)
    cells = _of_percents(percents.reshape(height, width), FREE_TO, OCCUPIED_FROM)
    return PlacedGrid(cells, float(info.resolution), (float(at.x), float(at.y), heading))


def _of_percents(percents: Any, free: float, occupied: float) -> U8:
    known = (percents >= 0) & (percents <= 100)
    states = np.full(percents.shape, UNKNOWN, np.uint8)
    states[known & (percents <= free)] = FREE
    states[known & (percents >= occupied)] = OCCUPIED
    return states


# map.yaml, as map_server and map_saver write it, or a person.

MOST_MAP_BYTES = 2**16
ENDINGS = (".yaml", ".yml")
THRESHOLDS = {"occupied_thresh": 0.65, "free_thresh": 0.196}  # defaults of map_server
MODES = ("trinary", "scale", "raw")  # what is between free and occupied in "scale" is unknown, as to AMCL
SAVED = (0, 205, 254)  # the shades of map_saver: occupied, unknown, free
MISREAD = 0.25  # a free_thresh that map_saver long wrote in ROS 2, and by which its 205 would be free


def read_grid(file: Path) -> PlacedGrid:
    """Read `map.yaml` and its picture (PGM, PNG and others). Raises InputError."""
    try:
        values = _yaml_values(file)
        cell_m = _number(values.get("resolution"), "resolution")
        x_m, y_m, heading = (_number(item, "origin") for item in _three(values.get("origin")))
        occupied, free = (_number(values.get(key, usual), key) for key, usual in THRESHOLDS.items())
        mode, picture = str(values.get("mode") or MODES[0]), text(values.get("image"), "image")
        if mode not in MODES or not 0 <= free <= occupied <= 1:
            expected = f"mode {', '.join(MODES)}, and 0 <= free <= occupied <= 1"
            raise FieldError(f"found mode {mode!r}, {free:g} and {occupied:g}, expected {expected}")
        shades = _Shades(mode, _is_true(values.get("negate")), free, occupied)
        cells = shades.cells(*_image(file, file.parent / picture))
        return PlacedGrid(np.flipud(cells), cell_m, (x_m, y_m, heading))  # its top row is the farthest in y
    except FieldError as problem:
        raise InputError(file, f"{problem}; is this a ROS map?") from None


@dataclass(frozen=True, slots=True)
class _Shades:
    """What shades of a picture mean, by the rules of map_server."""

    mode: str
    negate: bool
    free: float
    occupied: float

    def cells(self, image: Any, most: int) -> U8:
        """Return the states (H, W) of a picture whose white is `most`; transparent pixels are unknown."""
        if image.ndim == 2:
            rules = replace(self, free=THRESHOLDS["free_thresh"]) if self._misreads(image) else self
            cells: U8 = rules.states(np.arange(most + 1) / most)[image]
            return cells
        cells = self.states(image[..., :3].mean(axis=2) / most)
        if image.shape[2] == 4:
            cells[image[..., 3] < (most if self.mode == "scale" else 1)] = UNKNOWN
        return cells

    def _misreads(self, image: Any) -> bool:
        """Return whether what map_saver wrote as unknown would be free by its own threshold."""
        saved = np.zeros(2**16, np.bool_)
        saved[list(SAVED)] = True
        doubtful = self.mode == "trinary" and not self.negate and self.free == MISREAD
        return doubtful and image.dtype == np.uint8 and bool(saved[image].all())

    def states(self, shades: F64) -> U8:
        """Return the states of shades, 0 black to 1 white."""
        dark = shades if self.negate else 1 - shades
        if self.mode == "raw":
            return _of_percents(np.rint(255 * (1 - dark)), 100 * self.free, 100 * self.occupied)
        states = np.full(shades.shape, UNKNOWN, np.uint8)
        states[dark < self.free] = FREE
        states[dark > self.occupied] = OCCUPIED
        return states


def _is_true(value: Any) -> bool:
    return value == 1.0 or str(value).lower() in ("true", "yes", "on")


def _yaml_values(file: Path) -> Section:
    values = read_yaml(file, "a ROS map.yaml", MOST_MAP_BYTES)
    if not isinstance(values, Section):
        raise InputError(file, f"found {show(values)}, expected KEY: VALUE as in a ROS map")
    return values


def _number(value: Any, what: str) -> float:
    """Return a number, also a quoted one, as map_server does. FieldError."""
    if isinstance(value, str):
        with suppress(ValueError):
            value = float(value)
    return number(value, what)


def _three(value: Any) -> Sequence[Any]:
    if not isinstance(value, list) or len(value) != 3:
        raise FieldError(f"found origin {show(value)}, expected [x, y, yaw]")
    return value


_GAP = rb"(?:\s|#[^\n]*\n)+"
PGM = re.compile(rb"P[1-6]" + _GAP + rb"(\d{1,9})" + _GAP + rb"(\d{1,9})\s")  # its width and height
WHITE = re.compile(rb"P[2356]" + _GAP + (rb"\d{1,9}" + _GAP) * 2 + rb"(\d{1,5})\s")  # its largest value


def _image(file: Path, picture: Path) -> tuple[Any, int]:
    """Read a map's picture (H, W) or (H, W, 3 or 4), 8 or 16 bits, top row first, and what is white in it."""
    try:
        data = picture_file(picture)
        pgm = PGM.match(data)
        expect_cells(*((int(pgm[1]), int(pgm[2])) if pgm else picture_size(data)))
        image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    except (PictureError, cv2.error) as problem:
        reason = str(problem) if isinstance(problem, PictureError) else "it is not a picture"
        raise InputError(file, f"its image {picture} cannot be read: {reason}") from None
    if image is None or image.dtype not in (np.uint8, np.uint16):
        raise InputError(file, f"its image {picture} cannot be read as a picture, expected PGM or PNG")
    most = 255 if image.dtype == np.uint8 else 65535
    if (white := WHITE.match(data)) and 0 < int(white[1]) < most:
        most = int(white[1])
        image = np.minimum(image, most)
    return image, most


# Writing one, as map_saver does.


def write_ros_map(occupancy: OccupancyMap, path: str | Path, *, force: bool = False) -> None:
    """Write a map as `map.yaml` and, beside it, the picture that it names (PGM); read back it is the same.

    InputError for a file that exists, unless `force`, or cannot be written, and for a map too large to read.
    """
    path = Path(path)
    picture = path.with_suffix(".pgm")
    if path.suffix.lower() not in ENDINGS:
        raise InputError(path, f"expected a name that ends with {' or '.join(ENDINGS)}")
    for target in (path, picture):
        expect_absent(target, force=force)
    shades = np.empty(3, np.uint8)
    shades[[OCCUPIED, UNKNOWN, FREE]] = SAVED
    height, width = occupancy.cells.shape
    try:
        expect_cells(width, height)
    except FieldError as problem:
        raise InputError(path, problem.message) from None
    head = b"P5\n%d %d\n255\n" % (width, height)
    write_whole(picture, head + np.flipud(shades[occupancy.cells]).tobytes(), force=force)
    x_m, y_m = (float(value) for value in occupancy.corner)
    values = {
        "image": picture.name,
        "mode": MODES[0],
        "resolution": float(occupancy.cell_m),
        "origin": [x_m, y_m, 0.0],
        "negate": 0,
        **THRESHOLDS,
    }
    write_whole(path, "".join(f"{key}: {value}\n" for key, value in values.items()).encode(), force=force)
