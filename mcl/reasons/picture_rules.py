"""Rules about pictures: whether the true place could be recognized, and what kept it from that."""

from __future__ import annotations

import numpy as np

from ..values import first_word
from .causes import AMBIGUITY, LIBRARY_GAP, LIGHTING, SENSOR, TOO_DARK, VIEW, Failure, Value
from .evidence import FIRST_UPDATES, Story, UpdateEvidence, median
from .surroundings import PlaceFit

LEAST_UPDATES = 2  # at which something holds
GAP_SPACINGS = 1.5  # a reference farther than this shows another view
UNLIKE_TIMES = 1.6  # the usual cost: the picture is unlike the references at the true place
BEHIND_SHARE, BEHIND_LEAST = 0.025, 10  # of all references, that score above those: it is not recognized
WORSE_NATS = 1.5  # by which the place of the estimate is ahead: the picture speaks against the truth
LIGHT_RATIO = 0.3  # log of the brightness over the expected one
ALIKE_LAYOUT, UNLIKE_LAYOUT = 0.65, 0.4  # of the usual correlation, which light leaves mostly as it is
USUAL_LAYOUT = 0.6  # correlation that is usual where no pictures before tell
COLORS_SHARE = 0.5  # of the log of the brightness, that each of red, green and blue must have changed by
REPAIRED_SHARE = 0.8  # of the cost above the usual one, that may be left once the brightness is corrected
CHANGED_TIMES = 1.6  # the cost of the pictures before, from which on they changed
SETTLED_PICTURES = 5  # before and after that, at least
CONFUSED_SHARE = 0.25  # of other places, that are more similar than a neighbor: the library tells little
ALIKE_NATS = 1.0  # places whose mean log-likelihoods differ by less look alike
MOST_SHARE = 0.5  # of the updates looked at
NAMED_ELEMENTS = 3  # of a channel


def library_gap(story: Story) -> Failure | None:
    """No reference is near the true place."""
    least = GAP_SPACINGS * story.spacing_m
    far = story.where(story.window, lambda u: u.reference_m is not None and u.reference_m > least)
    if len(far) < LEAST_UPDATES:
        return None
    distances = [u.reference_m for u in far if u.reference_m is not None and np.isfinite(u.reference_m)]
    unseen = len(far) - len(distances)  # no reference looks that way, wherever it is
    words: dict[str, Value] = {"to_reference_m": max(distances)} if distances else {}
    if unseen:
        words["none_looks_that_way"] = unseen
    return story.failure(LIBRARY_GAP, far[0].step, **words, spacing_m=story.spacing_m, updates=len(far))


def lighting(story: Story) -> Failure | None:
    """The pictures are too dark; or brighter or darker than the references, and fit better corrected."""
    lit = [update for update in _bad(story) if update.light is not None and update.fit is not None]
    if not lit or story.usual is None:
        return None
    lights = [update.light for update in lit if update.light is not None]
    ratio = median(light.ratio for light in lights)
    before = median(update.fit.cost for update in lit if update.fit) - story.usual.cost
    after = median(light.cost for light in lights) - story.usual.cost
    if abs(ratio) < LIGHT_RATIO or before <= 0:
        return None
    alike, is_repaired = _alike(lit, story), after <= REPAIRED_SHARE * before
    all_colors = median(light.colors for light in lights) >= COLORS_SHARE
    is_lit = alike >= UNLIKE_LAYOUT and (is_repaired or (alike >= ALIKE_LAYOUT and all_colors))
    if not is_lit and np.exp(ratio) > TOO_DARK:
        return None
    texts = [text for k in story.pictures for text in story.updates[k].events if first_word(text) == "lights"]
    words: dict[str, Value] = {"told": texts[0]} if texts else {}
    return story.failure(
        LIGHTING,
        _since(lit, story),
        brightness=float(np.exp(ratio)),
        level=median(light.level for light in lights),
        expected_level=median(light.expected for light in lights),
        over_usual_nats=before,
        corrected_nats=after,
        pictures=len(lit),
        **words,
    )


def _alike(lit: list[UpdateEvidence], story: Story) -> float:
    """Return how much the layout of pictures is the expected one, as a share of before."""
    first = _since(lit, story)
    known = [update.alike for update in story.updates if update.step < first and update.alike is not None]
    layouts = [update.alike for update in lit if update.alike is not None]
    if not layouts:
        return UNLIKE_LAYOUT
    usual = median(known) if len(known) >= SETTLED_PICTURES else USUAL_LAYOUT
    return median(layouts) / max(usual, UNLIKE_LAYOUT)


def unlike_references(story: Story) -> Failure | None:
    """The pictures are unlike the references at the true place.

    If they always were, or cost no more than usual there and only fit other places better, the fault is in
    camera, channels or library; else the view has changed.
    """
    bad, usual = _bad(story), story.usual
    if not bad or usual is None:
        return None
    fits = [update.fit for update in bad if update.fit]
    costs = _costs(fits, story)
    kind = SENSOR if _is_confused(story) or _was_always_bad(story) or not costs else VIEW
    channel = _channel(fits, story)
    return story.failure(
        kind,
        _since(bad, story),
        channel=channel,
        channel_nats=median(fit.costs for fit in fits),
        **_elements([update for update in bad if update.fit and update.fit.costliest == channel]),
        behind_nats=median(fit.behind for fit in fits),
        rank=median(fit.rank for fit in fits),
        references=fits[0].references,
        **costs,
        confused=usual.confused,
        pictures=len(bad),
        of_pictures=len(story.where(story.pictures, lambda u: u.fit is not None)),
    )


def ambiguity(story: Story) -> Failure | None:
    """The pictures fit the true place, and the place of the estimate as well, on average."""
    lost = range(story.lost, min(story.lost + 3 * FIRST_UPDATES, story.end + 1))
    wrong = story.where(lost, lambda u: u.score.correct is False and u.fit is not None)
    away = [update for update in wrong if update.fit and update.fit.estimate_behind]
    if len(away) < max(MOST_SHARE * len(wrong), LEAST_UPDATES):
        return _divided(story)
    behind = median(update.fit.estimate_behind for update in away if update.fit)
    if story.fits_truth or abs(behind) > ALIKE_NATS:
        return None
    rivals = median(update.fit.rivals for update in away if update.fit)
    places = 1 + max(rivals, 1.0)  # the place of the estimate is one, also where it lies between references
    return _alike_places(story, away, behind_nats=behind, places=places)


def _divided(story: Story) -> Failure | None:
    """The estimate was mostly right and the cloud never decided, as another place fits as well."""
    lost = range(story.lost, story.end + 1)
    right = story.where(lost, lambda u: u.score.correct is True and u.fit is not None)
    unsure = [u for u in right if u.score.localized is False and u.share_near * u.size >= 1]
    if len(unsure) < max(MOST_SHARE * len(lost), LEAST_UPDATES):
        return None
    behind = median(update.fit.behind for update in unsure if update.fit)
    return None if behind < -ALIKE_NATS else _alike_places(story, unsure, behind_nats=behind)


def _alike_places(story: Story, updates: list[UpdateEvidence], **evidence: Value) -> Failure:
    x, y = updates[0].fit.rival if updates[0].fit else (0.0, 0.0)
    where: dict[str, Value] = {"rival_x_m": x, "rival_y_m": y, "pictures": len(updates)}
    return story.failure(AMBIGUITY, updates[0].step, **evidence, **where)


def _is_bad(update: UpdateEvidence, story: Story) -> bool:
    """Return whether a picture does not show what the references at the true place do."""
    fit, usual = update.fit, story.usual
    if fit is None or usual is None:
        return False
    behind = fit.rank > max(BEHIND_SHARE * fit.references, BEHIND_LEAST)
    return behind or fit.cost > UNLIKE_TIMES * usual.cost or fit.estimate_behind > WORSE_NATS


def _bad(story: Story) -> list[UpdateEvidence]:
    """Return the bad pictures around the loss; none where they are few, or fit the truth all the same."""
    if story.fits_truth:
        return []
    known = story.where(story.pictures, lambda u: u.fit is not None)
    bad = [update for update in known if _is_bad(update, story)]
    return bad if len(bad) >= max(MOST_SHARE * len(known), 1) else []


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
    before = [update for update in story.updates if update.step < first and update.fit is not None]
    return sum(_is_bad(update, story) for update in before) >= MOST_SHARE * len(before)


def _costs(fits: list[PlaceFit], story: Story) -> dict[str, Value]:
    """Return how much more pictures cost the true place than usual, or than before, where that is clear."""
    cost, usual = median(fit.cost for fit in fits), story.usual
    if usual is not None and cost > UNLIKE_TIMES * usual.cost:
        return {"times_usual": cost / usual.cost}
    since = _costlier_since(story)
    before = [u.fit.cost for u in story.updates if u.fit and since is not None and u.step < since]
    return {"times_before": cost / max(median(before), 1e-9)} if before else {}


def _costlier_since(story: Story) -> int | None:
    """Return the step since which pictures cost clearly more than all before it; None where they do not."""
    known = [k for k in range(story.pictures.stop) if story.updates[k].fit is not None]
    costs = np.array([fit.cost for k in known if (fit := story.updates[k].fit)])
    best, since = CHANGED_TIMES, None
    for k in range(SETTLED_PICTURES, len(known) - SETTLED_PICTURES + 1):
        if known[k] > story.lost:
            break
        times = float(np.median(costs[k:]) / max(np.median(costs[:k]), 1e-9))
        if times > best:
            best, since = times, story.updates[known[k]].step
    return since


def _is_confused(story: Story) -> bool:
    """Return whether the library does not even recognize its own pictures."""
    return story.usual is not None and story.usual.confused > CONFUSED_SHARE


def _elements(bad: list[UpdateEvidence]) -> dict[str, Value]:
    """Return which elements of a channel, such as bins, cost the true place most in these pictures."""
    costs = [update.elements for update in bad if update.elements is not None]
    if not costs:
        return {}
    total = np.asarray(np.stack(costs).sum(axis=0, dtype=np.float64), np.float64)
    most = [int(k) for k in np.argsort(-total)[:NAMED_ELEMENTS] if total[k] > 0]
    share = float(total[most].sum() / max(np.maximum(total, 0).sum(), 1e-12))
    numbers = ", ".join(map(str, sorted(most)))
    return {"elements": numbers, "of_elements": len(total), "elements_share": share} if most else {}


def _channel(fits: list[PlaceFit], story: Story) -> str:
    """Return the channel to blame: the one that says nothing, else the one that most often costs the most."""
    usual = story.usual
    if usual is not None and usual.by_channel and _is_confused(story):
        return max(usual.by_channel, key=lambda name: usual.by_channel[name])
    channels = [fit.costliest for fit in fits]
    return max(sorted(set(channels)), key=channels.count)
