"""Updates of a run that is right until it is lost, with nothing out of the order, whichever sensor it has."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from maurice_mcl.reasons.diagnosis import stories_of
from maurice_mcl.reasons.evidence import Story, Surprise, UpdateEvidence
from maurice_mcl.scoring.episodes import episodes
from maurice_mcl.scoring.metrics import StepScore
from maurice_mcl.scoring.modes import NearTruth

from .run_tables import scored_table

RIGHT, OFF = StepScore(0.1, 0.0, True, True, False), StepScore(2.0, 0.0, True, False, True)
HELD, GONE = NearTruth(900, (0.9, 0.95, 0.95), 0.02), NearTruth(0, (0.0, 0.0, 0.0), 1.5)
LOST_AT, UPDATES = 11, 24
ALL, SINCE = range(1, UPDATES), range(9, UPDATES)


def healthy(step: int, **changes: Any) -> UpdateEvidence:
    score, near = (RIGHT, HELD) if step < LOST_AT else (OFF, GONE)
    update = UpdateEvidence(
        step, after_s=8.0, repeated=False, events=(), tilt_deg=None, floor="wood", broken=False, zero=False,
        cloud_left=False, score=score, lost_m=0.9, size=1000, inside=1000, ess=500.0, spread_nats=6.0,
        best=-0.7, cloud=-1.2, gray=100.0, moved_m=0.3, driven_m=0.3, near=near,
        surprise=Surprise(0.5, -0.3, 0.8, 1.0),
    )  # fmt: skip
    return replace(update, **changes)


def stories(updates: list[UpdateEvidence]) -> list[Story]:
    """Return the failures among these updates."""
    run = scored_table(
        [update.score for update in updates],
        steps=np.array([update.step for update in updates]),
        kidnapped=np.array([update.kidnapped for update in updates]),
    )
    return stories_of(updates, episodes(run).episodes)
