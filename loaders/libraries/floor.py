"""Libraries of robots without a camera: the print of a floor, and the probes that look down on it.

Such a library has no pictures and no channels. Its entries are a lattice of poses over the map, which give
the filter its free space and its radii; what a reading says about a pose comes from the print.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from maurice_mcl.arrays import F64
from maurice_mcl.floor import FloorImage
from maurice_mcl.geometry import INCH_M
from maurice_mcl.library import Library
from maurice_mcl.map import Arena
from maurice_mcl.sensor.reflectance import OUTLIERS, SPOT_M, Probe, Reflectance, fit_levels

from ..errors import FieldError, InputError, ReadingNotes
from ..files import mapping, number, read_toml
from ..formats.odometry_folder import (
    PIXEL_M,
    floor_print,
    looks_like_odometry_folder,
    open_odometry_folder,
    read_print,
    sensor_files,
)
from ..recording import Readings, Recording
from .orientation import misplaced, off_print

PLACES_A_SIDE = 24  # of the lattice, along a side of the map's area
MOST_APART_M = 0.45
HEADINGS = 8


@dataclass(frozen=True, slots=True)
class FloorProbes:
    """Probes as they were described; those without levels have them fitted to what they read."""

    probes: tuple[Probe, ...]
    unknown: frozenset[str] = frozenset()  # the names of those whose levels are not known
    outliers: float = OUTLIERS
    spot_m: float = SPOT_M

    def fitted(self, file: Path, readings: Mapping[str, F64]) -> tuple[tuple[Probe, ...], str]:
        """Return the probes with their levels, and how they came to be. InputError where that fails."""
        probes, said = [], list[str]()
        for probe in self.probes:
            if probe.name not in self.unknown:
                probes.append(probe)
                continue
            values = readings.get(probe.name, np.zeros(0))
            if not len(values):
                there = ", ".join(readings) or "none"
                found = f"found no black and white for probe {probe.name!r}, and no reading {probe.name!r} "
                found += f"in the drive to fit them to (its readings: {there})"
                raise InputError(file, f"{found}; name the probe like its reading, or give both levels")
            try:
                level = fit_levels(values)
            except ValueError as problem:
                raise InputError(file, f"{probe.name}: {problem}; give black and white") from None
            said.append(
                f"{probe.name}: black {level.black:.4g}, white {level.white:.4g}, sd {level.sd:.2f} of "
                f"the difference, {level.white_share:.0%} white"
            )
            probes.append(replace(probe, black=level.black, white=level.white, sd=level.sd))
        fit = f"levels fitted to {sum(map(len, readings.values()))} readings: {'; '.join(said)}"
        return tuple(probes), fit if said else ""


def read_probes(file: Path) -> FloorProbes:
    """Read the probes of a robot from a TOML file: tables [probes.NAME] with x_m and y_m. Raises InputError.

    NAME is that of the reading. `black`, `white` and `sd` may be left out, as may `outliers` and `spot_m`.
    """
    values = read_toml(file, "the probes of a robot")
    try:
        tables = mapping(values.get("probes", {}), "probes")
        if not tables:
            raise FieldError("found no [probes.NAME], expected one for each sensor, with x_m and y_m")
        probes = tuple(_probe(name, mapping(table, f"probes.{name}")) for name, table in tables.items())
        unknown = frozenset(name for name, table in tables.items() if "white" not in mapping(table, name))
        outliers, spot_m = (
            number(values.get(key, usual), key) for key, usual in (("outliers", OUTLIERS), ("spot_m", SPOT_M))
        )
        if not (0 < outliers < 1 and 1e-4 <= spot_m <= 1):
            raise FieldError(
                f"found outliers {outliers:g} and spot_m {spot_m:g}, expected 0 to 1, 0.1 mm to 1 m"
            )
    except FieldError as problem:
        raise InputError(file, str(problem)) from None
    return FloorProbes(probes, unknown, outliers, spot_m)


def _probe(name: str, table: dict[str, Any]) -> Probe:
    known = ("x_m", "y_m", "black", "white", "sd")
    strange = [key for key in table if key not in known]
    if strange or ("black" in table) != ("white" in table):
        what = f"{strange[0]!r}" if strange else "only one of black and white"
        raise FieldError(f"found {what} in probes.{name}, expected {', '.join(known)}")
    given = {key: number(table[key], f"probes.{name}.{key}") for key in known if key in table}
    missing = [key for key in ("x_m", "y_m") if key not in given]
    if missing:
        expected = "expected how far ahead (x_m) and to the left (y_m) of the robot's center it sits"
        raise FieldError(f"found no {' and '.join(missing)} in probes.{name}, {expected}")
    probe = Probe(name, **given)
    if probe.black == probe.white or not 0 < probe.sd <= 1:
        raise FieldError(
            f"found black = white, or an sd beyond 0 to 1, in probes.{name}, expected levels apart"
        )
    return probe


def readings_of(recording: Recording) -> dict[str, F64]:
    """Return all that the sensors of a drive measured, by name."""
    found: dict[str, list[float]] = {}
    for record in recording.records(ReadingNotes(keep_going=True)):
        if isinstance(record, Readings):
            for name, value in record.values.items():
                found.setdefault(name, []).append(value)
    return {name: np.array(values) for name, values in found.items()}


def floor_library(name: str, sensor: Reflectance, arena: Arena | None = None, units: str = "m") -> Library:
    """Return a library of a floor's print: a lattice of poses over it, no pictures, and the sensor."""
    arena = arena or Arena(sensor.floor.bounds, np.zeros((0, 4)))
    poses = lattice(arena)
    sensors = {sensor.name: sensor}
    return Library(name, poses, (None,) * len(poses), {}, arena, units, sensors)


def lattice(arena: Arena) -> F64:
    """Return poses (L, 3) all over a map's bounds, eight headings at each place.

    Places are a 24th of the map's side apart, from an inch to 0.45 m: the radii follow from that.
    """
    width, depth = arena.size_m
    apart_m = min(max(math.sqrt(width * depth) / PLACES_A_SIDE, INCH_M), MOST_APART_M)
    x_min, y_min, x_max, y_max = arena.bounds
    x, y = (_evenly(*ends, apart_m) for ends in ((x_min, x_max), (y_min, y_max)))
    headings = np.arange(HEADINGS) * 2 * np.pi / HEADINGS - np.pi
    axes = np.meshgrid(x, y, headings, indexing="ij")
    poses: F64 = np.column_stack([axis.ravel() for axis in axes])
    return poses


def _evenly(low: float, high: float, apart_m: float) -> F64:
    count = max(1, math.floor((high - low) / apart_m))
    steps = np.arange(count, dtype=np.float64) - (count - 1) / 2
    return np.asarray((low + high) / 2 + apart_m * steps, np.float64)


# Folders of aligned rows bring their floor with them.

PROBES = "probes.toml"
THYMIO = (("left", 0.072, 0.011), ("right", 0.072, -0.011))  # meters ahead and to the left of the center
MIDDLE, HALF, UNSURE_SD = 350.0, 250.0, 0.3  # above 350 is white, where the readings do not show two levels


def is_floor_folder(path: Path) -> bool:
    """Return whether a folder holds a drive over a printed floor."""
    return looks_like_odometry_folder(path) and bool(sensor_files(path))


def library_of_folder(path: Path) -> tuple[Library, str]:
    """Return the library of a drive's folder, and how the levels of its sensors came to be. InputError."""
    drive, picture = open_odometry_folder(path), floor_print(path)
    if picture is None:
        raise InputError(path, "found no map.png in it or above it, expected the print of the floor")
    light = np.asarray(read_print(picture), np.float32)
    described = _described(path)
    known = {probe.name: probe for probe in described.probes}
    strange = [name for name in drive.readings if name not in known]
    if strange:
        found = f"found sensor_{strange[0]}.txt, expected only those of {' and '.join(known)}"
        raise InputError(path, f"{found}; say where the sensors sit in {PROBES} beside it")
    probes, said = [], list[str]()
    for name, values in drive.readings.items():
        one = replace(described, probes=(known[name],))
        try:
            (probe,), how = one.fitted(path, {name: values})
        except InputError:
            probe = _split(known[name], values)
            middle = (probe.black + probe.white) / 2
            how = f"{name}: the readings do not show two levels, so above {middle:.3g} is taken as white"
        probes.append(probe)
        said.append(how)
    levels = _once([how for how in said if how])
    floor = FloorImage(light, PIXEL_M, np.zeros(3))
    sensor = Reflectance(floor, tuple(probes), described.outliers, described.spot_m, said=levels)
    if drive.truth is not None:
        known_at = np.isfinite(drive.truth).all(axis=1)
        seen = {name: values[known_at] for name, values in drive.readings.items()}
        truth = drive.truth[known_at]
        doubt = misplaced(floor, probes, seen, truth) or off_print(floor, truth)
    else:
        width, depth = floor.size_m
        size = f"{width:.4g} m along x and {depth:.4g} m along y, {100 * PIXEL_M:g} cm a pixel"
        doubt = f"without gt.txt nothing tells how map.png lies: it is taken as {size}"
    return floor_library(path.resolve().name, sensor), "; ".join(filter(None, [doubt, levels]))


def _once(said: list[str]) -> str:
    """Return in one line what was said of each sensor, without words that begin as those before."""
    begins = [one.partition(": ")[0] if one.startswith("levels fitted") else "" for one in said]
    new = [k == 0 or begins[k] != begins[k - 1] or not begins[k] for k in range(len(said))]
    return "; ".join(
        one if is_new else one.removeprefix(f"{begin}: ")
        for one, begin, is_new in zip(said, begins, new, strict=True)
    )


def _split(probe: Probe, values: F64) -> Probe:
    """Return a probe whose levels are a Thymio's, or where these do not fit the ends of the readings."""
    low, high = (float(v) for v in np.nanquantile(values, (0.02, 0.98)))
    if low <= MIDDLE <= high or high == low or high > MIDDLE - HALF:
        low, high = MIDDLE - HALF, MIDDLE + HALF
    return replace(probe, black=low, white=high, sd=UNSURE_SD)


def _described(path: Path) -> FloorProbes:
    """Return the probes that a folder describes, or the one above it; else those of a Thymio."""
    folder = path.resolve()
    file = next((one / PROBES for one in (folder, folder.parent) if (one / PROBES).is_file()), None)
    if file is not None:
        return read_probes(file)
    probes = tuple(Probe(name, x_m, y_m) for name, x_m, y_m in THYMIO)
    return FloorProbes(probes, frozenset(probe.name for probe in probes))
