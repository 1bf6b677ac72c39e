"""What other runs over the same drive tell of a run that is doubted without truth: where they are instead.

A run's own pictures tell only that they do not fit where it is. Another run that knows where it is, far from
there, is evidence that does not hang on the doubted estimate.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from ..scoring.lost_signal import KNOWS_ABOVE
from ..values import F64
from .causes import LIGHTING, UNKNOWN, VIEW, Failure, Value
from .verdict import RunVerdict

MOST_SHARE = 0.5  # of the steps of a doubt, at which another run knows where it is, and is elsewhere


@dataclass(slots=True)
class RivalFinder:
    """Follows runs over one drive; keeps a place and a probability for each run and update."""

    _steps: list[int] = field(default_factory=list)
    _runs: dict[str, list[tuple[float, float, float]]] = field(default_factory=dict)  # x, y, and knows

    def add(self, step: int, estimates: Mapping[str, F64], knows: Mapping[str, float | None]) -> None:
        """Process the next update: the estimate (3,) of each run, and how probably it is right."""
        self._steps.append(step)
        for label, (x, y, _) in estimates.items():
            self._runs.setdefault(label, []).append((x, y, knows[label] or 0.0))

    def explain(self, verdicts: Mapping[str, RunVerdict]) -> dict[str, RunVerdict]:
        """Return the verdicts; a doubted run's say which other run the same pictures fit elsewhere."""
        return {label: self._explained(label, verdict) for label, verdict in verdicts.items()}

    def _explained(self, label: str, verdict: RunVerdict) -> RunVerdict:
        if label not in self._runs or not any(map(_is_open, verdict.failures)):
            return verdict
        lost_m = verdict.radii.lost_m
        failures = [self._with_rival(label, f, lost_m) if _is_open(f) else f for f in verdict.failures]
        return replace(verdict, failures=tuple(failures))

    def _with_rival(self, label: str, failure: Failure, lost_m: float) -> Failure:
        """Return a failure with the run that is elsewhere at most of its steps, and since when it is."""
        steps, own = np.array(self._steps), np.array(self._runs[label])
        during = (steps >= failure.episode.first) & (steps <= failure.episode.last)
        best, found = MOST_SHARE, failure
        for other in self._runs.keys() - {label}:
            places = np.array(self._runs[other])
            apart_m = np.hypot(*(places - own)[:, :2].T)
            elsewhere = apart_m > lost_m
            share = float(np.mean(elsewhere[during] & (places[during, 2] > KNOWS_ABOVE)))
            if share <= best:
                continue
            first = int(np.flatnonzero(during)[0])
            while first > 0 and elsewhere[first - 1]:
                first -= 1
            away_m = float(np.median(apart_m[during & elsewhere]))
            evidence: dict[str, Value] = {**failure.evidence, "rival": other, "apart_m": away_m}
            best = share
            found = replace(failure, kind=UNKNOWN, first=int(steps[first]), evidence=evidence)
        return found


def _is_open(failure: Failure) -> bool:
    """Return whether the cause of a failure is not known, or would make the pictures fit nowhere."""
    return not failure.truth_known and failure.kind in (UNKNOWN, LIGHTING, VIEW)
