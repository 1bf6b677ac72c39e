"""The failures of a saved run in its manifest: what a diagnosis found when the run ended."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Any

from maurice_mcl.analysis.failures.kinds import CAUSES, Failure, Value

from ..errors import FieldError
from ..files import flag, items, mapping, number, show, text, whole


def failure_to_json(failure: Failure) -> dict[str, Any]:
    """Return a failure as JSON; a number that is infinite or none, which JSON cannot hold, as null."""
    kept = {
        name: None if isinstance(value, float) and not math.isfinite(value) else value
        for name, value in failure.evidence.items()
    }
    return asdict(failure) | {"evidence": kept, "also": list(failure.also)}


def failures_from_json(value: Any, steps: Any) -> tuple[Failure, ...]:
    """Return the failures of a run of so many steps; none of one that did not end. FieldError for others."""
    if steps is None:
        return ()
    last = whole(steps, "steps")
    return tuple(_failure(mapping(one, "failures"), last) for one in items(value, "failures"))


def _failure(found: dict[str, Any], steps: int) -> Failure:
    first, last, lost = (whole(found.get(name), f"failures.{name}") for name in ("first", "last", "lost"))
    if not 1 <= min(first, lost) <= max(first, last, lost) <= steps:
        raise FieldError(f"found a failure from step {first} to {last}, expected steps from 1 to {steps}")
    return Failure(
        _kind(found.get("kind")),
        first,
        last,
        lost,
        {str(name): _value(one) for name, one in mapping(found.get("evidence"), "failures.evidence").items()},
        flag(found.get("truth_known"), "failures.truth_known"),
        tuple(_kind(one) for one in items(found.get("also"), "failures.also")),
    )


def _kind(value: Any) -> str:
    if value not in CAUSES:
        raise FieldError(f"found cause {show(value)}, expected one of {', '.join(CAUSES)}")
    return str(value)


def _value(value: Any) -> Value:
    if value is None:
        return math.inf
    return text(value, "failures.evidence") if isinstance(value, str) else number(value, "failures.evidence")
