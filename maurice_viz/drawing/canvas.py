"""The static ground of a map view: a drawing of floors and obstacles, with a ruler around it."""

from __future__ import annotations

import unicodedata
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np

from maurice_mcl.values import F32, F64, U8, Arena, Bool, OccupancyMap, Region

from ..style import EMPTY, GROUND, OBSTACLE, PALE, RGB, WALL, Scale

FONT = cv2.FONT_HERSHEY_DUPLEX
EDGE_GAIN = 3
AROUND_M = 0.5  # shown around the known part of a grid
THINNEST = 0.2  # share of a pixel that occupied cells take: then it shows them
JPEG_QUALITY = 90  # 60 microseconds for 176 x 144; a lower one is hardly faster and visible


def blank(height: int, width: int, color: RGB) -> U8:
    """Return an image (H, W, 3) of one color, ten times sooner than `np.full`."""
    image = np.empty((height, width, 3), np.uint8)
    cv2.rectangle(image, (0, 0), (width, height), color, cv2.FILLED)
    return image


def ascii_of(text: str) -> str:
    """Return a text in ASCII, all that OpenCV's fonts have: accents are dropped, others become '?'."""
    if text.isascii():
        return text
    bare = "".join(c for c in unicodedata.normalize("NFKD", text) if not unicodedata.combining(c))
    return bare.encode("ascii", "replace").decode("ascii")


def text_size(text: str, height_px: float) -> tuple[int, int]:
    """Return width and height in pixels of a text whose capitals are `height_px` high."""
    (width, height), _ = cv2.getTextSize(ascii_of(text), FONT, _font_scale(height_px), 1)
    return width, height


def put_text(image: U8, text: str, left: float, base: float, height_px: float, color: RGB) -> None:
    """Write a text on an image, in place, with its lower left corner at (left, base)."""
    at = (round(left), round(base))
    thickness = max(1, round(height_px / 26))
    cv2.putText(image, ascii_of(text), at, FONT, _font_scale(height_px), color, thickness, cv2.LINE_AA)


def _font_scale(height_px: float) -> float:
    return height_px / 22.0  # capitals of this font are 22 pixels high at scale 1


def shrunk(image: U8, width: int, height: int) -> U8:
    """Return a picture in another size: first by a whole factor, which is five times sooner than at once."""
    whole = max(1, min(image.shape[1] // width, image.shape[0] // height))
    if whole > 1:
        rows, columns = image.shape[0] // whole, image.shape[1] // whole
        even = image[: rows * whole, : columns * whole]
        image = np.asarray(cv2.resize(even, (columns, rows), interpolation=cv2.INTER_AREA), np.uint8)
    return np.asarray(cv2.resize(image, (width, height), interpolation=cv2.INTER_LINEAR), np.uint8)


def brightened(edges: U8) -> U8:
    """Return an edge image (H, W, 3) `EDGE_GAIN` times as bright, for display only: most edges are faint."""
    return np.asarray(cv2.convertScaleAbs(edges, alpha=EDGE_GAIN), np.uint8)


def jpeg(image: U8, quality: int = JPEG_QUALITY) -> bytes:
    """Encode a picture (H, W, 3) RGB or (H, W) gray as JPEG."""
    return _encoded(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])


def png(image: U8) -> bytes:
    """Encode a drawing (H, W, 3) RGB or (H, W) gray without loss."""
    return _encoded(".png", image, [])


def _encoded(suffix: str, image: U8, options: list[int]) -> bytes:
    bgr = image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_RGB2BGR)
    success, data = cv2.imencode(suffix, bgr, options)
    if not success:
        raise ValueError(f"cannot encode an image of shape {image.shape} as {suffix}")
    return np.asarray(data).tobytes()


LONG_SIDE_PX = 1280  # of the drawing: twice what a map view has on a screen of 1600 x 1000
MAP_MARGINS = {"left": 0.095, "right": 0.05, "top": 0.075, "bottom": 0.06}  # shares of the arena's long side
MAP_TEXT_SHARE = 0.026  # height of capitals, as a share of the arena's long side
FLOOR_COLORS: dict[str, RGB] = {"wood": (62, 44, 30), "carpet": (54, 54, 60)}
OTHER_FLOOR_COLORS: tuple[RGB, ...] = ((40, 54, 46), (56, 40, 58), (52, 52, 40))
MOST_TICKS = 9  # labels along one side of the ruler
LEAST_TEXT_SCALE = 0.85  # of the usual size of text, to make a name fit its obstacle
MOST_OVER = 1.6  # of the room in an obstacle, for a name of the least size
TICK_STEPS = (1, 2, 3, 5, 10)


@dataclass(frozen=True, slots=True)
class Extent:
    """A rectangle in drawn coordinates: display units, y pointing down."""

    left: float
    right: float
    top: float
    bottom: float

    @property
    def width(self) -> float:
        """Along x."""
        return self.right - self.left

    @property
    def height(self) -> float:
        """Along y."""
        return self.bottom - self.top

    def cut(self, outline: F32) -> F32:
        """Return an outline (K, 2) that ends at the rectangle's sides; one wholly outside as it is."""
        low, high = np.array([[self.left, self.top], [self.right, self.bottom]], np.float32)
        if (outline.max(axis=0) < low).any() or (outline.min(axis=0) > high).any():
            return outline
        return np.clip(outline, low, high)


@lru_cache(maxsize=8)
def known_part(grid: OccupancyMap) -> OccupancyMap:
    """Return the part of an occupancy map that somebody has seen, and a little around it: what is shown."""
    around = round(AROUND_M / grid.cell_m)
    known = [np.flatnonzero((~grid.unknown).any(axis=axis)) for axis in (1, 0)]
    if not known[0].size:
        return grid
    rows, columns = (slice(max(at[0] - around, 0), at[-1] + around + 1) for at in known)
    corner = grid.corner + grid.cell_m * np.array([columns.start, rows.start])
    return OccupancyMap(grid.cells[rows, columns], grid.cell_m, corner)


def shown_bounds(arena: Arena) -> tuple[float, float, float, float]:
    """Return x_min, y_min, x_max, y_max in meters of what maps show."""
    return arena.bounds if arena.occupancy is None else known_part(arena.occupancy).bounds


def long_side(arena: Arena, scale: Scale) -> float:
    """Return the longer side of what is shown of the arena in display units."""
    x_min, y_min, x_max, y_max = shown_bounds(arena)
    return max(scale.length(max(x_max - x_min, y_max - y_min)), scale.units.fine)


def arena_extent(arena: Arena, scale: Scale) -> Extent:
    """Return the rectangle of the arena itself."""
    x_min, y_min, x_max, y_max = shown_bounds(arena)
    corners = scale.screen(np.array([[x_min, y_max], [x_max, y_min]]))
    (left, top), (right, bottom) = corners.tolist()
    return Extent(left, right, top, bottom)


def map_extent(arena: Arena, scale: Scale) -> Extent:
    """Return the rectangle that a map view shows: the arena, its ruler and the key above it."""
    inner, side = arena_extent(arena, scale), long_side(arena, scale)
    return Extent(
        inner.left - MAP_MARGINS["left"] * side,
        inner.right + MAP_MARGINS["right"] * side,
        inner.top - MAP_MARGINS["top"] * side,
        inner.bottom + MAP_MARGINS["bottom"] * side,
    )


@dataclass(frozen=True, slots=True, eq=False)
class Canvas:
    """A drawing, and where it lies in a map view."""

    image: U8  # (H, W, 3) RGB
    extent: Extent
    unit_per_px: float


def draw_ground(arena: Arena, scale: Scale, *, named: bool = True) -> Canvas:
    """Draw floors and obstacles; if `named`, with their names and a ruler along two sides."""
    extent = map_extent(arena, scale)
    unit_per_px = max(extent.width, extent.height) / LONG_SIDE_PX
    shape = (round(extent.height / unit_per_px), round(extent.width / unit_per_px), 3)
    canvas = Canvas(np.full(shape, GROUND, np.uint8), extent, unit_per_px)
    text_px = MAP_TEXT_SHARE * long_side(arena, scale) / unit_per_px
    _fill_arena(canvas, arena, scale)
    if arena.occupancy is not None:
        _fill_cells(canvas, known_part(arena.occupancy), scale)
    for number, floor in enumerate(arena.floors):
        _fill_floor(canvas, _pixels(canvas, floor.polygon, scale), floor.name, number)
    for obstacle in arena.obstacles:
        _fill_obstacle(canvas, obstacle, scale)
    if named:
        _put_names(canvas, arena, scale, text_px)
        _ruler(canvas, arena, scale, text_px)
    return canvas


def _pixels(canvas: Canvas, xy_m: F64, scale: Scale) -> F64:
    shifted = scale.screen(xy_m) - (canvas.extent.left, canvas.extent.top)
    return np.asarray(shifted / canvas.unit_per_px, np.float64)


def _fill_arena(canvas: Canvas, arena: Arena, scale: Scale) -> None:
    x_min, y_min, x_max, y_max = shown_bounds(arena)
    corners = _pixels(canvas, np.array([[x_min, y_min], [x_max, y_max]]), scale).round().astype(int)
    (left, bottom), (right, top) = corners.tolist()
    canvas.image[top:bottom, left:right] = EMPTY


def _fill_cells(canvas: Canvas, occupancy: OccupancyMap, scale: Scale) -> None:
    """Fill the cells of an occupancy map: free, occupied, and as dark as the ground where nobody has been."""
    x_min, y_min, x_max, y_max = occupancy.bounds
    left, top, right, bottom = _pixels(canvas, np.array([[x_min, y_max], [x_max, y_min]]), scale).ravel()
    size = max(round(right - left), 1), max(round(bottom - top), 1)
    free, occupied = cells_in(occupancy, size)
    column, row = round(left), round(top)
    part = canvas.image[row : row + size[1], column : column + size[0]]
    shown = slice(len(part)), slice(part.shape[1])
    part[:] = np.where(free[shown][..., None], EMPTY, GROUND)
    part[occupied[shown]] = WALL


def cells_in(occupancy: OccupancyMap, size: tuple[int, int]) -> tuple[Bool, Bool]:
    """Return which pixels of a drawing of this width and height, (H, W) each, are free and occupied."""
    free, occupied = (
        cv2.resize(np.flipud(cells).astype(np.float32), size, interpolation=cv2.INTER_AREA)
        for cells in (occupancy.free, occupancy.occupied)
    )
    return np.asarray(free > 0.5), np.asarray(occupied > THINNEST)


def _fill_floor(canvas: Canvas, polygon: F64, name: str, number: int) -> None:
    """Fill a floor with its color; planks for wood and dots for carpet also show without color."""
    color = FLOOR_COLORS.get(name.lower(), OTHER_FLOOR_COLORS[number % len(OTHER_FLOOR_COLORS)])
    tile = np.full((24, 24, 3), color, np.uint8)
    if name.lower() == "wood":
        tile[::24] = np.asarray(color) * 3 // 4
    elif name.lower() == "carpet":
        tile[::12, ::12] = tile[6::12, 6::12] = np.asarray(color) * 3 // 2
    rows, columns = canvas.image.shape[:2]
    tiled = np.tile(tile, (rows // 24 + 1, columns // 24 + 1, 1))[:rows, :columns]
    mask = np.zeros((rows, columns), np.uint8)
    cv2.fillPoly(mask, [polygon.round().astype(np.int32)], 1)
    cv2.copyTo(tiled, mask, canvas.image)


def _fill_obstacle(canvas: Canvas, obstacle: Region, scale: Scale) -> None:
    polygon = _pixels(canvas, obstacle.polygon, scale)
    cv2.fillPoly(canvas.image, [polygon.round().astype(np.int32)], OBSTACLE, cv2.LINE_AA)


def _put_names(canvas: Canvas, arena: Arena, scale: Scale, text_px: float) -> None:
    for obstacle in arena.obstacles:
        _put_inside(canvas.image, obstacle.name, _pixels(canvas, obstacle.polygon, scale), text_px)
    for region, at_top in [(r, True) for r in arena.rooms] + [(f, False) for f in arena.floors]:
        _put_name(canvas.image, region.name, _pixels(canvas, region.polygon, scale), at_top, text_px)


def _put_inside(image: U8, name: str, polygon: F64, text_px: float) -> None:
    """Write a name in the middle of an obstacle, smaller if need be; pale where it is over the edge."""
    room = np.ptp(polygon[:, 0]) * 0.9
    width, _ = text_size(name, text_px)
    shrunk = max(min(text_px, text_px * room / max(width, 1)), LEAST_TEXT_SCALE * text_px)
    if width * shrunk / text_px < MOST_OVER * room:
        color = GROUND if width * shrunk / text_px < room / 0.9 else PALE
        middle = (polygon.min(axis=0) + polygon.max(axis=0)) / 2
        width, height = text_size(name, shrunk)
        inside = image.shape[1] * 0.95 - width  # of the wall to the right
        put_text(image, name, min(middle[0] - width / 2, inside), middle[1] + height / 2, shrunk, color)


def _put_name(image: U8, name: str, polygon: F64, at_top: bool, text_px: float) -> None:
    """Write a name near the top or bottom of its polygon, at the first place where it covers nothing."""
    width, _ = text_size(name, text_px)
    low, high = polygon.min(axis=0), polygon.max(axis=0)
    bases = np.arange(low[1] + 1.8 * text_px, high[1] - 0.6 * text_px, text_px / 2)
    for base in bases if at_top else bases[::-1]:
        for left in np.arange(low[0] + 0.8 * text_px, high[0] - width - 0.8 * text_px, text_px):
            if _is_bare(image[round(base - 1.3 * text_px) : round(base), round(left) : round(left + width)]):
                put_text(image, name, left, base, text_px, PALE)
                return


def _is_bare(part: U8) -> bool:
    """Return whether part of the drawing (h, w, 3) is free of obstacles and text."""
    return not any((part == color).all(axis=2).any() for color in (OBSTACLE, PALE))


def ticks(low: float, high: float, smallest: float, most: float = MOST_TICKS) -> list[float]:
    """Return round values from low to high, at most `most`, spaced by a multiple of `smallest`."""
    step = smallest
    while (high - low) / step >= max(most, 1):
        power = 10 ** int(np.floor(np.log10(step / smallest) + 1e-9))
        step = next(s * power * smallest for s in TICK_STEPS if s * power * smallest > step * 1.001)
    first = int(np.ceil(low / step - 1e-9))
    return [k * step for k in range(first, int(np.floor(high / step + 1e-9)) + 1)]


def _ruler(canvas: Canvas, arena: Arena, scale: Scale, text_px: float) -> None:
    x_min, y_min, x_max, y_max = (scale.length(v) for v in shown_bounds(arena))
    low = _pixels(canvas, np.array([shown_bounds(arena)[:2]]), scale)[0]
    px = 1 / canvas.unit_per_px
    across = ticks(x_min, x_max, scale.units.grid, min(MOST_TICKS, (x_max - x_min) * px / (4 * text_px)))
    for x in across:
        label = f"{x:g} {scale.units.name}" if x == across[-1] else f"{x:g}"
        width, height = text_size(label, text_px)
        at = low[0] + (x - x_min) * px
        put_text(canvas.image, label, at - width / 2, low[1] + 1.9 * text_px, text_px, PALE)
        cv2.line(canvas.image, (round(at), round(low[1])), (round(at), round(low[1] + text_px / 2)), PALE, 2)
    for y in ticks(y_min, y_max, scale.units.grid, min(MOST_TICKS, (y_max - y_min) * px / (2 * text_px))):
        width, height = text_size(f"{y:g}", text_px)
        at = low[1] - (y - y_min) * px
        put_text(canvas.image, f"{y:g}", low[0] - width - 0.8 * text_px, at + height / 2, text_px, PALE)
        cv2.line(canvas.image, (round(low[0] - text_px / 2), round(at)), (round(low[0]), round(at)), PALE, 2)
