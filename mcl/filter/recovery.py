"""Recovery: the share of particles that is replaced by fresh ones, so that a lost filter can localize again.

A strategy uses its state and the evidence of the picture, the log of the mean of exp(-cost) over the cloud;
one that is relative, the filter's own evidence less what an even cloud would have.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Annotated

import numpy as np

from ..errors import InputError
from ..sensor.references import NearestReference
from ..values.geometry import wrap
from ..values.own_parts import called, is_own, made, own_part
from ..values.randomness import normals
from ..values.records import (
    AVERAGES,
    LIBRARY,
    NO_HISTORY,
    PICTURE,
    Belief,
    Comparison,
    RecoveryState,
    RecoveryTest,
    uniform_log_weights,
)
from ..values.setting_rules import NATS, SHARE, choice, number, whole
from .proposal import MixtureParameters, Regions, informed_poses, proposals_of, uniform_poses
from .resampling import Resampled

# In the running mean a bad picture lies at most so many deviations below it (Huber 1981), with this share of
# the weight of a good one.
BAD_SDS, BAD_SHARE = 2.0, 0.1

DRAWS_NEVER, DRAWS_EVENLY, DRAWS_WHERE_LIKELY = "never", "evenly", "likelihood"  # new particles
RecoveryStrategy = Callable[[float, RecoveryState], "Recovery"]  # evidence in nats (<= 0 or -inf), state


@dataclass(frozen=True, slots=True)
class Recovery:
    """What to do after resampling, and the state for the next update.

    A recovery strategy is a function from the evidence of a picture, in nats, and the state to this:

        >>> import maurice_mcl as mcl
        >>> def below(evidence, state): return mcl.Recovery(0.1 if evidence < -9 else 0.0, state)
        >>> settings = {"recovery.strategy": below}
        >>> localizer = mcl.make_localizer(mcl.tiny_library(), settings=settings)
        >>> localizer.recovery.strategy(-12.0, mcl.RecoveryState()).share
        0.1
    """

    share: float  # of the particles, 0 to 1, replaced by fresh ones
    state: RecoveryState = NO_HISTORY
    expand: bool = False  # spread the particles instead of drawing new ones
    test: RecoveryTest | None = None  # what the strategy compared to decide; None: nothing yet


def none(evidence: float, state: RecoveryState) -> Recovery:
    """Never draw fresh particles, as the thesis's first filter."""
    return Recovery(0.0, state)


def always(share: float) -> RecoveryStrategy:
    """Draw the same share of fresh particles at every update."""

    def strategy(evidence: float, state: RecoveryState) -> Recovery:
        return Recovery(share, state)

    return strategy


def below_library(share: float) -> RecoveryStrategy:
    """Draw fresh particles when the cloud matches a picture worse than the library does in the mean.

    That is how we read the thesis's dynamic threshold on the match quality (3.6): a quality is relative to
    its picture, so every picture has a threshold of its own, below which even draws match better.
    """

    def strategy(evidence: float, state: RecoveryState) -> Recovery:
        return Recovery(share if evidence < 0 else 0.0, state, test=RecoveryTest(LIBRARY, 0.0, evidence))

    return strategy


@dataclass(frozen=True, slots=True)
class DynamicThreshold:
    """Draw fresh particles when a picture is explained much worse than recent ones.

    Running mean minus a few running standard deviations of the evidence: ours, after thesis 3.6.
    """

    share: Annotated[float, SHARE] = 0.05  # of fresh particles when below the threshold
    deviations: Annotated[float, number(0, 1000)] = 2.0  # of the evidence below its running mean
    rate: Annotated[float, SHARE] = 0.1  # of the running mean
    settle: Annotated[int, whole(0, 1_000_000)] = 5  # updates before the first decision
    least_sd: Annotated[float, number(0, 1e6)] = 1.0  # nats: chance alone moves the evidence by this much

    def __call__(self, evidence: float, state: RecoveryState) -> Recovery:
        """Implement `RecoveryStrategy`; `slow` holds the mean of the evidence, in nats."""
        sd = max(math.sqrt(state.spread), self.least_sd)
        threshold, test = state.slow - self.deviations * sd, None
        if state.updates >= max(self.settle, 1):  # one at least: there is nothing to compare the first with
            test = RecoveryTest(PICTURE, threshold, evidence)
        if not math.isfinite(evidence):
            return Recovery(self.share, state, test=test)
        rate, off = max(self.rate, 1 / (state.updates + 1)), evidence - state.slow
        is_bad = test is not None and evidence < threshold
        if is_bad:  # the threshold hardly falls by a few of these, but by a lasting drop
            rate, off = rate * BAD_SHARE, max(off, -BAD_SDS * sd)
        spread = 0.0 if state.updates == 0 else (1 - rate) * (state.spread + rate * off * off)
        seen = RecoveryState(state.slow + rate * off, 0.0, spread, state.updates + 1)
        return Recovery(self.share if is_bad else 0.0, seen, test=test)


@dataclass(frozen=True, slots=True)
class SensorResetting:
    """Draw fresh particles when the mean likelihood is below a fixed one (Lenser and Veloso 2000)."""

    evidence: Annotated[float, NATS] = -12.0  # nats above which nothing is drawn
    most: Annotated[float, SHARE] = 0.5  # maximum share

    def __call__(self, evidence: float, state: RecoveryState) -> Recovery:
        """Implement `RecoveryStrategy`: share 1 - mean likelihood / good likelihood."""
        share = 1 - math.exp(min(evidence - self.evidence, 0.0))
        test = RecoveryTest(PICTURE, self.evidence, evidence)
        return Recovery(min(max(share, 0.0), self.most), state, test=test)


@dataclass(frozen=True, slots=True)
class Augmented:
    """Draw fresh particles when the short-term likelihood falls below the long-term one.

    Thrun et al. 2005, table 8.3: share = max(0, 1 - fast / slow), with rates for ninety updates. Averages
    restart after a large share, or one kidnapping would inject particles for as long as the slow one
    remembers.
    """

    slow: Annotated[float, SHARE] = 0.1  # rate of the long-term average
    fast: Annotated[float, SHARE] = 0.5  # rate of the short-term one
    most: Annotated[float, SHARE] = 0.5  # maximum share
    resets: Annotated[float, SHARE] = 0.3  # a share above this restarts both averages

    def __call__(self, evidence: float, state: RecoveryState) -> Recovery:
        """Implement `RecoveryStrategy`; `slow` and `fast` hold the logs of the averages."""
        if state.updates == 0:
            return Recovery(0.0, RecoveryState(evidence, evidence, 0.0, 1))
        slow = _log_average(state.slow, evidence, max(self.slow, 1 / (state.updates + 1)))
        fast = _log_average(state.fast, evidence, self.fast)
        lacking = -math.expm1(min(fast - slow, 0.0)) if slow > -math.inf else 1.0  # 1 - fast / slow
        share = min(lacking, self.most)
        test = RecoveryTest(AVERAGES, slow, fast)
        if share > self.resets:
            return Recovery(share, NO_HISTORY, test=test)
        return Recovery(share, replace(state, slow=slow, fast=fast, updates=state.updates + 1), test=test)


def _log_average(before: float, now: float, rate: float) -> float:
    """Return the log of (1 - rate) exp(before) + rate exp(now), for logs of any size and -inf."""
    top = max(before, now)
    total = (1 - rate) * math.exp(before - top) + rate * math.exp(now - top) if top > -math.inf else 0.0
    return top + math.log(total) if total > 0 else -math.inf


@dataclass(frozen=True, slots=True)
class Expansion:
    """Spread the cloud when a picture is explained badly (expansion resetting; Ueda et al. 2004)."""

    evidence: Annotated[float, NATS] = -14.0  # nats below which the cloud is spread

    def __call__(self, evidence: float, state: RecoveryState) -> Recovery:
        """Implement `RecoveryStrategy`."""
        test = RecoveryTest(PICTURE, self.evidence, evidence)
        return Recovery(0.0, state, expand=evidence < self.evidence, test=test)


@dataclass(frozen=True, slots=True)
class RecoveryParameters:
    """Whether, when and where fresh particles are drawn."""

    strategy: str = "none"  # STRATEGIES
    draw: Annotated[str, choice("likelihood", "evenly")] = (
        "likelihood"  # where the picture says, or over free space
    )
    share: Annotated[float, SHARE] = 0.05  # of the particles, for "always" and "library"
    threshold: DynamicThreshold = field(default_factory=DynamicThreshold)
    sensor: SensorResetting = field(default_factory=SensorResetting)
    augmented: Augmented = field(default_factory=Augmented)
    expansion: Expansion = field(default_factory=Expansion)
    mixture: MixtureParameters = field(default_factory=MixtureParameters)


STRATEGIES: Mapping[str, Callable[[RecoveryParameters], RecoveryStrategy]] = MappingProxyType(
    {
        "none": lambda settings: none,
        "always": lambda settings: always(settings.share),
        "library": lambda settings: below_library(settings.share),
        "threshold": lambda settings: settings.threshold,
        "sensor": lambda settings: settings.sensor,
        "augmented": lambda settings: settings.augmented,
        "expansion": lambda settings: settings.expansion,
        "mixture": lambda settings: none,  # fresh particles are part of its proposal
    }
)


def strategy_of(parameters: RecoveryParameters) -> RecoveryStrategy:
    """Return the strategy of a name: ours, or the user's. ValueError if it is not available.

    What a user's strategy raises, and anything but a `Recovery` with a share from 0 to 1, is an InputError.
    """
    name = parameters.strategy
    if not is_own(name):
        return STRATEGIES[name](parameters)
    decide = made("recovery strategy", own_part("recovery strategy", name))

    def strategy(evidence: float, state: RecoveryState) -> Recovery:
        recovery = called(f"recovery strategy {name}", decide, evidence, state)
        if not isinstance(recovery, Recovery) or not 0 <= recovery.share <= 1:
            expected = "expected a maurice_mcl.Recovery with a share from 0 to 1"
            raise InputError(None, f"recovery strategy {name}: found {recovery!r:.80}, {expected}")
        return recovery

    return strategy


@dataclass(frozen=True, slots=True, eq=False)
class RecoveryStep:
    """The strategy, and where fresh particles are drawn."""

    strategy: RecoveryStrategy
    reference: NearestReference
    regions: Regions
    draw_evenly: bool = False  # over all free space, instead of from the picture's likelihood
    is_relative: bool = False  # the strategy is given the evidence less that of an even cloud

    def evidence(self, calibrated: float, own: float, comparison: Comparison) -> float:
        """Return what the strategy is given: calibrated evidence, or the own less that of an even cloud."""
        return own - comparison.library_likelihood if self.is_relative else calibrated

    def inject(self, resampled: Resampled, comparison: Comparison, rng: np.random.Generator) -> Resampled:
        """Append the missing particles, freshly drawn; all get equal weights."""
        copies, fresh, grid = resampled.belief, resampled.missing, self.reference.grid
        if self.draw_evenly:
            drawn = uniform_poses(grid, fresh, copies.origin, rng)
        else:
            likely, proposals = comparison.log_likelihood, proposals_of(comparison.sensed)
            drawn = informed_poses(likely, proposals, grid, self.regions, fresh, copies.origin, rng)
        poses = np.concatenate([copies.poses, drawn])
        injected = np.arange(len(poses)) >= copies.size
        parents = None
        if resampled.parents is not None:
            parents = np.append(resampled.parents, np.full(fresh, -1, np.int32))
        belief = Belief(poses, uniform_log_weights(len(poses)), copies.origin)
        return Resampled(belief, parents, injected)

    def expand(self, resampled: Resampled, rng: np.random.Generator) -> Resampled:
        """Move every particle by about the library's spacing and an eighth of a turn."""
        belief, reach = resampled.belief, self.reference.spacing_m
        sd = np.array([reach, reach, np.pi / 8], np.float32)
        poses = belief.poses + normals(rng, belief.size) * sd
        poses[:, 2] = wrap(poses[:, 2])
        spread = Belief(np.asarray(poses, np.float32), belief.log_weights, belief.origin)
        return replace(resampled, belief=spread)
