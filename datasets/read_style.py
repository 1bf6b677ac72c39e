"""Reading how things look: words for colors and textures, paints, the styles of rooms."""

from __future__ import annotations

from collections.abc import Callable

from maurice_loaders.errors import LogError

from .hangings import HANGINGS
from .paints import TEXTURES, read_image
from .palettes import COLORS, GROUPS, LIGHTS, is_color, is_light
from .plan import LightPlan, PaintPlan, StylePlan, Word
from .toml_table import Table

PLASTER = PaintPlan("plaster")
HEX = '"#rrggbb"'


class Known:
    """Which words are known, and how they are listed in an error."""

    def __init__(self, what: str, tell: Callable[[str], bool], listed: str) -> None:
        self.what, self.tell, self.listed = what, tell, listed


COLOR = Known("color", is_color, ", ".join([*GROUPS, *COLORS, HEX]))
LIGHT = Known("color of light", is_light, ", ".join([*LIGHTS, HEX]))
TEXTURE = Known("texture", TEXTURES.__contains__, ", ".join(TEXTURES))


def word(
    table: Table, key: str, known: Known, default: str | None = None, more: tuple[str, ...] = ()
) -> Word:
    """Take a word of some kind out, or a choice of them; `more` are known as well."""
    if default is not None and not table.has(key):
        return default
    value = table.word(key, table.take(key))
    for option in (value,) if isinstance(value, str) else value.options:
        if option not in more and not known.tell(option):
            listed = ", ".join([*more, known.listed])
            table.fail(key, f"no {known.what} called {option!r}; there are {listed}")
    return value


def paint(table: Table, key: str, default: PaintPlan, more: tuple[str, ...] = ()) -> PaintPlan:
    """Take a paint out; `more` are names of colors that the room knows."""
    return paint_value(table, key, table.take(key), more) if table.has(key) else default


def paint_value(table: Table, key: str, value: object, more: tuple[str, ...] = ()) -> PaintPlan:
    """Read a paint: the name of a texture, or a table with texture or image, colors and size."""
    inner = table.as_table(
        key, value if isinstance(value, dict) and "any" not in value else {"texture": value}
    )
    if inner.has("image"):
        file = inner.file.parent / inner.text("image")
        if not file.is_file():
            inner.fail("image", f"there is no file {file}; its path is relative to the world file")
        try:
            read_image(file)
        except LogError as problem:
            inner.fail("image", str(problem))
        result = PaintPlan("plaster", image=file)
    else:
        result = PaintPlan(
            texture=word(inner, "texture", TEXTURE),
            color=word(inner, "color", COLOR, more=more) if inner.has("color") else None,
            other=word(inner, "other", COLOR, more=more) if inner.has("other") else None,
            size_in=inner.drawn("size", inner.take("size"), inner.inches, 0.5) if inner.has("size") else None,
        )
    inner.done()
    return result


def light(table: Table, key: str, brightness: float, color: str) -> LightPlan:
    """Take a light out: `{ brightness = 1.2, color = "warm" }`."""
    inner = table.table(key)
    plan = LightPlan(inner.number("brightness", brightness, 0, 100), word(inner, "color", LIGHT, color))
    inner.done()
    return plan


def read_style(table: Table) -> StylePlan:
    """Read one [style.NAME]."""
    colors_table = table.table("colors")
    colors = tuple((name, word(colors_table, name, COLOR)) for name, _ in colors_table.items())
    names = tuple(name for name, _ in colors)
    style = StylePlan(
        name=table.key.removeprefix("style."),
        colors=colors,
        walls=read_walls(table, names),
        shuffle_walls=table.flag("shuffle_walls"),
        skirting=word(table, "skirting", COLOR, "white", names),
        ceiling=paint(table, "ceiling", PaintPlan("plaster", "white"), names),
        lamp=light(table, "lamp", 1.0, "neutral"),
        daylight=light(table, "daylight", 1.2, "daylight"),
        ambient=table.number("ambient", 0.2, 0, 100),
        hang=read_hang(table),
        hang_every_in=table.length("hang_every", 0.0),
    )
    if 0 < style.hang_every_in < 20:
        table.fail("hang_every", "is less than 20 in; hang things further apart, or write 0 for none")
    table.done()
    return style


def read_walls(table: Table, names: tuple[str, ...]) -> tuple[PaintPlan, ...]:
    """Read the paints of the walls: one for all, or four."""
    if not table.has("walls"):
        return (PLASTER,)
    return tuple(paint_value(table, "walls", value, names) for value in table.items_of("walls", (1, 4)))


def read_hang(table: Table) -> tuple[str, ...]:
    """Read the list of what hangs on the walls."""
    if not table.has("hang"):
        return tuple(HANGINGS)
    kinds = table.items_of("hang", tuple(range(1, 65)))
    for kind in kinds:
        if not isinstance(kind, str) or kind not in HANGINGS:
            table.fail("hang", f"nothing called {kind!r} can hang; there are {', '.join(HANGINGS)}")
    return tuple(str(kind) for kind in kinds)
