"""Whether the filter knows where it is, without truth: a probability, and an alarm where it is probably lost.

A cloud's covariance tells how sure the filter is, not whether it is right: a cloud at the wrong place is as
narrow as one at the right place. What differs is how well it predicts pictures. So every picture is explained
twice, by the predicted cloud and by a cloud that is spread evenly over the whole library: a filter that is
right beats the even cloud by several nats, one that is lost does worse than it. That and how concentrated the
cloud is, where it comes from, and whether recovery is at work, are combined by logistic regression
(docs/lost-signal.md has the table, how it was fitted, and its misses and false alarms on unseen drives).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from ..filter.estimate import entry_weights, log_mean_likelihood
from ..values import Sensed, StepRecord
from .rival_places import RivalPlaces


@dataclass(frozen=True, slots=True)
class BeliefNumbers:
    """What the signal reads of one update: nothing of it depends on the truth."""

    evidence: float  # nats, by channels, of the predicted cloud; -inf: no particle was in free space
    library_mean: float  # nats, of a cloud spread over the whole library
    library_best: float  # nats, of the entry that explains the picture best
    mass: float  # share of the weight in the heaviest mode
    spread: float  # standard deviation of the whole cloud over the radius `right_m`
    survivors: float  # different particles that the next cloud descends from, over its size

    @classmethod
    def of(cls, record: StepRecord) -> BeliefNumbers | None:
        """Read a record; None where it is not known how well the library explains it: without channels."""
        library = record.library_evidence
        if library is None:
            return None
        size, parents = record.belief.size, record.parents
        own = size if parents is None else int(np.count_nonzero(np.bincount(parents[parents >= 0])))
        return cls(
            evidence=evidence_by_channels(record),
            library_mean=library.mean,
            library_best=library.best,
            mass=record.estimate.mass,
            spread=math.hypot(*record.mean_estimate.sd_m) / record.estimate.radii.right_m,
            survivors=own / size,
        )


def evidence_by_channels(record: StepRecord) -> float:
    """Return the calibrated evidence of the predicted cloud without what pose sensors say of it.

    A pose sensor knows every particle's own pose, so that a cloud beats the library's references, which lie
    beside the robot, by far or not at all: only channels compare the two alike.
    """
    sighting, comparison = record.sighting, record.sighting.comparison
    if sighting.sensed is None:
        return record.calibrated_evidence
    inside = np.isfinite(sighting.log_likelihood)
    if not np.isfinite(record.log_evidence) or not inside.any():
        return -math.inf
    if not comparison.channels:
        return 0.0  # all references are alike
    before = record.weighted.log_weights[inside] - sighting.log_likelihood[inside] + record.log_evidence
    known = None if sighting.known is None else sighting.known[inside]
    weights = entry_weights(np.exp(before), sighting.entries[inside], len(comparison.cost), known)
    return float(log_mean_likelihood(comparison.explained_by_channels, weights)[0])


# What a running mean takes over of every update: the last three make up seven eighths of it.
RATE = 0.5
MOST_NATS = 10.0  # a picture counts for no more, whatever stands before the camera
LEAST_SHARE = 0.02  # of shares, whose log odds would grow beyond all bounds

# Logistic regression: log odds that the estimate is right, per unit of each feature (docs/lost-signal.md).
WEIGHTS: Mapping[str, float] = {
    "constant": -2.15,
    "gain": 2.26,
    "last gain": -0.55,
    "gap": -0.38,
    "mass": 0.42,
    "spread": -0.78,
    "survivors": -0.98,
}
PROBABLY_LOST_BELOW = 0.06  # the probability below which it is probably lost ...
KNOWS_ABOVE = 0.5  # ... and above which it knows where it is: it can be lost, or is so no longer


def probability(weights: Mapping[str, float], features: Mapping[str, float], more: float = 0.0) -> float:
    """Return what a logistic regression says of features with the names of its weights; `more` log odds."""
    log_odds = sum(weight * features[name] for name, weight in weights.items())
    return 1 / (1 + math.exp(-(log_odds + more)))


# Without channels, by the share of a laser's beams against the estimate (docs/lost-signal.md).
AGAINST_SHARE, AGAINST_SD = 0.25, 0.025
RISE = 0.25  # of the way to what this reading says
AS_LIKELY_NATS = -2.3  # a tenth as likely as the estimate: a place that readings do not rule out
MOST_KNOWN = 0.99  # of 100 scans that fit so well, about one is of another place


def probability_by(against: float) -> float:
    """Return how probably an estimate is right that a share of a laser's beams speaks against."""
    return MOST_KNOWN / (1 + math.exp((against - AGAINST_SHARE) / AGAINST_SD))


@dataclass(frozen=True, slots=True)
class SignalSummary:
    """What the lost signal said of one run."""

    share: float  # of the updates at which it knew where it is: a probability of at least one half
    at_end: float  # the probability at the last update


@dataclass(slots=True)
class LostSignal:
    """Follows one run, without truth; keeps two running means.

    >>> import maurice_mcl as mcl
    >>> signal = LostSignal()
    >>> for _, record in mcl.run(mcl.make_localizer(mcl.tiny_library()), mcl.tiny_session()):
    ...     knows = signal.add(record)
    >>> 0 <= knows <= 1
    True
    """

    knows: float | None = None  # probability that it knows where it is, by the last update; None: not known
    probably_lost: bool = False  # whether it knew where it was, and does so no longer
    _rivals: RivalPlaces = field(default_factory=RivalPlaces)
    _gain: float | None = None
    _gap: float = 0.0
    _knew: bool = False
    _updates: int = 0  # whose probability is known
    _sure: int = 0  # of them, at which it knew where it is

    def add(self, record: StepRecord) -> float | None:
        """Process the next update; return the probability that its estimate is right, None if not known.

        A second opinion in the record decides, where it is there: it knows more than the filter itself.
        """
        if record.opinion is not None:
            return self._judge(record.opinion.not_lost, record.opinion.alarm_below)
        numbers = BeliefNumbers.of(record)
        if numbers is not None:
            return self.see(numbers)
        sensors = [part for part in record.sighting.comparison.sensed if part.tells_against]
        return self._sensed(record, sensors[0]) if sensors else None

    def _sensed(self, record: StepRecord, part: Sensed) -> float | None:
        """Process what a pose sensor read, without channels: it falls at once, and rises slowly.

        At a wrong place readings fit now and then.
        """
        share = self._rivals.see(record, part)
        against = part.against(record.estimate.pose)
        if against is None:
            return None
        now = share * probability_by(against)
        before = now if self.knows is None else self.knows
        return self._judge(min(now, before + RISE * (now - before)), PROBABLY_LOST_BELOW)

    @property
    def places(self) -> int:
        """How many places what was sensed fits about as well, the estimate's among them; 1 if not known."""
        return 1 + sum(place.nats > AS_LIKELY_NATS for place in self._rivals.places[1:])

    def see(self, now: BeliefNumbers) -> float:
        """Process the numbers of the next update."""
        return self._judge(probability(WEIGHTS, self.features(now)), PROBABLY_LOST_BELOW)

    def _judge(self, knows: float, lost_below: float) -> float:
        self.knows = knows
        self._updates, self._sure = self._updates + 1, self._sure + (knows >= KNOWS_ABOVE)
        self._knew |= knows > KNOWS_ABOVE
        still = self.probably_lost and knows <= KNOWS_ABOVE
        self.probably_lost = self._knew and (knows < lost_below or still)
        return knows

    def summary(self) -> SignalSummary | None:
        """Return the summary up to now; None where nothing is known of how well pictures fit elsewhere."""
        return None if self.knows is None else SignalSummary(self._sure / self._updates, self.knows)

    def features(self, now: BeliefNumbers) -> dict[str, float]:
        """Return what the probability of the next update is made of, by the names of WEIGHTS."""
        last, gap = _clipped(now.evidence - now.library_mean), _clipped(now.library_best - now.evidence)
        first = self._gain is None
        self._gain = last if first else (1 - RATE) * (self._gain or 0.0) + RATE * last
        self._gap = gap if first else (1 - RATE) * self._gap + RATE * gap
        mass = min(max(now.mass, LEAST_SHARE), 1 - LEAST_SHARE)
        return {
            "constant": 1.0,
            "gain": self._gain,
            "last gain": last,
            "gap": self._gap,
            "mass": math.log(mass / (1 - mass)),
            "spread": math.log(max(now.spread, LEAST_SHARE)),
            "survivors": math.log(max(now.survivors, LEAST_SHARE)),
        }


def _clipped(nats: float) -> float:
    """Return a difference of evidences, limited to ten nats either way; -inf is the least."""
    return min(max(nats, -MOST_NATS), MOST_NATS)
