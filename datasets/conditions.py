"""What may change during a session: light, drift, people, the camera's gain; and how light is written.

`parse_lights` reads the notation of `--lights`, told in docs/conditions.md.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from .tiers import Tier

DIM_SHARE = 0.6  # of the light that `dim` leaves when it does not say
DRIFT_SHARE = 0.2  # largest change of gain that `drift` makes when it does not say, as in tier hard
TINT_SHARE = 0.5  # white balance drifts by this share of what the gain does
GAINS = ("fixed", "auto")
EXAMPLE = "dim@40,off@60,daylight@20-100,on@80"


@dataclass(frozen=True, slots=True)
class LightChange:
    """One change of light."""

    kind: str  # "dim", "off", "on", "daylight" or "drift"
    update: int = 1  # the first update that has it; the beginning for drift
    until: int | None = None  # daylight: the update at which it stops moving
    amount: float | None = None  # dim: share of the light that is left; drift: largest change of gain
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
    gain: str = "fixed",
    half_resolution: bool = False,
) -> Conditions:
    """Put together what a tier asks for and what the user asks for besides; the stronger drift counts."""
    asked = max((change.amount or 0.0 for change in lights if change.kind == "drift"), default=0.0)
    return Conditions(
        tuple(change for change in lights if change.kind != "drift"),
        max(tier.drift, asked),
        max(tier.tint, TINT_SHARE * asked),
        tier.occluded,
        gain,
        half_resolution,
    )


def parse_lights(text: str) -> tuple[LightChange, ...]:
    """Read changes like "dim@40,off@60,daylight@20-100,on@80", sorted by update; "" is none.

    ValueError with one line for what cannot be read.
    """
    if not text.strip():
        return ()
    changes = [parse_change(part.strip()) for part in text.split(",")]
    return tuple(sorted(changes, key=lambda change: change.update))


def parse_change(text: str) -> LightChange:
    """Read one change: kind[:what][@when]."""
    before, at, when = text.partition("@")
    kind, _, what = (part.strip() for part in before.partition(":"))
    if kind not in READERS:
        raise complaint(text, f"one of {', '.join(READERS)}")
    if bool(at) != (kind != "drift"):
        raise complaint(text, "drift without @" if at else f"{kind}@ and the update at which it happens")
    return READERS[kind](text, what, when.strip())


def complaint(text: str, wanted: str) -> ValueError:
    """Say what was found among the light changes and what was expected."""
    return ValueError(f"found light change {text!r}, expected {wanted}; for example {EXAMPLE}")


def read_dim(text: str, what: str, when: str) -> LightChange:
    """dim@40 or dim:0.4@40."""
    return LightChange("dim", read_update(text, when), amount=read_share(text, what, DIM_SHARE))


def read_off(text: str, what: str, when: str) -> LightChange:
    """off@60 or off:west room lamp@60."""
    return LightChange("off", read_update(text, when), source=what)


def read_on(text: str, what: str, when: str) -> LightChange:
    """on@80 or on:west room lamp@80."""
    return LightChange("on", read_update(text, when), source=what)


def read_daylight(text: str, what: str, when: str) -> LightChange:
    """daylight@20-100."""
    first, dash, last = when.partition("-")
    if what or not dash:
        raise complaint(text, "daylight@FIRST-LAST")
    change = LightChange("daylight", read_update(text, first), until=read_update(text, last))
    if change.until is None or change.until <= change.update:
        raise complaint(text, "a span whose last update comes after its first")
    return change


def read_drift(text: str, what: str, when: str) -> LightChange:
    """drift or drift:0.1."""
    return LightChange("drift", amount=read_share(text, what, DRIFT_SHARE))


READERS: dict[str, Callable[[str, str, str], LightChange]] = {
    "dim": read_dim,
    "off": read_off,
    "on": read_on,
    "bright": read_on,
    "daylight": read_daylight,
    "drift": read_drift,
}


def read_update(text: str, number: str) -> int:
    """Read the number of an update, from 1."""
    digits = number.strip()
    if not (digits.isascii() and digits.isdigit() and 0 < int(digits[:10]) < 10**9):
        raise complaint(text, "an update as a whole number from 1")
    return int(digits)


def read_share(text: str, what: str, default: float) -> float:
    """Read a share from 0 to 1; the default where there is none."""
    if not what:
        return default
    try:
        share = float(what)
    except ValueError:
        share = math.nan
    if not 0 <= share <= 1:
        raise complaint(text, "a share from 0 to 1 after the colon")
    return share
