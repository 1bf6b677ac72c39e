"""The failures of a saved run in its manifest: what a diagnosis found when the run ended."""

from __future__ import annotations

import math
from dataclasses import asdict, fields
from typing import Any

from maurice_mcl.reasons.causes import CAUSES, Failure, Value
from maurice_mcl.scoring.episodes import KIDNAPPED, LOST, PROBABLY_LOST, SEARCHING, Episode

from ..errors import FieldError
from ..files.text import flag, items, mapping, number, show, text, whole


def failure_to_json(failure: Failure) -> dict[str, Any]:
    """Return a failure as JSON; a number that is infinite or none, which JSON cannot hold, as null."""
    kept = {
        name: None if isinstance(value, float) and not math.isfinite(value) else value
        for name, value in failure.evidence.items()
    }
    return asdict(failure) | {"evidence": kept, "also": list(failure.also)}


def failures_from_json(value: Any, steps: Any) -> tuple[Failure, ...] | None:
    """Return the failures of a run of so many steps; none of one that did not end. FieldError for others.

    Those of an earlier version, which had no episodes, are not known: None.
    """
    if steps is None:
        return ()
    last = whole(steps, "steps")
    failures = [mapping(failure, "failures") for failure in items(value, "failures")]
    known = all("episode" in failure for failure in failures)
    return tuple(_failure(failure, last) for failure in failures) if known else None


def _failure(values: dict[str, Any], steps: int) -> Failure:
    first = whole(values.get("first"), "failures.first")
    episode = _episode(mapping(values["episode"], "failures.episode"))
    named = [first, episode.first, episode.onset, episode.last]
    if not 1 <= min(named) <= max(named) <= steps:
        raise FieldError(f"found a failure from step {min(named)} to {max(named)}, expected 1 to {steps}")
    return Failure(
        _kind(values.get("kind")),
        first,
        episode,
        {
            str(name): _value(value)
            for name, value in mapping(values.get("evidence"), "failures.evidence").items()
        },
        flag(values.get("truth_known"), "failures.truth_known"),
        tuple(_kind(kind) for kind in items(values.get("also"), "failures.also")),
    )


def _episode(values: dict[str, Any]) -> Episode:
    kind = values.get("kind")
    if kind not in (KIDNAPPED, LOST, SEARCHING, PROBABLY_LOST):
        raise FieldError(f"found episode {show(kind)}, expected kidnapped, lost, searching or probably-lost")
    named: dict[str, Any] = {field.name: values.get(field.name) for field in fields(Episode)[1:]}
    for name, value in named.items():
        named[name] = None if value is None else whole(value, f"failures.episode.{name}")
    return Episode(kind, **named)


def _kind(value: Any) -> str:
    if value not in CAUSES:
        raise FieldError(f"found cause {show(value)}, expected one of {', '.join(CAUSES)}")
    return str(value)


def _value(value: Any) -> Value:
    if value is None:
        return math.inf
    return text(value, "failures.evidence") if isinstance(value, str) else number(value, "failures.evidence")
