"""A laser's scan from above, in the robot's frame: the robot is in the middle and points up.

A scan by itself, and laid on the map around a pose, are drawn alike: what differs between two of these
pictures is the map. Under each stands how many beams are what, in their colors: the key of the picture.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache

import cv2
import numpy as np

from maurice_mcl.sensor.laser.beams import JUDGMENTS, BeamJudgment
from maurice_mcl.sensor.laser.reading import LaserReading
from maurice_mcl.values import F64, I32, OCCUPIED, U8, UNKNOWN, LaserScan, OccupancyMap, wrap

from .. import style
from ..style import RGB, Scale
from .canvas import text_size
from .indexed import IndexedColors, write

WIDTH_PX, HEIGHT_PX, CAPTION_PX = 400, 300, 34
TEXT_PX, PAD_PX, GAP_PX = 15.0, 10, 14
MIDDLE = np.array([WIDTH_PX / 2, HEIGHT_PX / 2])  # where the robot is
REACHES_M = (1.0, 1.5, 2.0, 3.0, 4.5, 6.0, 9.0, 13.0, 20.0, 30.0)  # shown ahead: few
SHOWN_SHARE = 0.9  # of the beams that hit something end within it
BAR_SHARE, BARS = 0.25, (1, 2, 5)  # of the width, at most; lengths of the scale's bar, times powers of ten
MOST_LOST, MOST_LOST_PX = 2.5, 40  # nats of a beam, and how long a bar of so many is
SEEN: RGB = (42, 46, 54)  # where a beam has passed
MAPPED_WALL: RGB = (104, 108, 118)  # quiet: the beams lie on it
MISSED: RGB = (52, 56, 66)  # along a beam that hit nothing
SAID = {"short": "short", "beyond": "beyond", "unknown": "unmapped", "miss": "no hit"}
WHAT: dict[str, RGB] = {
    "short": style.SHORT,
    "beyond": style.BEYOND,
    "unknown": style.UNMAPPED,
    "miss": style.PALE,
}

SCANS = IndexedColors()
_FREE, _WALL, _GROUND = (
    SCANS.flat(color) for color in (style.EMPTY, MAPPED_WALL, style.GROUND)
)  # as of cells
_SEEN, _MISS = SCANS.flat(SEEN), SCANS.flat(MISSED)
_INKS: dict[RGB, int] = {}  # first number of the ramp from the ground, by color
for _color in dict.fromkeys((style.PALE, style.TRUTH, *WHAT.values(), *style.RUN_COLORS)):
    _INKS[_color] = SCANS.ramp(style.GROUND, _color)
_FULL = 7  # of a ramp: the color itself
_FAINT = {color: SCANS.flat(style.faint(color)) for color in (style.TRUTH, *style.RUN_COLORS)}


def reach_of(scan: LaserScan) -> float:
    """Return how far ahead a picture of a scan shows, in meters: one of a few."""
    away = np.hypot(*scan.points().T)
    reach_m = float(np.quantile(away, SHOWN_SHARE)) if len(away) else scan.max_m
    return next((reach for reach in REACHES_M if reach >= reach_m), REACHES_M[-1])


def draw_scan(scan: LaserScan, scale: Scale) -> bytes:
    """Draw what a laser measured by itself, as a PNG: what it hit, and where it saw that nothing is."""
    image, reach_m = _blank(), reach_of(scan)
    ranges = np.where(scan.hits, scan.ranges_m, scan.misses * scan.max_m)  # 0: no answer
    along = np.stack([np.cos(scan.angles_rad), np.sin(scan.angles_rad)], axis=1)
    rim = _pixels(scan.mount[:2] + ranges[:, None] * along, reach_m)
    laser = _pixels(scan.mount[None, :2], reach_m)
    for end in rim[scan.misses].tolist():
        cv2.line(image[:HEIGHT_PX], laser[0].tolist(), end, _MISS)
    rim[scan.misses] = laser
    cv2.fillPoly(image[:HEIGHT_PX], [np.concatenate([laser, rim])], _SEEN)
    _dots(image, rim[scan.hits], _INKS[style.PALE] + _FULL, 2)
    _robot(image, _INKS[style.PALE] + _FULL)
    lines = [(f"{int(scan.hits.sum())} of {scan.size} beams hit something", style.PALE)]
    return _finished(image, reach_m, scale, lines)


def draw_scan_on_map(
    reading: LaserReading, judgment: BeamJudgment, pose: F64, there: OccupancyMap, color: RGB, scale: Scale
) -> bytes:
    """Draw a scan on the map around a pose (3,), as a PNG; beams that agree have `color`, others theirs."""
    image, reach_m = _blank(), reach_of(reading.scan)
    image[:HEIGHT_PX] = _cut_out(there, pose, reach_m)
    _dots(image, _pixels(reading.scan.points(), reach_m), _FAINT[color], 1)
    inks = {"agrees": _INKS[color], **{name: _INKS[own] for name, own in WHAT.items()}}
    ends, expected = (
        _pixels(_seen_from(pose, at), reach_m) for at in (judgment.ends, judgment.expected_ends)
    )
    for name in ("unknown", "agrees", "beyond", "short"):
        ink, those = inks[name] + _FULL, judgment.are(name)
        if name in ("short", "beyond"):
            for end, wall in zip(ends[those].tolist(), expected[those].tolist(), strict=True):
                cv2.line(image[:HEIGHT_PX], end, wall, ink)
        _dots(image, ends[those], ink, 3)
    _robot(image, _INKS[color] + _FULL)
    lines = [(f"{judgment.count('agrees')} of {reading.size} agree", color)]
    lines += [(f"{judgment.count(name)} {SAID[name]}", WHAT[name]) for name in JUDGMENTS if name in SAID]
    return _finished(image, reach_m, scale, [part for part in lines if not part[0].startswith("0 ")])


def draw_ranges(judgment: BeamJudgment, reading: LaserReading, color: RGB, scale: Scale) -> bytes:
    """Draw how far each beam reached over what the map has there, left beams left, as a PNG.

    Measured: dots, in the colors of a scan on the map; by the map: a line. Bars from above: nats lost.
    """
    image, reach_m = _blank(), float(max(judgment.measured_m.max(), judgment.expected_m.max(), 1e-3))
    angles = wrap(reading.angles_rad.astype(np.float64))  # a laser that sees all around may begin anywhere
    order, edge_rad = np.argsort(angles), max(float(np.abs(angles).max()), 1e-3)
    across = WIDTH_PX * (0.5 - 0.48 * angles / edge_rad)
    expected, measured = (
        np.rint(np.column_stack([across, HEIGHT_PX - 8 - (HEIGHT_PX - 70) * reach / reach_m])).astype(
            np.int32
        )
        for reach in (judgment.expected_m, judgment.measured_m)
    )
    pale, edge_deg = _INKS[style.PALE], np.degrees(edge_rad)
    for y in (HEIGHT_PX - 8, 62):  # no range, and the longest
        image[y, ::4] = _MISS
    write(image, scale.say(reach_m), 2, 60, TEXT_PX, pale)
    for x, nats in zip(expected[:, 0].tolist(), judgment.nats.tolist(), strict=True):
        image[: round(MOST_LOST_PX * min(-nats / MOST_LOST, 1.0)), max(x - 1, 0) : x + 2] = _WALL
    cv2.polylines(image, [expected[order]], False, pale + _FULL - 2)
    for name in JUDGMENTS:
        _dots(image, measured[judgment.are(name)], _INKS[WHAT.get(name, color)] + _FULL, 3)
    caption = f"{edge_deg:+.0f} deg", "dots: scan, line: map", f"{-edge_deg:+.0f} deg"
    wide = [text_size(text, TEXT_PX)[0] for text in caption]
    for share, text, width in zip((0.0, 0.5, 1.0), caption, wide, strict=True):
        write(image, text, 2 + share * (WIDTH_PX - 4 - width), HEIGHT_PX + CAPTION_PX - 10, TEXT_PX, pale)
    return SCANS.png(image)


def no_scan(words: str) -> bytes:
    """Draw a picture without a scan, with words in it, as a PNG."""
    image = _blank()
    write(image, words, WIDTH_PX * 0.08, HEIGHT_PX / 2, TEXT_PX, _INKS[style.PALE])
    return SCANS.png(image)


def _blank() -> U8:
    return np.full((HEIGHT_PX + CAPTION_PX, WIDTH_PX), _GROUND, np.uint8)


def _meters_per_px(reach_m: float) -> float:
    return reach_m / (HEIGHT_PX / 2)


def _pixels(points: F64, reach_m: float) -> I32:
    """Return points (K, 2) x forward, y left as pixels (K, 2) right, down."""
    at = MIDDLE - points[:, ::-1] / _meters_per_px(reach_m)
    return np.clip(np.rint(at), -10_000, 10_000).astype(np.int32)


def _seen_from(pose: F64, points: F64) -> F64:
    """Return points (K, 2) of the map in the frame of a pose (3,)."""
    x, y = (points - pose[:2]).T
    c, s = np.cos(pose[2]), np.sin(pose[2])
    return np.stack([c * x + s * y, c * y - s * x], axis=1)


def _cut_out(there: OccupancyMap, pose: F64, reach_m: float) -> U8:
    """Return the map around a pose, turned so that the robot points up; walls are at least a pixel thick."""
    cell_px = there.cell_m / _meters_per_px(reach_m)
    cells = _with_thick_walls(there, math.ceil(1 / cell_px))
    c, s = np.cos(pose[2]) / cell_px, np.sin(pose[2]) / cell_px
    turn = np.array([[s, -c], [-c, -s]])
    middle = (pose[:2] - there.corner) / there.cell_m - 0.5
    matrix = np.column_stack([turn, middle - turn @ MIDDLE])
    flags = cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP
    size = WIDTH_PX, HEIGHT_PX
    return np.asarray(
        cv2.warpAffine(cells, matrix, size, flags=flags, borderMode=cv2.BORDER_CONSTANT, borderValue=UNKNOWN),
        np.uint8,
    )


@lru_cache(maxsize=4)
def _with_thick_walls(there: OccupancyMap, thickness: int) -> U8:
    """Return the cells of a map, walls at least so many cells thick."""
    if thickness <= 1:
        return there.cells
    walls = cv2.dilate(there.occupied.astype(np.uint8), np.ones((thickness, thickness), np.uint8))
    return np.where(walls > 0, np.uint8(OCCUPIED), there.cells)


def _dots(image: U8, places: I32, ink: int, radius: int) -> None:
    """Draw squares around pixels (K, 2); those out of the picture are left out."""
    far, size = radius - 1, np.array([WIDTH_PX, HEIGHT_PX])
    x, y = places[((places >= far) & (places < size - far)).all(axis=1)].T
    across = np.arange(-far, radius)
    image[y[:, None, None] + across[:, None], x[:, None, None] + across] = ink


def _robot(image: U8, ink: int) -> None:
    """Draw where the robot is and points: an arrow head."""
    x, y = MIDDLE.astype(int).tolist()
    head = np.array([[x, y - 11], [x - 7, y + 8], [x, y + 4], [x + 7, y + 8]])
    cv2.fillPoly(image, [head], ink)
    cv2.polylines(image, [head], True, _GROUND)


def _finished(image: U8, reach_m: float, scale: Scale, said: Sequence[tuple[str, RGB]]) -> bytes:
    """Add the bar of the scale and what the beams are; encode the picture."""
    unit_px = 1 / scale.length(_meters_per_px(reach_m))
    power = 10.0 ** np.floor(np.log10(BAR_SHARE * WIDTH_PX / unit_px))
    length = max(k * power for k in BARS if k * power * unit_px <= BAR_SHARE * WIDTH_PX)
    bottom = HEIGHT_PX - PAD_PX
    ink = _INKS[style.PALE]
    image[bottom - 3 : bottom, PAD_PX : PAD_PX + round(length * unit_px)] = ink + _FULL
    write(image, f"{length:g} {scale.units.name}", PAD_PX, bottom - 8, TEXT_PX, ink)
    left, wide = 2.0, sum(text_size(text, TEXT_PX)[0] + GAP_PX for text, _ in said)
    height_px = TEXT_PX * min(1.0, WIDTH_PX / wide)
    for text, color in said:
        write(image, text, left, HEIGHT_PX + CAPTION_PX - 10, height_px, _INKS[color])
        left += (text_size(text, TEXT_PX)[0] + GAP_PX) * height_px / TEXT_PX
    return SCANS.png(image)
