"""How bright each part of a world's light is at one update of a session."""

from __future__ import annotations

import numpy as np

from maurice_mcl.typing import F64

from .conditions import DIM_SHARE, Conditions, LightChange
from .parts import Part, windows_of
from .world import World

LATE = (0.52, 0.40, 0.28)  # daylight at the end of its span, of what it was: lower and warmer; invented
TURN = 0.85  # so much of each window's far side is then missing, and so much more comes from the other


def named_lights(world: World, lights: tuple[LightChange, ...]) -> tuple[LightChange, ...]:
    """Give changes that name their lamp, in order; the first lamp is the default of `off`.

    ValueError with one line for a source that the world does not have.
    """
    lamps = [source for source in world.sources if source not in windows_of(world)]
    named = []
    for change in sorted(lights, key=lambda change: change.update):
        source = change.source
        if change.kind == "off" and not source:
            if not lamps:
                raise ValueError(f"found no lamp in {world.name} that could go off; leave off out")
            source = lamps[0]
        if source and source not in world.sources:
            raise ValueError(f"found no light called {source!r}; {world.name} has {', '.join(world.sources)}")
        named.append(LightChange(change.kind, change.update, change.until, change.amount, source))
    return tuple(named)


def brightness_at(lights: tuple[LightChange, ...], number: int) -> float:
    """Give the share of the whole building's light that is left at an update."""
    share = 1.0
    for change in lights:
        if change.update <= number and change.kind == "dim":
            share = left_by(change)
        if change.update <= number and change.kind == "on" and not change.source:
            share = 1.0
    return share


def left_by(change: LightChange) -> float:
    """Give the share of light that a dimming leaves."""
    return DIM_SHARE if change.amount is None else change.amount


def sources_off(lights: tuple[LightChange, ...], number: int) -> frozenset[str]:
    """Name the sources that give nothing at an update."""
    off: frozenset[str] = frozenset()
    for change in lights:
        if change.update <= number and change.kind == "off":
            off = off | {change.source}
        if change.update <= number and change.kind == "on":
            off = off - {change.source} if change.source else frozenset()
    return off


def daylight_at(lights: tuple[LightChange, ...], number: int) -> float:
    """Give how far daylight has moved, smoothly from 0 to 1; the span that began last counts."""
    spans = [change for change in lights if change.kind == "daylight" and change.update <= number]
    if not spans or spans[-1].until is None:
        return 0.0
    share = min((number - spans[-1].update) / (spans[-1].until - spans[-1].update), 1.0)
    return share * share * (3 - 2 * share)


def weights_at(
    parts: tuple[Part, ...], windows: frozenset[str], lights: tuple[LightChange, ...], number: int
) -> F64:
    """Give the weights (S, 3) of the parts' light at an update, all 1 where nothing has changed."""
    off, moved = sources_off(lights, number), daylight_at(lights, number)
    color = 1 + moved * (np.array(LATE) - 1)
    return np.array(
        [
            (part.source not in off)
            * (color * (1 + TURN * moved * part.side) if part.source in windows else np.ones(3))
            for part in parts
        ]
    ).reshape(-1, 3)


def reshades(conditions: Conditions) -> bool:
    """Tell whether shading ever changes, and not only the brightness of everything."""
    return any(change.kind in ("off", "daylight") for change in conditions.lights)


def events_at(lights: tuple[LightChange, ...], number: int) -> tuple[str, ...]:
    """Say what happens to the light at an update, as a log's events do."""
    begun = [told(change) for change in lights if change.update == number and change.kind != "drift"]
    return (*begun, *("lights daylight rests" for change in lights if change.until == number))


def told(change: LightChange) -> str:
    """Tell one change."""
    if change.kind == "dim":
        return f"lights dim to {left_by(change):.0%}"
    if change.kind == "daylight":
        return "lights daylight moves"
    return f"lights {change.kind} {change.source}".rstrip()
