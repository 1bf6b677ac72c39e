"""The content of a world file (docs/simulate.md) before anything is drawn, in inches: a class per table."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from maurice_loaders.errors import InputError


class WorldError(InputError):
    """A world file is wrong: which file and key, what was found, what was expected, what to do."""


Rect = tuple[float, float, float, float]  # x1, y1, x2, y2 with x1 < x2 and y1 < y2


@dataclass(frozen=True, slots=True)
class NumberRange:
    """A number that a seed draws evenly between two."""

    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Choice:
    """A word of which a seed draws one."""

    options: tuple[str, ...]


Number = float | NumberRange
Word = str | Choice


@dataclass(frozen=True, slots=True)
class PaintPlan:
    """What a surface looks like: a texture with its colors, or an image from a file."""

    texture: Word
    color: Word | None = None  # None: the texture's own
    other: Word | None = None  # second color of textures that have two
    size_in: Number | None = None  # of the pattern: width of a board, a stripe, a tile
    image: Path | None = None  # instead of a texture


@dataclass(frozen=True, slots=True)
class LightPlan:
    """A light source: how much (radiance of a white face 1 m away) and of what color."""

    brightness: Number
    color: Word


@dataclass(frozen=True, slots=True)
class StylePlan:
    """The looks of a room: paint, light, and what hangs on its walls."""

    name: str
    colors: tuple[tuple[str, Word], ...]  # names for colors that are drawn once per room
    walls: tuple[PaintPlan, ...]  # one for all, or four: south, east, north, west
    shuffle_walls: bool
    skirting: Word
    ceiling: PaintPlan
    lamp: LightPlan
    daylight: LightPlan  # of its windows; 0 means that they are bricked up
    ambient: Number  # light after many bounces
    hang: tuple[str, ...]  # kinds of things on the walls, drawn as often as they are named
    hang_every_in: float  # one such thing every so often; 0 for none


@dataclass(frozen=True, slots=True)
class WindowPlan:
    """A window in an outer wall."""

    wall: str
    at_in: Number  # x or y of its middle
    width_in: float
    sill_in: float  # height of its lower edge
    top_in: float


@dataclass(frozen=True, slots=True)
class RoomPlan:
    """A room: the rectangle between its walls, and where its light comes from."""

    key: str
    name: str
    rect: Rect
    height_in: float
    style: str
    lamps: tuple[tuple[float, float], ...]  # places on the plan
    windows: tuple[WindowPlan, ...]


@dataclass(frozen=True, slots=True)
class DoorPlan:
    """An opening: a rectangle that reaches from one room into another through the wall between."""

    key: str
    rect: Rect
    top_in: float
    frame: Word | None  # color of its frame; None: a plain opening


@dataclass(frozen=True, slots=True)
class FloorPlan:
    """A kind of floor; later ones lie on top. The first covers everything."""

    key: str
    name: str  # what the motion model calls it
    rect: tuple[Number, Number, Number, Number] | None
    paint: PaintPlan


@dataclass(frozen=True, slots=True)
class PosterPlan:
    """An object that hangs at a given position on a wall."""

    key: str
    room: str
    wall: str
    at_in: Number  # x or y of its middle
    bottom_in: float
    size_in: tuple[float, float]  # width, height
    paint: PaintPlan


@dataclass(frozen=True, slots=True)
class FurniturePlan:
    """One piece of furniture: free-standing at a place, or with its back to a wall of a room."""

    key: str
    kind: str
    at_in: tuple[Number, ...]  # x, y of its middle; along the wall alone where `against` names one
    size_in: tuple[Number, Number]  # along its back, and from back to front
    front: Number  # radians counter-clockwise from +x: where its front looks
    room: str | None = None
    against: str | None = None
    height_in: Number | None = None  # of a block
    paint: PaintPlan | None = None  # of a block's sides
    top: PaintPlan | None = None  # of a block's top; None: as its sides


@dataclass(frozen=True, slots=True)
class LibraryPlan:
    """Where references are taken: a grid through `anchor`, wherever a robot has enough room."""

    anchor_in: tuple[float, float]
    spacing_in: float
    headings: int
    clearance_in: float  # a node nearer than this to something solid is left out


@dataclass(frozen=True, slots=True)
class WorldPlan:
    """A complete world file."""

    file: Path
    name: str
    rooms: tuple[RoomPlan, ...]
    styles: tuple[StylePlan, ...]
    shuffle_styles: bool
    doors: tuple[DoorPlan, ...]
    floors: tuple[FloorPlan, ...]
    posters: tuple[PosterPlan, ...]
    furniture: tuple[FurniturePlan, ...]  # always there
    layouts: tuple[tuple[FurniturePlan, ...], ...]  # of which a seed draws one
    library: LibraryPlan
    start: tuple[float, float, float] | None  # inches and radians
    twins: bool = False  # the second of its two rooms is the first, turned by half a turn
