"""The one set of templates that all pages are made from, with their filters and colors."""

from __future__ import annotations

import base64
from collections.abc import Callable
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from ..style import LUT, RGB, RUN_COLORS
from .charts import DASHES, px

DARKER = 0.7  # brightness of the colors on white, so that lines stand out


def page_of_template(name: str, **values: Any) -> str:
    """Return the page that a template makes of values; a value that it lacks is an error."""
    return templates().get_template(name).render(**values)


def templates() -> Environment:
    """Return the templates."""
    environment = Environment(
        loader=PackageLoader("maurice_viz.reports"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"px": px, "jpeg_url": _url("jpeg"), "png_url": _url("png")}
    ramp = [_hex((c >> 24, c >> 16 & 255, c >> 8 & 255)) for c in LUT[::51].tolist()]
    environment.globals |= {"dashes": DASHES, "light": _colors(DARKER), "dark": _colors(1.0), "ramp": ramp}
    return environment


def _colors(brightness: float) -> dict[str, str]:
    named = {f"run{k}": color for k, color in enumerate(RUN_COLORS)} | {"estimate": RUN_COLORS[0]}
    return {name: _hex(color, brightness) for name, color in named.items()}


def _hex(color: RGB, brightness: float = 1.0) -> str:
    return "#" + "".join(f"{round(part * brightness):02x}" for part in color)


def _url(kind: str) -> Callable[[bytes], str]:
    return lambda data: f"data:image/{kind};base64,{base64.b64encode(data).decode('ascii')}"
