"""How things look: display units, the one place where y is flipped, colors, sizes, font-safe texts.

One meaning a color: those on a map differ for every eye, also for one that confuses red and green, as a
test measures. Weights are viridis; runs are near the set of Okabe and Ito (2008). Maps and pictures have a
dark ground of their own; plots and charts have the viewer's, dark or light, so that what is drawn in them
must be seen on both: `RUN_COLORS` and `BAR`.

The viewer's font (Inter) has Latin, Greek and Cyrillic letters and many signs. For anything else its window
shows boxes, and without a screen it stops altogether (0.41), so that one Chinese letter in a label would
prevent every picture of the recording.
"""

from __future__ import annotations

import re
import unicodedata
from dataclasses import dataclass
from enum import IntEnum, auto
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from maurice_mcl.values import F32, F64, INCH_M, U8, U32, Arena

RGB = tuple[int, int, int]
RGBA = tuple[int, int, int, int]

GROUND: RGB = (16, 17, 20)
TRUTH: RGB = (255, 255, 255)  # and nothing else is white
CLOUD: RGB = (164, 214, 240)  # particles where their weight is not shown
LOST: RGB = (192, 57, 43)  # lost, kidnapped, off the map: lanes, and lines in plots
CIRCLE: RGB = (66, 116, 20)  # references, by size
RANK: RGB = (255, 208, 92)
WALL: RGB = (196, 198, 204)
OBSTACLE: RGB = (92, 94, 102)
NODE: RGB = (128, 132, 142)
MISSING: RGB = (48, 50, 56)
EMPTY: RGB = (30, 32, 37)  # of the map, and of a drawing where there is nothing
PALE: RGB = (170, 174, 184)
RULER: RGB = (96, 100, 110)  # frames and spokes of small drawings
WEIGHT: RGB = (240, 228, 66)  # bars of weight
DEAD: RGB = (150, 72, 72)  # particles that left no copy
CARRIED: RGB = (240, 240, 240)  # the way of a kidnapping: of the truth, as its disk
SETTLED: RGB = (120, 124, 134)  # particles of little weight
PHASE_MARK: RGB = (84, 99, 109)  # the present phase in the strip
FRESH: RGB = (255, 80, 220)  # particles drawn anew in this step, on every map; and such steps in plots
HEADINGS: RGB = CLOUD
# of estimates, their trails, ellipses and traces, by run:
# Okabe and Ito's orange, sky blue and green, the first two darker, or they would be faint on white; violet in
# place of their pink, which is that of fresh particles
RUN_COLORS: tuple[RGB, ...] = ((200, 132, 0), (56, 150, 210), (148, 100, 240), (0, 158, 115))
# of sensor channels in the order of their registry, the same in every run and on every view
CHANNEL_COLORS: tuple[RGB, ...] = (
    (240, 105, 120),
    (15, 90, 195),
    (165, 0, 255),
    (0, 105, 120),
    (120, 75, 165),
    (180, 30, 120),
    (75, 105, 30),
    (150, 120, 165),
    (165, 0, 195),
)
PICTURE: RGB = (135, 135, 240)  # of histograms: what the robot saw
REFERENCE: RGB = (150, 120, 75)  # of histograms: the reference that it is compared with
ODOMETRY: RGB = (255, 45, 75)  # of a drive by itself: the path by odometry alone
AGREES: RGB = (80, 230, 160)  # in pictures: marks that agree with the estimate
DISAGREES: RGB = (255, 120, 90)  # and those that do not
# beams of a laser, by what the map has where they end; those that agree have the color of whose pose it is
SHORT: RGB = (238, 85, 68)  # before a wall
BEYOND: RGB = (187, 153, 255)  # behind a wall
UNMAPPED: RGB = (136, 119, 136)  # where nobody has been
STATES: dict[str, RGB] = {  # of lanes: dark green-gray, gray, magenta, red
    "localized": (60, 78, 70),
    "converged": (60, 78, 70),
    "searching": (116, 116, 106),
    "spread": (116, 116, 106),
    "wrong and confident": (168, 50, 126),
    "lost": LOST,
    "probably-lost": LOST,
}
BAR: RGB = (136, 140, 150)  # bars and lines that are of no run and no channel
RED_GREEN_BLUE: tuple[RGBA, RGBA, RGBA] = ((200, 60, 50, 64), (50, 160, 80, 64), (60, 110, 230, 64))
PLAIN: RGBA = (136, 140, 150, 30)  # the tint of what needs none


class Order(IntEnum):
    """Draw orders of all 2D views, from the lowest up. Labels are above all layers.

    The viewer (0.41) sorts what a view has by draw order and gives each its place in that row as depth, one
    unit of rounding (float32) apart. On Vulkan's software renderer two neighbors can fall on the same depth,
    by the number of entities in the view: then a ground hides walls. So an empty entity stands between every
    two layers, in every view (`panels.views.SEPARATED`).
    """

    GROUND = auto()  # floors, pictures, frames of drawings
    OVERLAY = auto()  # pictures on a ground: likelihood, bars
    WALLS = auto()
    NODES = auto()
    CIRCLES = auto()
    PATHS = auto()  # of a whole drive
    CLOUD = auto()
    MARKS = auto()  # of sensors, in pictures and on maps; best references
    TRAILS = auto()
    OVALS = auto()  # ellipses, rings of modes, lines from estimates to the truth
    TRUTH = auto()
    CARRIED = auto()
    ESTIMATE = auto()
    EXPLAINED = auto()  # references that are explained, poses that are proposed
    KEYS = auto()  # over the map, whose margin their last row reaches into, and ovals wider than the map
    FRAME = auto()  # of a close-up: scale bar, and where the truth is


FAR_M = 10_000.0  # beyond it float32 screen coordinates get coarse, so the map's middle becomes their zero
WEIGHT_OCTAVES = 3.0  # colors run from 1/8 of the average weight to 8 times it
DARKEST_ENTRY = 48  # viridis below this entry cannot be seen on the dark ground


@dataclass(frozen=True, slots=True)
class Units:
    """What people are shown: everything is stored in meters and drawn in these units."""

    name: str  # "in" or "m", written beside every number
    per_m: float  # units in one meter
    digits: int  # decimals that make sense for a position
    grid: float  # smallest step of the ruler, in this unit
    fine: float  # drawn positions are rounded to this, which makes recordings a quarter smaller


UNITS = {"in": Units("in", 1 / INCH_M, 1, 12.0, 2.0**-6), "m": Units("m", 1.0, 2, 0.5, 2.0**-11)}


def units_named(name: str) -> Units:
    """Return the units a session's header names."""
    if name not in UNITS:
        raise ValueError(f"display units are one of {sorted(UNITS)}, found {name!r}")
    return UNITS[name]


@dataclass(frozen=True, slots=True)
class Scale:
    """Converts meters in the map's frame to drawn coordinates: display units, y pointing down."""

    units: Units
    origin_m: tuple[float, float] = (0.0, 0.0)  # the map point that is drawn at (0, 0)

    def screen(self, xy_m: NDArray[Any]) -> F32:
        """Return map points (K, 2) in meters, y up, as drawn points (K, 2) in display units, y down.

        Rerun's 2D views have y pointing down and cannot be flipped; this is the only place that knows.
        """
        steps = self.units.per_m / self.units.fine
        from_origin = np.asarray(xy_m, np.float64)[..., :2]
        if self.origin_m != (0.0, 0.0):
            from_origin = from_origin - self.origin_m
        whole = np.rint(from_origin * (steps, -steps))
        return (whole * self.units.fine).astype(np.float32)

    def length(self, length_m: float) -> float:
        """Return a length in display units."""
        return length_m * self.units.per_m

    def say(self, length_m: float) -> str:
        """Write a length with its unit: "8.0 in"."""
        return f"{self.length(length_m):.{self.units.digits}f} {self.units.name}"

    def say_area(self, area_m2: float) -> str:
        """Write an area: in square feet where lengths are inches, "12.4 ft2"; small ones with two digits."""
        inches = self.units.name == "in"
        area = area_m2 / (12 * INCH_M) ** 2 if inches else area_m2 * self.units.per_m**2
        number = f"{area:.2g}" if 0 < area < 1 else f"{area:.1f}"
        return f"{number} {'ft2' if inches else f'{self.units.name}2'}"

    def say_point(self, x_m: float, y_m: float) -> str:
        """Write a point: "(79.0, 16.0) in"."""
        x, y = (f"{self.length(coordinate_m):.{self.units.digits}f}" for coordinate_m in (x_m, y_m))
        return f"({x}, {y}) {self.units.name}"

    def say_pose(self, pose: F64) -> str:
        """Write a pose (3,): "(79.0, 16.0) in, -89 deg"."""
        return f"{self.say_point(float(pose[0]), float(pose[1]))}, {np.degrees(pose[2]):.0f} deg"


def scale_for(display_units: str, arena: Arena) -> Scale:
    """Choose the scale for a map; maps far from zero are drawn about their middle."""
    x_min, y_min, x_max, y_max = arena.bounds
    middle = ((x_min + x_max) / 2, (y_min + y_max) / 2)
    far = max(abs(middle[0]), abs(middle[1])) > FAR_M
    return Scale(units_named(display_units), middle if far else (0.0, 0.0))


def heading_vector(heading_rad: float, length: float) -> F32:
    """Return a drawn vector (1, 2) along a heading, y down."""
    return np.array([[np.cos(heading_rad), -np.sin(heading_rad)]], np.float32) * np.float32(length)


def packed(rgb: RGB, alpha: int = 255) -> int:
    """Pack a color as 0xRRGGBBAA, which is what Rerun stores."""
    red, green, blue = rgb
    return red << 24 | green << 16 | blue << 8 | alpha


def _viridis() -> U32:
    index = np.linspace(DARKEST_ENTRY, 255, 256).round().astype(np.uint8)
    bgr = cv2.applyColorMap(index[:, None], cv2.COLORMAP_VIRIDIS)[:, 0].astype(np.uint32)
    return np.asarray(bgr[:, 2] << 24 | bgr[:, 1] << 16 | bgr[:, 0] << 8 | 255, np.uint32)


# of modes, by identity: mint, rose, khaki, plum, pale green; none is a run's, or that of another mark
MODE_COLORS: tuple[RGB, ...] = (
    (90, 240, 150),
    (255, 170, 187),
    (170, 170, 119),
    (170, 102, 170),
    (190, 255, 200),
)


def faint(color: RGB) -> RGB:
    """Return the color of a trail: that of its pose, darker."""
    red, green, blue = (round(0.6 * part) for part in color)
    return red, green, blue


def mode_color(identity: int) -> RGB:
    """Return the color of a mode, the same on the map and in the bands over time."""
    return MODE_COLORS[identity % len(MODE_COLORS)]


LUT = _viridis()  # (256,) packed colors, dark to bright


def shade(share: NDArray[Any]) -> U32:
    """Return packed colors (K,) for values (K,) between 0 (dark) and 1 (bright); outside is clipped."""
    return np.asarray(LUT[_numbers(share)], np.uint32)


def _numbers(share: NDArray[Any]) -> U8:
    return np.asarray(np.clip(share * 255, 0, 255), np.uint8)


def weight_shades(log_weights: F64, of: int | None = None) -> U8:
    """Return which color of `LUT` each particle (N,) has: by its weight against the average, on a log scale.

    The average is 1/N, or one over the number of particles `of`. The middle of the scale is the average; the
    ends are 1/8 and 8 times it, at every step.
    """
    octaves = (log_weights + np.log(of or len(log_weights))) / np.log(2)
    return _numbers(0.5 + octaves / (2 * WEIGHT_OCTAVES))


def weight_colors(log_weights: F64, of: int | None = None) -> U32:
    """Return the packed color of each particle (N,), as `weight_shades` says."""
    return np.asarray(LUT[weight_shades(log_weights, of)], np.uint32)


DEEPEST = 8.0  # nats below the best place that still have a color
SAYS_NOTHING = (
    1.0  # nats: if half of the references are less behind the best, a picture tells no places apart
)


# Texts that the viewer can show: what its font has no sign for is written as a code.

GLYPH_RANGES = (
    (0x20, 0x24F),
    (0x370, 0x3E1),
    (0x3F0, 0x52F),
    (0x1E00, 0x1EFF),
    (0x2010, 0x2030),
    (0x2070, 0x20BF),
    (0x2100, 0x214F),
    (0x2190, 0x22FF),
    (0x25A0, 0x25FF),
)  # first and last of each, as tried out in 0.41
WITHOUT_GLYPH = (0x149, 0x1C4, *range(0x7F, 0xA0))
UNKNOWN_GLYPH = re.compile(
    "[^\n"
    + "".join(f"{chr(first)}-{chr(last)}" for first, last in GLYPH_RANGES)
    + "]|["
    + "".join(map(chr, WITHOUT_GLYPH))
    + "]"
)


def capital(text: str) -> str:
    """Return a text that begins with a capital letter."""
    return text[:1].upper() + text[1:]


def shortened(text: str, room: int) -> str:
    """Return a text of at most so many letters; the middle is left out, as names often end differently."""
    if len(text) <= room:
        return text
    last = (room - 1) // 2
    return f"{text[: room - 1 - last]}\N{HORIZONTAL ELLIPSIS}{text[len(text) - last :]}"


def font_safe(text: str) -> str:
    """Write every letter that the viewer cannot show as its code, like "u8D70"; others stay as they are."""
    if text.isascii():
        return text
    return UNKNOWN_GLYPH.sub(lambda letter: f"u{ord(letter[0]):04X}", unicodedata.normalize("NFC", text))


def font_safe_names(part: Any) -> None:
    """Make the titles of a container and of all that is in it font_safe, in place."""
    part.name = None if part.name is None else font_safe(str(part.name))
    for inner in getattr(part, "contents", ()):
        if hasattr(inner, "name"):
            font_safe_names(inner)
