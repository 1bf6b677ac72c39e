"""Other runs over the same drive as evidence on a run that is doubted without truth: where they are instead.

A run's own pictures tell only that they do not fit where it is. Another run that knows where it is, far from
there, is evidence that does not depend on the doubted estimate.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ..scoring.lost_signal import KNOWS_ABOVE
from ..scoring.table import RunTable
from .causes import LIGHTING, UNKNOWN, VIEW, Failure, Value
from .verdict import RunVerdict

MOST_SHARE = 0.5  # of the steps of a doubt, at which another run knows where it is, and is elsewhere


def with_rivals(verdicts: Mapping[str, RunVerdict], tables: Mapping[str, RunTable]) -> dict[str, RunVerdict]:
    """Return the verdicts; that of a doubted run names the run elsewhere whose place fits the same pictures.

    `tables` are those of the runs that share one drive.
    """
    return {label: _explained(label, verdict, tables) for label, verdict in verdicts.items()}


def _explained(label: str, verdict: RunVerdict, tables: Mapping[str, RunTable]) -> RunVerdict:
    if label not in tables or not any(map(_is_open, verdict.failures)):
        return verdict
    failures = [_with_rival(label, f, tables) if _is_open(f) else f for f in verdict.failures]
    return replace(verdict, failures=tuple(failures))


def _with_rival(label: str, failure: Failure, tables: Mapping[str, RunTable]) -> Failure:
    """Return a failure with the run that is elsewhere at most of its steps, and since when it is."""
    own, most_share = tables[label], MOST_SHARE
    during = (own.steps >= failure.episode.first) & (own.steps <= failure.episode.last)
    explained = failure
    for name, other in tables.items():
        if name == label:
            continue
        away = other.poses - own.poses
        apart_m = np.hypot(away[:, 0], away[:, 1])
        elsewhere = apart_m > own.radii.lost_m
        share = float(np.mean((elsewhere & (other.knows > KNOWS_ABOVE))[during]))
        if share <= most_share:
            continue
        first = int(np.flatnonzero(during)[0])
        together = np.flatnonzero(~elsewhere[:first])
        first = int(together[-1]) + 1 if len(together) else 0
        away_m = float(np.median(apart_m[during & elsewhere]))
        evidence: dict[str, Value] = {**failure.evidence, "rival": name, "apart_m": away_m}
        most_share = share
        explained = replace(failure, kind=UNKNOWN, first=int(own.steps[first]), evidence=evidence)
    return explained


def _is_open(failure: Failure) -> bool:
    """Return whether the cause of a failure is not known, or would make the pictures fit nowhere."""
    return not failure.truth_known and failure.kind in (UNKNOWN, LIGHTING, VIEW)
