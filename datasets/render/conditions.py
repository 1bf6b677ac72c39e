"""What may change during a session: light, drift, people, gain; and how bright each part of the light is.

`parse_lights` reads the notation of `--lights`, described in docs/simulate.md.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from maurice_mcl.values import F64

from ..tasks import Tier
from ..worlds.world import World
from .light import LightPart, windows_of

DIM_SHARE = 0.6  # of the light that `dim` leaves by default
BRIGHTEST = 2.0  # times the survey's light, the most that `dim` gives
DRIFT_SHARE = 0.2  # largest change of gain of `drift` by default, as in tier hard
TINT_SHARE = 0.5  # white balance drifts by this share of what the gain does
GAINS = ("fixed", "auto")
EXAMPLE = "dim@40,off@60,daylight@20-100,on@80"


@dataclass(frozen=True, slots=True)
class LightChange:
    """One change of light."""

    kind: str  # "dim", "off", "on", "daylight" or "drift"
    update: int = 1  # the first update that has it; the beginning for drift
    until: int | None = None  # daylight: the update at which it stops moving
    amount: float | None = None  # dim: share of the light, over 1: brighter; drift: largest change of gain
    source: str = ""  # off: the lamp, "" for the first; on: the lamp, "" for everything


@dataclass(frozen=True, slots=True)
class Conditions:
    """All that may differ between a session and the survey. The default: a session with nothing changing."""

    lights: tuple[LightChange, ...] = ()
    drift: float = 0.0  # largest slow change of gain, as a share
    tint: float = 0.0  # the same of the white balance of red and blue
    occluded: float = 0.0  # share of the frames in which people stand in view, where there is room for them
    gain: str = "fixed"  # or "auto": the camera chooses for every picture
    half_resolution: bool = False  # as the CMUcam2: every other column is read, and handed over twice

    def __post_init__(self) -> None:
        for name, value in (("drift", self.drift), ("tint", self.tint), ("occluded", self.occluded)):
            if not 0 <= value <= 1:
                raise ValueError(f"found {name} {value}, expected a share from 0 to 1")
        if self.gain not in GAINS:
            raise ValueError(f"found gain {self.gain!r}, expected {' or '.join(GAINS)}")


def conditions_for(
    tier: Tier,
    lights: tuple[LightChange, ...] = (),
    *,
    people: float = 0.0,
    gain: str = "fixed",
    half_resolution: bool = False,
) -> Conditions:
    """Combine the conditions of a tier with those the user adds; of drift and people the more counts."""
    largest_drift = max((change.amount or 0.0 for change in lights if change.kind == "drift"), default=0.0)
    others = tuple(change for change in lights if change.kind != "drift")
    drift, tint = max(tier.drift, largest_drift), max(tier.tint, TINT_SHARE * largest_drift)
    return Conditions(others, drift, tint, max(tier.occluded, people), gain, half_resolution)


def parse_lights(text: str) -> tuple[LightChange, ...]:
    """Read changes like "dim@40,off@60,daylight@20-100,on@80", sorted; ValueError in one line."""
    if not text.strip():
        return ()
    changes = [_parse_change(part.strip()) for part in text.split(",")]
    return tuple(sorted(changes, key=lambda change: change.update))


def _parse_change(text: str) -> LightChange:
    before, at, when = text.partition("@")
    kind, _, what = (part.strip() for part in before.partition(":"))
    if kind not in READERS:
        raise _complaint(text, f"one of {', '.join(READERS)}")
    if bool(at) != (kind != "drift"):
        raise _complaint(text, "drift without @" if at else f"{kind}@ and the update at which it happens")
    return READERS[kind](text, what, when.strip())


def _complaint(text: str, wanted: str) -> ValueError:
    return ValueError(f"found light change {text!r}, expected {wanted}; for example {EXAMPLE}")


def _read_daylight(text: str, what: str, when: str) -> LightChange:
    first, dash, last = when.partition("-")
    if what or not dash:
        raise _complaint(text, "daylight@FIRST-LAST")
    change = LightChange("daylight", _read_update(text, first), until=_read_update(text, last))
    if change.until is None or change.until <= change.update:
        raise _complaint(text, "a span whose last update comes after its first")
    return change


READERS: dict[str, Callable[[str, str, str], LightChange]] = {
    "dim": lambda text, what, when: LightChange(
        "dim", _read_update(text, when), amount=_read_share(text, what, DIM_SHARE, BRIGHTEST)
    ),
    "off": lambda text, what, when: LightChange("off", _read_update(text, when), source=what),
    "on": lambda text, what, when: LightChange("on", _read_update(text, when), source=what),
    "bright": lambda text, what, when: LightChange("on", _read_update(text, when), source=what),
    "daylight": _read_daylight,
    "drift": lambda text, what, when: LightChange("drift", amount=_read_share(text, what, DRIFT_SHARE)),
}


def _read_update(text: str, number: str) -> int:
    digits = number.strip()
    if not (digits.isascii() and digits.isdigit() and 0 < int(digits[:10]) < 10**9):
        raise _complaint(text, "an update as an integer from 1")
    return int(digits)


def _read_share(text: str, what: str, default: float, most: float = 1.0) -> float:
    if not what:
        return default
    try:
        share = float(what)
    except ValueError:
        share = math.nan
    if not 0 <= share <= most:
        raise _complaint(text, f"a share from 0 to {most:g} after the colon")
    return share


# How bright each part of a world's light is at one update of a session.

LATE = (0.52, 0.40, 0.28)  # daylight at the end of its span, of what it was: lower and warmer; invented
TURN = 0.85  # so much of each window's far side is then missing, and so much more comes from the other


def named_lights(world: World, lights: tuple[LightChange, ...]) -> tuple[LightChange, ...]:
    """Return changes that name their lamp, in order; ValueError for a source that the world does not have."""
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
        named.append(replace(change, source=source))
    return tuple(named)


def brightness_at(lights: tuple[LightChange, ...], number: int) -> float:
    """Return the share of the complete building's light that is left at an update."""
    share = 1.0
    for change in lights:
        if change.update <= number and change.kind == "dim":
            share = _left_by(change)
        if change.update <= number and change.kind == "on" and not change.source:
            share = 1.0
    return share


def _left_by(change: LightChange) -> float:
    return DIM_SHARE if change.amount is None else change.amount


def sources_off(lights: tuple[LightChange, ...], number: int) -> frozenset[str]:
    """Return the sources that are off at an update."""
    off: frozenset[str] = frozenset()
    for change in lights:
        if change.update <= number and change.kind == "off":
            off = off | {change.source}
        if change.update <= number and change.kind == "on":
            off = off - {change.source} if change.source else frozenset()
    return off


def daylight_at(lights: tuple[LightChange, ...], number: int) -> float:
    """Return how far daylight has moved, smoothly from 0 to 1; the span that began last counts."""
    spans = [change for change in lights if change.kind == "daylight" and change.update <= number]
    if not spans or spans[-1].until is None:
        return 0.0
    share = min((number - spans[-1].update) / (spans[-1].until - spans[-1].update), 1.0)
    return share * share * (3 - 2 * share)


def weights_at(
    parts: tuple[LightPart, ...], windows: frozenset[str], lights: tuple[LightChange, ...], number: int
) -> F64:
    """Return the weights (S, 3) of the parts' light at an update, all 1 where nothing has changed."""
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
    """Return whether shading ever changes, and not only the brightness of everything."""
    return any(change.kind in ("off", "daylight") for change in conditions.lights)


def events_at(lights: tuple[LightChange, ...], number: int) -> tuple[str, ...]:
    """Return what happens to the light at an update, as the text of a log's events."""
    events = [_told(change) for change in lights if change.update == number and change.kind != "drift"]
    return (*events, *("lights daylight rests" for change in lights if change.until == number))


def _told(change: LightChange) -> str:
    if change.kind == "dim":
        share = _left_by(change)
        return f"lights {'dim' if share <= 1 else 'brighten'} to {share:.0%}"
    if change.kind == "daylight":
        return "lights daylight moves"
    return f"lights {change.kind} {change.source}".rstrip()
