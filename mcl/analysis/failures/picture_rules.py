"""Rules about pictures: whether the truth's references could be recognized, and what kept them from it."""

from __future__ import annotations

import numpy as np

from .around import PlaceFit
from .evidence import UpdateEvidence
from .kinds import AMBIGUITY, LIBRARY_GAP, LIGHTING, SENSOR, VIEW, Failure, Value
from .story import Story

OUT_FOR = 2  # updates without a reference
GAP_SPACINGS = 1.5  # a reference farther than this shows another view
BAD_NATS = 2.0  # a picture that fits another place so much better speaks against the truth
UNLIKE = 1.6  # times the usual cost between neighboring references: the picture is unlike them
LIGHT = 0.3  # log of the brightness over the expected one
REPAIRED = 0.5  # of what the truth lost, that a corrected brightness must give back
ALIKE_NATS = 1.0  # a rival that is ahead or behind by less looks the same
MOSTLY, ALWAYS = 0.5, 0.7  # of the updates looked at


def library_gap(story: Story) -> Failure | None:
    """No reference is near the true place."""
    least = max(GAP_SPACINGS * story.spacing_m, 0.0)
    far = story.some(story.window, lambda one: one.reference_m is not None and one.reference_m > least)
    if len(far) < OUT_FOR:
        return None
    most = max(one.reference_m or 0.0 for one in far)
    return story.failure(
        LIBRARY_GAP, far[0].step, to_reference_m=most, spacing_m=story.spacing_m, updates=len(far)
    )


def lighting(story: Story) -> Failure | None:
    """The pictures are brighter or darker than the references, and fit when that is taken out."""
    bad = _bad(story)
    known = [one for one in bad if one.light is not None]
    if not known or len(known) < MOSTLY * len(bad):
        return None
    ratio = float(np.median([one.light.ratio for one in known if one.light]))
    if abs(ratio) < LIGHT:
        return None
    first = next(one for one in known if one.light and one.light.ratio * np.sign(ratio) > LIGHT / 2)
    lost = sum(_loss(one.fit) for one in known if one.fit)
    left = sum(max(one.light.behind, 0.0) for one in known if one.light)
    told = [text for k in story.window for text in story.updates[k].events if text.startswith("lights")]
    very = abs(ratio) > 2 * LIGHT
    if not (told or very or left < REPAIRED * lost):
        return None
    words: dict[str, Value] = {"told": told[0]} if told else {}
    return story.failure(
        LIGHTING,
        first.step,
        brightness=float(np.exp(ratio)),
        level=float(np.median([one.light.level for one in known if one.light])),
        expected_level=float(np.median([one.light.expected for one in known if one.light])),
        behind_nats=lost / len(known),
        corrected_nats=left / len(known),
        **words,
    )


def another_view(story: Story) -> Failure | None:
    """The pictures are unlike the references at the true place, and were not so from the beginning."""
    return None if _was_always_bad(story) else _unlike(story, VIEW)


def sensor_model(story: Story) -> Failure | None:
    """The pictures fit wrong places better than the true one."""
    return _unlike(story, SENSOR)


def ambiguity(story: Story) -> Failure | None:
    """The pictures fit the true place, and other places as well."""
    known = story.some(story.around, lambda one: one.fit is not None)
    alike = [one for one in known if one.fit and one.fit.rivals and abs(one.fit.behind) < ALIKE_NATS]
    if len(alike) < max(MOSTLY * len(known), OUT_FOR):
        return None
    best = min(alike, key=lambda one: abs(one.fit.behind) if one.fit else np.inf)
    rivals = float(np.median([one.fit.rivals for one in alike if one.fit]))
    x, y = best.fit.rival if best.fit else (0.0, 0.0)
    return story.failure(
        AMBIGUITY, alike[0].step, places=1 + rivals, rival_x_m=x, rival_y_m=y, pictures=len(alike)
    )


def _bad(story: Story) -> list[UpdateEvidence]:
    """Return the updates around the loss whose pictures speak against the truth."""
    return story.some(story.around, lambda one: one.fit is not None and _loss(one.fit) > BAD_NATS)


def _loss(fit: PlaceFit) -> float:
    return max(fit.behind, fit.estimate_behind, 0.0)


def _was_always_bad(story: Story) -> bool:
    """Return whether most pictures spoke against the truth from the first update on."""
    before = story.some(range(story.window.stop), lambda one: one.fit is not None)
    bad = [one for one in before if one.fit and _loss(one.fit) > BAD_NATS]
    return len(bad) >= ALWAYS * len(before)


def _unlike(story: Story, kind: str) -> Failure | None:
    known, bad = story.some(story.around, lambda one: one.fit is not None), _bad(story)
    if not bad or len(bad) < MOSTLY * len(known):
        return None
    fits = [one.fit for one in bad if one.fit]
    channels = [fit.costliest for fit in fits]
    channel = max(set(channels), key=channels.count)
    return story.failure(
        kind,
        bad[0].step,
        channel=channel,
        channel_nats=float(np.median([fit.costs for fit in fits if fit.costliest == channel])),
        behind_nats=float(np.median([_loss(fit) for fit in fits])),
        rank=float(np.median([fit.rank for fit in fits])),
        references=fits[0].references,
        times_usual=float(np.median([fit.cost for fit in fits])) / max(story.usual_cost, 1e-9),
        pictures=len(bad),
        of_pictures=len(known),
    )
