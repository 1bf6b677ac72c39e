"""Writing HTML and SVG: everything is escaped unless it is markup already. The standard library is enough."""

from __future__ import annotations

import base64
import html
from collections.abc import Iterable
from typing import TypeAlias

VOID = {"img", "meta", "link", "br", "hr"}


class Markup(str):
    """Text that is HTML already."""

    __slots__ = ()


Child: TypeAlias = "str | Iterable[str] | None"
Attribute: TypeAlias = "str | float | None"


def escaped(text: str) -> Markup:
    """Make any text, in any script, safe in HTML and in attributes."""
    return text if isinstance(text, Markup) else Markup(html.escape(text, quote=True))


def joined(parts: Iterable[str], between: str = "") -> Markup:
    """Put parts one after the other."""
    return Markup(between.join(escaped(part) for part in parts))


def tag(name: str, /, *children: Child, **attributes: Attribute) -> Markup:
    """Give an element; `class_` is class, `stroke_width` is stroke-width; None leaves one out."""
    head = name + "".join(
        f' {key.rstrip("_").replace("_", "-")}="{_value(value)}"'
        for key, value in attributes.items()
        if value is not None
    )
    if name in VOID:
        return Markup(f"<{head}>")
    return Markup(f"<{head}>{joined(_flat(children))}</{name}>")


def _flat(children: Iterable[Child]) -> Iterable[str]:
    for child in children:
        if isinstance(child, str):
            yield child
        elif child is not None:
            yield from child


def _value(value: str | float) -> str:
    return escaped(value) if isinstance(value, str) else number(value)


def number(value: float) -> str:
    """Write a coordinate as shortly as two decimals allow, the same on every machine."""
    text = f"{value:.2f}".rstrip("0").rstrip(".")
    return "0" if text in ("-0", "") else text


def data_url(data: bytes, media_type: str) -> str:
    """Put a file into an address, so that the page needs nothing beside it."""
    return f"data:{media_type};base64,{base64.b64encode(data).decode('ascii')}"


def table(
    caption: str, head: Iterable[str], rows: Iterable[Iterable[str]], class_: str | None = None
) -> Markup:
    """Give a table with a caption; the first cell of each row is its heading."""
    header = tag("tr", (tag("th", cell, scope="col") for cell in head))
    return tag(
        "div",
        tag(
            "table",
            tag("caption", caption),
            tag("thead", header),
            tag("tbody", (_row(row) for row in rows)),
            class_=class_,
        ),
        class_="wide",
    )


def _row(cells: Iterable[str]) -> Markup:
    first, *others = cells
    return tag("tr", tag("th", first, scope="row"), (tag("td", cell) for cell in others))
