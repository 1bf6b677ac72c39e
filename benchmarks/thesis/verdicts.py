"""What a claim is, and how it is judged: figures of trials, and the values they have if the claim is true.

Every claim is a test, whose bounds make its one line on the page. The drives are the sample. Holm's
adjustment keeps the chance of any wrong verdict of a page below 5 %; where it allows both, or the drives are
few, a claim is undecided. What was measured of every run is kept as rows, which give all verdicts again.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import polars as pl

from maurice_datasets.trials.statistics import (
    FEW,
    Clusters,
    Interval,
    holm,
    mean,
    p_value,
    rate_difference,
    share,
)
from maurice_mcl.values.arrays import F64

from .material import Material, MissingRuns
from .over_particles import log_fit

REPRODUCED, NOT, UNDECIDED = "reproduced", "not reproduced", "undecided"
UNTESTABLE, BUILT_IN = "not testable", "built in"
WRONG = 0.05  # chance that any verdict of a page is wrong
MEAN, SHARE, MORE_OFTEN, SLOPE = "mean", "share", "more often", "slope"  # what is estimated of a sample
SCALES = {"%": 100.0, "points": 100.0}  # by which a figure is multiplied where it is shown; else 1


@dataclass(frozen=True, slots=True, eq=False)
class Sample:
    """What was measured of N runs: a share of flags or of shares, a mean, or how much more often than before.

    `before` (N,) holds the flags of the same drives before (MORE_OFTEN), or the numbers of particles (SLOPE).
    """

    kind: str
    values: F64  # (N,)
    clusters: Clusters  # (N,)
    before: F64 | None = None

    def interval(self, level: float) -> Interval:
        """Return the figure with its interval of some level."""
        if self.kind == SHARE:
            return share(self.values, self.clusters, level)
        if self.kind == MEAN or self.before is None:
            return mean(self.values, self.clusters, level)
        if self.kind == SLOPE:
            return log_fit(self.before, self.values, self.clusters, level).slope
        return rate_difference(self.before.astype(bool), self.values.astype(bool), self.clusters, level)


@dataclass(frozen=True, slots=True)
class Bound:
    """A figure, and the values between which it lies if a claim is true; without any it is only shown."""

    what: str  # in words
    unit: str = ""  # %, points, in, or none
    low: float = -np.inf
    high: float = np.inf
    digits: int = 1

    @property
    def text(self) -> str:
        """Say what must hold: "updates up to 16 in: over 50 %"."""
        low, high = (f"{value:g}" for value in (self.low, self.high))
        limits = {
            (True, True): f"{low} to {high}",
            (True, False): f"over {low}",
            (False, True): f"below {high}",
        }
        known = limits[bool(np.isfinite(self.low)), bool(np.isfinite(self.high))]
        return f"{self.what}: {known} {self.unit}".rstrip()

    @property
    def limits(self) -> tuple[float, ...]:
        """The finite bounds, as figures are computed."""
        scale = SCALES.get(self.unit, 1.0)
        return tuple(bound / scale for bound in (self.low, self.high) if np.isfinite(bound))

    def holds(self, sample: Sample) -> bool:
        """Return whether the figure itself lies between the bounds."""
        return self.low <= sample.interval(0.95).value * SCALES.get(self.unit, 1.0) <= self.high

    def p(self, sample: Sample) -> float:
        """Return the p-value of the opposite of what the figure says: that the claim is false, or true."""
        tests = [p_value(sample.interval, bound) for bound in self.limits]
        if self.holds(sample):
            return max(tests)
        value = sample.interval(0.95).value
        return tests[int(np.argmin([abs(value - bound) for bound in self.limits]))]

    def shown(self, sample: Sample) -> str:
        """Return the figure with its interval: "89 % (82 to 95)"; with its name if it is only shown."""
        value, _, limits = sample.interval(0.95).text(SCALES.get(self.unit, 1.0), self.digits).partition(" (")
        name = "" if self.limits else f"{self.what} "
        return f"{name}{f'{value} {self.unit}'.rstrip()} ({limits.rstrip(')')})"


Samples = tuple[Sample, ...]  # one for each bound of a claim


@dataclass(frozen=True, slots=True)
class Claim:
    """A statement of the thesis in our words, and how it is tested, set down before the runs."""

    name: str
    section: str  # of the thesis
    stated: str
    bounds: tuple[Bound, ...] = ()
    test: Callable[[Material], Samples] | None = None  # None: no trial can show it
    why: str = ""  # it is not tested
    verdict: str = UNTESTABLE  # of what is not tested
    least: int = FEW  # drives, below which it is undecided

    @property
    def tested(self) -> str:
        """What must hold, in one line."""
        return "; ".join(bound.text for bound in self.bounds if bound.limits)

    def samples(self, material: Material) -> Samples:
        """Return what the trials show; nothing where they hold no runs for it."""
        try:
            return () if self.test is None else self.test(material)
        except MissingRuns:
            return ()


@dataclass(frozen=True, slots=True)
class ClaimResult:
    """What trials show of a claim: its figures, on which sample, and its verdict."""

    claim: Claim
    verdict: str
    shown: str = ""
    sample: str = ""  # how many drives and runs

    def row(self) -> str:
        """Return a line of a Markdown table."""
        name = f"**{self.claim.name}** ({self.claim.section}): {self.claim.stated}"
        return f"| {name} | {self.verdict} | {self.claim.tested} | {self.shown} | {self.sample} |"


def _is_true(claim: Claim, samples: Samples) -> bool:
    return all(bound.holds(sample) for bound, sample in zip(claim.bounds, samples, strict=True))


def _p(claim: Claim, samples: Samples) -> float:
    """Return the p-value of the opposite of what the figures say."""
    tested = [pair for pair in zip(claim.bounds, samples, strict=True) if pair[0].limits]
    if _is_true(claim, samples):
        return max(bound.p(sample) for bound, sample in tested)
    false = [bound.p(sample) for bound, sample in tested if not bound.holds(sample)]
    return min(min(false) * len(tested), 1.0)


def _size(samples: Samples) -> str:
    """Say how many drives, and runs where these are more, a claim's smallest sample has."""
    least = min((sample.interval(0.95) for sample in samples), key=lambda figure: figure.drives)
    drives = f"{least.drives} drive{'s' * (least.drives != 1)}"
    return drives if least.count == least.drives else f"{drives}, {least.count} runs"


def judged(claims: Sequence[Claim], evidence: Mapping[str, Samples]) -> list[ClaimResult]:
    """Return claims with their verdicts, which allow for there being several (Holm 1979).

    `evidence` has the samples of every claim by its name; none for one that is not tested or has no runs.
    """
    with_runs = [claim for claim in claims if evidence.get(claim.name)]
    counts = {claim.name: min(s.interval(0.95).drives for s in evidence[claim.name]) for claim in with_runs}
    tested = [claim for claim in with_runs if counts[claim.name] >= claim.least]
    adjusted = holm([_p(claim, evidence[claim.name]) for claim in tested])
    sure = {claim.name: p < WRONG for claim, p in zip(tested, adjusted, strict=True)}
    results = []
    for claim in claims:
        samples = evidence.get(claim.name, ())
        if not samples:
            results.append(ClaimResult(claim, claim.verdict, claim.why or "no runs of it in these trials"))
            continue
        verdict = REPRODUCED if _is_true(claim, samples) else NOT
        shown = "; ".join(bound.shown(sample) for bound, sample in zip(claim.bounds, samples, strict=True))
        few = "" if claim.name in sure else f"; {claim.least} drives at least would tell"
        verdict = verdict if sure.get(claim.name) else UNDECIDED
        results.append(ClaimResult(claim, verdict, shown + few, _size(samples)))
    return results


# Evidence on disk: a row for each run behind a figure, so that anyone can make the verdicts again.

SCHEMA = {"claim": pl.String, "figure": pl.Int8, "kind": pl.String, "place": pl.Int32, "drive": pl.Int32}
SCHEMA |= {"value": pl.Float64, "before": pl.Float64}


def write_evidence(file: Path, evidence: Mapping[str, Samples]) -> None:
    """Write the samples of all claims into a Parquet file."""
    rows = [
        pl.DataFrame(
            {
                "claim": [name] * len(sample.values),
                "figure": [number] * len(sample.values),
                "kind": [sample.kind] * len(sample.values),
                "place": sample.clusters.places,
                "drive": sample.clusters.drives,
                "value": sample.values.astype(np.float64),
                "before": [None] * len(sample.values)
                if sample.before is None
                else sample.before.astype(float),
            },
            schema=SCHEMA,
        )
        for name, samples in evidence.items()
        for number, sample in enumerate(samples)
    ]
    pl.concat(rows or [pl.DataFrame(schema=SCHEMA)]).write_parquet(file, compression="zstd")


def read_evidence(file: Path) -> dict[str, Samples]:
    """Return what `write_evidence` has written, by the names of the claims."""
    evidence: dict[str, Samples] = {}
    for (name, _), rows in pl.read_parquet(file).group_by("claim", "figure", maintain_order=True):
        before = rows["before"].to_numpy() if rows["before"].is_not_null().all() else None
        clusters = Clusters.of(rows["place"].to_list(), rows["drive"].to_list())
        sample = Sample(rows["kind"][0], rows["value"].to_numpy(), clusters, before)
        evidence[str(name)] = (*evidence.get(str(name), ()), sample)
    return evidence
