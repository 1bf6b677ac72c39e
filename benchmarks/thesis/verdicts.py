"""What a claim is, and how it is judged: a figure of trials, and the values that it has if the claim is true.

Every claim is a test. The drives are the sample. Holm's adjustment keeps the chance of any wrong verdict of a
page below 5 %; where it allows both, or the drives are few, a claim is undecided.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from maurice_datasets.trials.statistics import FEW, Interval, holm, p_value

from .material import Material, MissingRuns

REPRODUCED, NOT, UNDECIDED = "reproduced", "not reproduced", "undecided"
UNTESTABLE, BUILT_IN = "not testable", "built in"
WRONG = 0.05  # chance that any verdict of a page is wrong
Figure = Callable[[float], Interval]  # with its interval of some level


@dataclass(frozen=True, slots=True)
class ClaimFigure:
    """A figure of trials, and the values between which it lies if a claim is true."""

    figure: Figure
    low: float = -np.inf
    high: float = np.inf

    @property
    def is_true(self) -> bool:
        """Whether the figure itself lies there."""
        return self.low <= self.figure(0.95).value <= self.high

    @property
    def p(self) -> float:
        """The p-value of the opposite of what the figure says: that the claim is false, or true."""
        bounds = [bound for bound in (self.low, self.high) if np.isfinite(bound)]
        tests = [p_value(self.figure, bound) for bound in bounds]
        if self.is_true:
            return max(tests)
        value = self.figure(0.95).value
        return tests[int(np.argmin([abs(value - bound) for bound in bounds]))]


@dataclass(frozen=True, slots=True)
class ClaimResult:
    """What trials show of a claim: words, and either a verdict or what it is to be judged by."""

    ours: str
    verdict: str = UNDECIDED
    evidence: tuple[ClaimFigure, ...] = ()  # all must be true
    least: int = FEW  # drives, below which it is undecided

    @property
    def is_true(self) -> bool:
        """Whether all figures lie where the claim says."""
        return all(part.is_true for part in self.evidence)

    @property
    def p(self) -> float:
        """The p-value of the opposite of what the figures say."""
        if self.is_true:
            return max(part.p for part in self.evidence)
        false = [part.p for part in self.evidence if not part.is_true]
        return min(min(false) * len(self.evidence), 1.0)

    @property
    def drives(self) -> int:
        """The number of drives behind it."""
        return min((part.figure(0.95).drives for part in self.evidence), default=0)


@dataclass(frozen=True, slots=True)
class Claim:
    """A statement of the thesis in our words, and how it is tested, set down before the runs."""

    name: str
    section: str  # of the thesis
    stated: str
    tested: str  # what must hold, in words
    test: Callable[[Material], ClaimResult]
    figures: tuple[int, ...] = ()
    least: int = FEW  # drives, below which it is undecided

    def check(self, material: Material) -> ClaimResult:
        """Return what the trials show; not testable where they hold no runs for it."""
        try:
            return replace(self.test(material), least=self.least)
        except MissingRuns as problem:
            return ClaimResult(str(problem).partition(": ")[2] or str(problem), UNTESTABLE)


def judged(results: Sequence[ClaimResult]) -> list[ClaimResult]:
    """Return results with their verdicts, which allow for there being several (Holm 1979)."""
    tested = [number for number, one in enumerate(results) if one.drives >= one.least]
    adjusted = dict(zip(tested, holm([results[number].p for number in tested]), strict=True))
    verdicts = list(results)
    for number, result in enumerate(results):
        if not result.evidence:
            continue
        if number not in adjusted:
            ours, verdict = f"{result.ours}; {result.least} drives at least would tell", UNDECIDED
        else:
            sure = adjusted[number] < WRONG
            ours, verdict = result.ours, (REPRODUCED if result.is_true else NOT) if sure else UNDECIDED
        verdicts[number] = replace(result, ours=ours, verdict=verdict)
    return verdicts


def said(figure: Interval, unit: str, factor: float = 1.0, digits: int = 1) -> str:
    """Return a figure with its interval and the number of drives, and of runs where these are more."""
    drives = f"{figure.drives} drive{'s' * (figure.drives != 1)}"
    runs = f"{figure.count} runs of {drives}" if figure.count != figure.drives else drives
    value, _, limits = figure.text(factor, digits).partition(" (")
    return f"{f'{value} {unit}'.rstrip()} ({limits.rstrip(')')}, {runs})"


def built_in(what: str) -> Callable[[Material], ClaimResult]:
    """Return the test of a number that the simulated robot was made with."""
    ours = (
        f"{what}; the simulated robot is made with it, so finding it again shows only that calibration works"
    )
    return lambda material: ClaimResult(ours, BUILT_IN)


def never(why: str) -> Callable[[Material], ClaimResult]:
    """Return the test of what no simulation can show."""
    return lambda material: ClaimResult(why, UNTESTABLE)
