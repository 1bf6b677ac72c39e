"""Rules about pictures: whether the true place could be recognized, and what kept it from that."""

from __future__ import annotations

import numpy as np

from ...values.session import first_word
from .around import PlaceFit
from .evidence import UpdateEvidence
from .kinds import AMBIGUITY, LIBRARY_GAP, LIGHTING, SENSOR, VIEW, Failure, Value
from .story import FIRST, Story

OUT_FOR = 2  # updates without a reference
GAP_SPACINGS = 1.5  # a reference farther than this shows another view
UNLIKE = 1.6  # times the usual cost: the picture is unlike the references at the true place
BEHIND_SHARE, BEHIND_LEAST = 0.025, 10  # of all references, that score above those: it is not recognized
WORSE_NATS = 1.5  # by which the place of the estimate is ahead: the picture speaks against the truth
LIGHT = 0.3  # log of the brightness over the expected one
ALIKE, UNLIKE_LAYOUT = (
    0.65,
    0.4,
)  # of the usual correlation of layouts, which light leaves mostly as it is
USUAL_LAYOUT = 0.6  # correlation that is usual where no pictures before tell
SAME_WAY = 0.5  # of the log of the brightness, that each of red, green and blue must have changed by
REPAIRED = 0.8  # of the cost above the usual one, that may be left once the brightness is corrected
CHANGED, SETTLED = 1.6, 5  # times the cost of the pictures before, from which on they changed; of how many
CONFUSED = 0.25  # share of other places more similar than a neighbor: the library tells little
ALIKE_NATS = 1.0  # places whose mean log-likelihoods differ by less look alike
MOSTLY = 0.5  # of the updates looked at
COSTLIEST = 3  # elements of a channel that are named


def library_gap(story: Story) -> Failure | None:
    """No reference is near the true place."""
    least = GAP_SPACINGS * story.spacing_m
    far = story.some(story.window, lambda one: one.reference_m is not None and one.reference_m > least)
    if len(far) < OUT_FOR:
        return None
    away = [one.reference_m for one in far if one.reference_m is not None and np.isfinite(one.reference_m)]
    unseen = len(far) - len(away)  # no reference looks that way, wherever it is
    words: dict[str, Value] = {"to_reference_m": max(away)} if away else {}
    if unseen:
        words["none_looks_that_way"] = unseen
    return story.failure(LIBRARY_GAP, far[0].step, **words, spacing_m=story.spacing_m, updates=len(far))


def lighting(story: Story) -> Failure | None:
    """The pictures are brighter or darker than the references, and fit better with that taken out."""
    lit = [one for one in _bad(story) if one.light is not None and one.fit is not None]
    if not lit or story.usual is None:
        return None
    ratio = float(np.median([one.light.ratio for one in lit if one.light]))
    before = float(np.median([one.fit.cost for one in lit if one.fit])) - story.usual.cost
    after = float(np.median([one.light.cost for one in lit if one.light])) - story.usual.cost
    if abs(ratio) < LIGHT or before <= 0:
        return None
    alike, repaired = _alike(lit, story), after <= REPAIRED * before
    whole = float(np.median([one.light.colors for one in lit if one.light])) >= SAME_WAY
    if alike < UNLIKE_LAYOUT or not (repaired or (alike >= ALIKE and whole)):
        return None
    told = [text for k in story.pictures for text in story.updates[k].events if first_word(text) == "lights"]
    words: dict[str, Value] = {"told": told[0]} if told else {}
    return story.failure(
        LIGHTING,
        _since(lit, story),
        brightness=float(np.exp(ratio)),
        level=float(np.median([one.light.level for one in lit if one.light])),
        expected_level=float(np.median([one.light.expected for one in lit if one.light])),
        over_usual_nats=before,
        corrected_nats=after,
        pictures=len(lit),
        **words,
    )


def _alike(lit: list[UpdateEvidence], story: Story) -> float:
    """Return how much the layout of pictures is the expected one, as a share of before."""
    first = _since(lit, story)
    known = [one.alike for one in story.updates if one.step < first and one.alike is not None]
    layouts = [one.alike for one in lit if one.alike is not None]
    if not layouts:
        return UNLIKE_LAYOUT
    usual = float(np.median(known)) if len(known) >= SETTLED else USUAL_LAYOUT
    return float(np.median(layouts)) / max(usual, UNLIKE_LAYOUT)


def another_view(story: Story) -> Failure | None:
    """The pictures are unlike the references at the true place, and were not so from the beginning."""
    return None if _tells_nothing(story) or _was_always_bad(story) else _unlike(story, VIEW)


def sensor_model(story: Story) -> Failure | None:
    """The true place is not recognized, and never was: the fault is in camera, channels or library."""
    return _unlike(story, SENSOR) if _tells_nothing(story) or _was_always_bad(story) else None


def ambiguity(story: Story) -> Failure | None:
    """The pictures fit the true place, and the place of the estimate as well, on average."""
    lost = range(story.lost, min(story.lost + 3 * FIRST, story.end + 1))
    wrong = story.some(lost, lambda one: one.score.correct is False and one.fit is not None)
    away = [one for one in wrong if one.fit and one.fit.estimate_behind]
    if len(away) < max(MOSTLY * len(wrong), OUT_FOR):
        return _divided(story)
    behind = float(np.median([one.fit.estimate_behind for one in away if one.fit]))
    if story.fits_truth or abs(behind) > ALIKE_NATS:
        return None
    rivals = float(np.median([one.fit.rivals for one in away if one.fit]))
    return _alike_places(story, away, behind_nats=behind, places=1 + rivals)


def _divided(story: Story) -> Failure | None:
    """The estimate was mostly right and the cloud never decided, as another place fits as well."""
    lost = range(story.lost, story.end + 1)
    right = story.some(lost, lambda one: one.score.correct is True and one.fit is not None)
    unsure = [one for one in right if one.score.localized is False and one.held * one.size >= 1]
    if len(unsure) < max(MOSTLY * len(lost), OUT_FOR):
        return None
    behind = float(np.median([one.fit.behind for one in unsure if one.fit]))
    return None if behind < -ALIKE_NATS else _alike_places(story, unsure, behind_nats=behind)


def _alike_places(story: Story, some: list[UpdateEvidence], **evidence: Value) -> Failure:
    x, y = some[0].fit.rival if some[0].fit else (0.0, 0.0)
    where: dict[str, Value] = {"rival_x_m": x, "rival_y_m": y, "pictures": len(some)}
    return story.failure(AMBIGUITY, some[0].step, **evidence, **where)


def _is_bad(one: UpdateEvidence, story: Story) -> bool:
    """Return whether a picture does not show what the references at the true place do."""
    fit, usual = one.fit, story.usual
    if fit is None or usual is None:
        return False
    behind = fit.rank > max(BEHIND_SHARE * fit.references, BEHIND_LEAST)
    return behind or fit.cost > UNLIKE * usual.cost or fit.estimate_behind > WORSE_NATS


def _bad(story: Story) -> list[UpdateEvidence]:
    """Return the bad pictures around the loss; none where they are few, or fit the truth all the same."""
    if story.fits_truth:
        return []
    known = story.some(story.pictures, lambda one: one.fit is not None)
    bad = [one for one in known if _is_bad(one, story)]
    return bad if len(bad) >= max(MOSTLY * len(known), 1) else []


def _since(bad: list[UpdateEvidence], story: Story) -> int:
    """Return the first step of the bad pictures in a row that these begin with."""
    k = next(k for k in story.pictures if story.updates[k] is bad[0])
    while k > 0 and _is_bad(story.updates[k - 1], story):
        k -= 1
    return story.updates[k].step


def _was_always_bad(story: Story) -> bool:
    """Return whether pictures were as bad from the first update on: most of those before these began."""
    if _costlier_since(story) is not None:
        return False
    bad = _bad(story)
    first = _since(bad, story) if bad else 0
    before = [one for one in story.updates if one.step < first and one.fit is not None]
    return sum(_is_bad(one, story) for one in before) >= MOSTLY * len(before)


def _costlier_since(story: Story) -> int | None:
    """Return the step since which pictures cost clearly more than all before it; None where they do not."""
    known = [k for k in range(story.pictures.stop) if story.updates[k].fit is not None]
    costs = np.array([fit.cost for k in known if (fit := story.updates[k].fit)])
    best, since = CHANGED, None
    for k in range(SETTLED, len(known) - SETTLED + 1):
        if known[k] > story.lost:
            break
        times = float(np.median(costs[k:]) / max(np.median(costs[:k]), 1e-9))
        if times > best:
            best, since = times, story.updates[known[k]].step
    return since


def _tells_nothing(story: Story) -> bool:
    """Return whether the library does not even recognize its own pictures."""
    return story.usual is not None and story.usual.confused > CONFUSED


def _unlike(story: Story, kind: str) -> Failure | None:
    bad, usual = _bad(story), story.usual
    if not bad or usual is None:
        return None
    fits = [one.fit for one in bad if one.fit]
    channel = _channel(fits, story)
    return story.failure(
        kind,
        _since(bad, story),
        channel=channel,
        channel_nats=float(np.median([fit.costs for fit in fits])),
        **_elements([one for one in bad if one.fit and one.fit.costliest == channel]),
        behind_nats=float(np.median([fit.behind for fit in fits])),
        rank=float(np.median([fit.rank for fit in fits])),
        references=fits[0].references,
        times_usual=float(np.median([fit.cost for fit in fits])) / usual.cost,
        confused=usual.confused,
        pictures=len(bad),
        of_pictures=len(story.some(story.pictures, lambda one: one.fit is not None)),
    )


def _elements(bad: list[UpdateEvidence]) -> dict[str, Value]:
    """Return which elements of a channel, such as bins, cost the true place most in these pictures."""
    costs = [one.elements for one in bad if one.elements is not None]
    if not costs:
        return {}
    total = np.asarray(np.stack(costs).sum(axis=0, dtype=np.float64), np.float64)
    most = [int(k) for k in np.argsort(-total)[:COSTLIEST] if total[k] > 0]
    share = float(total[most].sum() / max(np.maximum(total, 0).sum(), 1e-12))
    named = ", ".join(map(str, sorted(most)))
    return {"elements": named, "of_elements": len(total), "elements_share": share} if most else {}


def _channel(fits: list[PlaceFit], story: Story) -> str:
    """Return the channel to blame: the one that tells nothing, else the one that costs most most often."""
    usual = story.usual
    if usual is not None and usual.by_channel:
        worst = max(usual.by_channel, key=lambda name: usual.by_channel[name])
        if _tells_nothing(story):
            return worst
    channels = [fit.costliest for fit in fits]
    return max(sorted(set(channels)), key=channels.count)
