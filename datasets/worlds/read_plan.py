"""From a TOML file to a `WorldPlan`: every key checked, nothing drawn."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

from maurice_loaders.errors import InputError
from maurice_loaders.files.text import read_toml
from maurice_mcl.values import expected_one_of

from .draw import TEXTURES, read_image
from .furniture import MAKERS
from .hangings import HANGINGS
from .palettes import COLORS, GROUPS, LIGHTS, is_color, is_light
from .plan import (
    DoorPlan,
    FloorPlan,
    FurniturePlan,
    LibraryPlan,
    LightPlan,
    Number,
    NumberRange,
    PaintPlan,
    PosterPlan,
    RoomPlan,
    StylePlan,
    WindowPlan,
    Word,
    WorldPlan,
)
from .toml_table import Table

# Reading how things look: words for colors and textures, paints, the styles of rooms.

PLASTER = PaintPlan("plaster")
HEX = '"#rrggbb"'


class Vocabulary:
    """The known words of one kind, and how an error lists them."""

    def __init__(self, what: str, tell: Callable[[str], bool], listed: str) -> None:
        self.what, self.tell, self.listed = what, tell, listed


COLOR = Vocabulary("color", is_color, ", ".join([*GROUPS, *COLORS, HEX]))
LIGHT = Vocabulary("color of light", is_light, ", ".join([*LIGHTS, HEX]))
TEXTURE = Vocabulary("texture", TEXTURES.__contains__, ", ".join(TEXTURES))


def word(
    table: Table, key: str, known: Vocabulary, default: str | None = None, more: tuple[str, ...] = ()
) -> Word:
    """Read a word of some kind, or a choice of them; `more` are known as well."""
    if default is not None and not table.has(key):
        return default
    value = table.word(key, table.take(key))
    for option in (value,) if isinstance(value, str) else value.options:
        if option not in more and not known.tell(option):
            listed = expected_one_of(option, [*more, *known.listed.split(", ")])
            table.fail(key, f"no {known.what} called {option!r}; {listed}")
    return value


def _paint(table: Table, key: str, default: PaintPlan, more: tuple[str, ...] = ()) -> PaintPlan:
    return paint_value(table, key, table.take(key), more) if table.has(key) else default


def paint_value(table: Table, key: str, value: object, more: tuple[str, ...] = ()) -> PaintPlan:
    """Read a paint: the name of a texture, or a table with texture or image, colors and size."""
    alone = not isinstance(value, dict) or "any" in value
    return table.as_table(key, {"texture": value} if alone else value).whole(_read_paint, more)


def _read_paint(table: Table, more: tuple[str, ...]) -> PaintPlan:
    if not table.has("image"):
        return PaintPlan(
            texture=word(table, "texture", TEXTURE),
            color=word(table, "color", COLOR, more=more) if table.has("color") else None,
            other=word(table, "other", COLOR, more=more) if table.has("other") else None,
            size_in=table.drawn("size", table.take("size"), table.inches, 0.5) if table.has("size") else None,
        )
    file = table.file.parent / table.text("image")
    if not file.is_file():
        table.fail("image", f"there is no file {file}; its path is relative to the world file")
    try:
        read_image(file)
    except InputError as problem:
        table.fail("image", str(problem))
    return PaintPlan("plaster", image=file)


def _light(table: Table, brightness: float, color: str) -> LightPlan:
    return LightPlan(table.number("brightness", brightness, 0, 100), word(table, "color", LIGHT, color))


def _read_style(table: Table) -> StylePlan:
    colors_table = table.table("colors")
    colors = tuple((name, word(colors_table, name, COLOR)) for name, _ in colors_table.items())
    names = tuple(name for name, _ in colors)
    style = StylePlan(
        name=table.key.removeprefix("style."),
        colors=colors,
        walls=_read_walls(table, names),
        shuffle_walls=table.flag("shuffle_walls"),
        skirting=word(table, "skirting", COLOR, "white", names),
        ceiling=_paint(table, "ceiling", PaintPlan("plaster", "white"), names),
        lamp=table.table("lamp").whole(_light, 1.0, "neutral"),
        daylight=table.table("daylight").whole(_light, 1.2, "daylight"),
        ambient=table.number("ambient", 0.2, 0, 100),
        hang=_read_hang(table),
        hang_every_in=table.length("hang_every", 0.0),
    )
    if 0 < style.hang_every_in < 20:
        table.fail("hang_every", "is less than 20 in; hang things further apart, or write 0 for none")
    return style


def _read_walls(table: Table, names: tuple[str, ...]) -> tuple[PaintPlan, ...]:
    if not table.has("walls"):
        return (PLASTER,)
    if isinstance(dict(table.items())["walls"], (dict, str)):  # one paint for all four
        return (paint_value(table, "walls", table.take("walls"), names),)
    return tuple(paint_value(table, "walls", value, names) for value in table.items_of("walls", (1, 4)))


def _read_hang(table: Table) -> tuple[str, ...]:
    if not table.has("hang"):
        return tuple(HANGINGS)
    kinds = table.items_of("hang", tuple(range(1, 65)))
    for kind in kinds:
        if not isinstance(kind, str) or kind not in HANGINGS:
            table.fail("hang", f"nothing called {kind!r} can hang; {expected_one_of(kind, HANGINGS)}")
    return tuple(str(kind) for kind in kinds)


FORMAT = 1
INCHES = {"in": 1.0, "ft": 12.0, "m": 1 / 0.0254, "cm": 1 / 2.54}
WALLS = ("south", "east", "north", "west")
FRONTS = {"east": 0.0, "north": math.pi / 2, "west": math.pi, "south": -math.pi / 2}
BLOCK = "block"
KINDS = (*MAKERS, BLOCK)


def read_plan(file: Path) -> WorldPlan:
    """Read a world file; WorldError names the file, the key and what is wrong with it."""
    top = Table(file, "", read_toml(file, "a world"))
    if top.take("format") != FORMAT:
        top.fail("format", f"expected {FORMAT}; this program reads no other")
    top.inches = INCHES[top.one_of("units", tuple(INCHES))]
    height_in = top.length("height", 96.0, low=20.0)
    styles = tuple(t.whole(_read_style) for t in _named_tables(top, "style"))
    names = tuple(style.name for style in styles)
    rooms = top.each("room", _read_room, height_in, names)
    if not rooms:
        top.fail("room", "found none, expected at least one; add a [[room]]")
    known = tuple(room.name for room in rooms)
    if len(set(known)) < len(known):
        top.fail("room", "two have the same name; give each its own")
    plan = WorldPlan(
        file=file,
        name=top.text("name", file.stem),
        rooms=rooms,
        styles=styles,
        shuffle_styles=top.flag("shuffle_styles"),
        doors=top.each("door", _read_door),
        floors=tuple(t.whole(_read_floor, k == 0) for k, t in enumerate(top.tables("floor"))),
        posters=top.each("poster", _read_poster, known),
        furniture=top.each("furniture", _read_furniture, known),
        layouts=top.each("layout", lambda t: t.each("furniture", _read_furniture, known)),
        library=top.table("library").whole(_read_library),
        start=top.table("start").whole(_read_start) if top.has("start") else None,
        twins=top.flag("twins"),
    )
    if not plan.floors:
        top.fail("floor", "found none, expected at least one; add a [[floor]] without rect")
    top.done()
    return plan


def _named_tables(top: Table, key: str) -> list[Table]:
    inner = top.table(key)
    tables = [inner.as_table(name, value) for name, value in inner.items()]
    if not tables:
        top.fail(key, f"found none, expected at least one; add a [{key}.NAME]")
    return tables


def _read_room(table: Table, height_in: float, styles: tuple[str, ...]) -> RoomPlan:
    rect = table.rect("rect")
    lamps = table.items_of("lamps", tuple(range(33))) if table.has("lamps") else None
    middle = ((rect[0] + rect[2]) / 2, (rect[1] + rect[3]) / 2)
    room = RoomPlan(
        key=table.key,
        name=table.text("name"),
        rect=rect,
        height_in=table.length("height", height_in, low=20.0),
        style=table.one_of("style", styles),
        lamps=(middle,) if lamps is None else tuple(_place(table, "lamps", value) for value in lamps),
        windows=table.each("windows", _read_window),
    )
    for x, y in room.lamps:
        if not (rect[0] < x < rect[2] and rect[1] < y < rect[3]):
            table.fail("lamps", "one hangs outside the room; move it within rect")
    return room


def _place(table: Table, key: str, value: object) -> tuple[float, float]:
    if not isinstance(value, list) or len(value) != 2:
        table.fail(key, f"found {value!r}, expected [x, y]")
    return table.real(key, value[0], table.inches), table.real(key, value[1], table.inches)


def _length_or_span(table: Table, key: str, low: float = -1e5) -> Number:
    return table.drawn(key, table.take(key), table.inches, low)


def _read_window(table: Table) -> WindowPlan:
    window = WindowPlan(
        wall=table.one_of("wall", WALLS),
        at_in=_length_or_span(table, "at"),
        width_in=table.length("width", 42.0, low=4.0),
        sill_in=table.length("sill", 20.0),
        top_in=table.length("top", 68.0),
    )
    if window.top_in <= window.sill_in:
        table.fail("top", "lies below the sill; give a greater height")
    return window


def _read_door(table: Table) -> DoorPlan:
    frame = word(table, "frame", COLOR, default="white", more=("none",))
    rect, top_in = table.rect("rect"), table.length("top", 78.0, low=20.0)
    return DoorPlan(table.key, rect, top_in, None if frame == "none" else frame)


def _read_floor(table: Table, first: bool) -> FloorPlan:
    rect = table.lengths("rect", (4,)) if table.has("rect") else None
    if first != (rect is None):
        table.fail("rect", "the first [[floor]] has no rect and covers everything; all others have one")
    name = table.text("name")
    floor = FloorPlan(
        key=table.key,
        name=name,
        rect=None if rect is None else (rect[0], rect[1], rect[2], rect[3]),
        paint=_paint(table, "paint", PLASTER),
    )
    if rect is not None and not (
        _highest(rect[0]) < _lowest(rect[2]) and _highest(rect[1]) < _lowest(rect[3])
    ):
        table.fail("rect", "has no area; write [x1, y1, x2, y2] with x1 < x2 and y1 < y2")
    return floor


def _lowest(value: Number) -> float:
    return value.low if isinstance(value, NumberRange) else value


def _highest(value: Number) -> float:
    return value.high if isinstance(value, NumberRange) else value


def _read_poster(table: Table, rooms: tuple[str, ...]) -> PosterPlan:
    room, wall = table.one_of("room", rooms), table.one_of("wall", WALLS)
    at, bottom = _length_or_span(table, "at"), table.length("bottom", 14.0)
    width, height = (table.real("size", v, table.inches, 0.5, 1000) for v in table.items_of("size", (2,)))
    return PosterPlan(table.key, room, wall, at, bottom, (width, height), _paint(table, "paint", PLASTER))


def _read_furniture(table: Table, rooms: tuple[str, ...]) -> FurniturePlan:
    kind = table.one_of("kind", KINDS)
    against = table.one_of("against", WALLS) if table.has("against") else None
    if against is None:
        room, at, front = None, table.lengths("at", (2,)), _read_front(table)
    else:
        room, at = table.one_of("room", rooms), (_length_or_span(table, "at"),)
        front = FRONTS[WALLS[(WALLS.index(against) + 2) % 4]]
    size = table.lengths("size", (2,), low=0.5)
    block = kind == BLOCK
    return FurniturePlan(
        key=table.key,
        kind=kind,
        at_in=at,
        size_in=(size[0], size[1]),
        front=front,
        room=room,
        against=against,
        height_in=_length_or_span(table, "height", 0.5) if block else None,
        paint=_paint(table, "paint", PLASTER) if block else None,
        top=_paint(table, "top", PLASTER) if block and table.has("top") else None,
    )


def _read_front(table: Table) -> Number:
    value = table.take("front") if table.has("front") else "south"
    if isinstance(value, str):
        if value not in FRONTS:
            table.fail("front", f"found {value!r}; there are {', '.join(FRONTS)}, or a number of degrees")
        return FRONTS[value]
    return table.drawn("front", value, math.pi / 180)


def _read_library(table: Table) -> LibraryPlan:
    anchor = _place(table, "anchor", table.take("anchor"))
    headings = table.number("headings", 8, 1, 360)
    if not isinstance(headings, float | int) or headings != int(headings):
        table.fail("headings", "expected an integer")
    spacing, clearance = table.length("spacing", low=1.0), table.length("clearance", 4.5)
    return LibraryPlan(anchor, spacing, int(headings), clearance)


def _read_start(table: Table) -> tuple[float, float, float]:
    x, y, heading = table.items_of("pose", (3,))
    return (
        table.real("pose", x, table.inches),
        table.real("pose", y, table.inches),
        table.real("pose", heading, math.pi / 180),
    )
