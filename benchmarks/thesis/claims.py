"""What the thesis says, beside what trials of this program show, and what that proves.

Every claim is a test: a figure of the trials with its interval, and the values that it has if the claim is
true. The drives are the sample. Holm's adjustment keeps the chance of any wrong verdict of a page below 5 %;
where it allows both, or the drives are few, a claim is undecided.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
import polars as pl

from maurice_datasets.trials.statistics import (
    FEW,
    Interval,
    holm,
    mean,
    p_value,
    rate_difference,
    share,
)
from maurice_datasets.trials.table import clusters_of
from maurice_mcl.reasons.causes import MOTION, PROPOSAL, RESAMPLING
from maurice_mcl.scoring.metrics import GOAL_M
from maurice_mcl.values.geometry import INCH_M

from .material import Material, MissingRuns, over_drives
from .over_particles import log_fit

REPRODUCED, NOT, UNDECIDED = "reproduced", "not reproduced", "undecided"
UNTESTABLE, BUILT_IN = "not testable", "built in"
WRONG = 0.05  # chance that any verdict of a page is wrong
CRITICAL, AROUND = 2000, 2.5  # the thesis's critical count, and the factor within which ours is the same
MORE = 0.05  # of the runs, by which losses must differ to count as more
TOLERATED = 2.0  # inches a decade: a slope within it is none
MOST = 0.5  # of failures: what the thesis says of every one is tested of most
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
    """A statement of the thesis, and how it is tested."""

    name: str
    section: str  # of the thesis
    stated: str
    test: Callable[[Material], ClaimResult]
    figures: tuple[int, ...] = ()

    def check(self, material: Material) -> ClaimResult:
        """Return what the trials show; not testable where they hold no runs for it."""
        try:
            return self.test(material)
        except MissingRuns as problem:
            return ClaimResult(str(problem).partition(": ")[2] or str(problem), UNTESTABLE)


def judged(results: Sequence[ClaimResult]) -> list[ClaimResult]:
    """Return results with their verdicts, which allow for there being several (Holm 1979)."""
    tested = [number for number, one in enumerate(results) if one.drives >= FEW]
    adjusted = dict(zip(tested, holm([results[number].p for number in tested]), strict=True))
    verdicts = list(results)
    for number, result in enumerate(results):
        if not result.evidence:
            continue
        if number not in adjusted:
            ours, verdict = f"{result.ours}; {FEW} drives at least would tell", UNDECIDED
        else:
            sure = adjusted[number] < WRONG
            ours, verdict = result.ours, (REPRODUCED if result.is_true else NOT) if sure else UNDECIDED
        verdicts[number] = ClaimResult(ours, verdict, result.evidence)
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


def best_quality(material: Material) -> ClaimResult:
    """Compare qualities of some drives' pictures with the thesis's best five and its bulk."""
    qualities = [album.quality("color") for album in material.several]
    best = [np.asarray(album.max(axis=1), np.float64) for album in qualities]
    bulk = [np.asarray(((album >= 0.3) & (album <= 0.7)).mean(axis=1), np.float64) for album in qualities]
    first, second = partial(over_drives, best), partial(over_drives, bulk)
    middle = f"{said(second(0.95), '%', 100, 0)} of entries from 0.3 to 0.7"
    ours = f"best entry {said(first(0.95), '', 1, 2)}; {middle}"
    return ClaimResult(ours, evidence=(ClaimFigure(first, 0.8, 0.88), ClaimFigure(second, 0.5)))


def critical_count(material: Material) -> ClaimResult:
    """Compare losses below and above the thesis's count with those of the most particles, drive by drive."""
    rows = _scored(material)
    counts = sorted(rows["particles"].unique().to_list())
    below = [count for count in counts if count < CRITICAL / AROUND]
    above = [count for count in counts if CRITICAL <= count <= CRITICAL * AROUND]
    if not below or not above or counts[-1] <= above[-1]:
        why = f"holds no runs with counts below {CRITICAL / AROUND:,.0f}, about {CRITICAL:,}, and above"
        raise MissingRuns(material.folder, why)
    few, many = (_differ(rows, "particles", counts[-1], count, "lost") for count in (below[-1], above[-1]))
    caption = [
        f"{said(figure(0.95), 'points', 100, 0)} more lost with {count:,}"
        for figure, count in ((few, below[-1]), (many, above[-1]))
    ]
    ours = f"{', '.join(caption)}, than with {counts[-1]:,}; {100 * MORE:.0f} points count as more"
    return ClaimResult(ours, evidence=(ClaimFigure(few, MORE), ClaimFigure(many, high=MORE)))


def error_by_count(material: Material) -> ClaimResult:
    """Fit the error against the log of the count, over drives on which no count was lost."""
    rows = _scored(material)
    good = rows.filter(~pl.col("lost").any().over("session", "seed"))
    if good["particles"].n_unique() < 2:
        raise MissingRuns(material.folder, "holds no drive with several particle counts, none of them lost")
    x, y = good["particles"].to_numpy(), good["error_m"].to_numpy() / INCH_M

    def slope(level: float) -> Interval:
        return log_fit(x, y, clusters_of(good), level).slope

    caption = f"{said(slope(0.95), 'in per decade of particles', 1, 2)}, on drives that no count lost"
    return ClaimResult(
        f"{caption}; {TOLERATED:g} in count as none", evidence=(ClaimFigure(slope, -TOLERATED, TOLERATED),)
    )


def error_a_thousand(material: Material) -> ClaimResult:
    """Tell the mean error at the critical count and above; the arena was made hard enough to give it."""
    rows = _scored(material).filter(pl.col("particles") >= CRITICAL)
    if rows.is_empty():
        raise MissingRuns(material.folder, f"holds no runs with {CRITICAL:,} particles or more")
    figure = mean(rows["error_m"].to_numpy() / INCH_M, clusters_of(rows))
    ours = (
        f"mean error {said(figure, 'in')}; the arena was made so hard that the thesis's filter has about 9 in"
    )
    return ClaimResult(ours, BUILT_IN)


def hundred_particles(material: Material) -> ClaimResult:
    """Look how many runs with 100 particles get as far as no run of the thesis did."""
    rows = _scored(material, particles=100).filter(pl.col("distance_m") >= GOAL_M)
    if rows.is_empty():
        raise MissingRuns(material.folder, "holds no drive of 1,000 in with 100 particles")
    reached, clusters = rows["reached"].to_numpy(), clusters_of(rows)

    figure = partial(share, reached, clusters)
    best = float(rows["before_loss_m"].to_numpy().max()) / INCH_M
    ours = f"{said(figure(0.95), '%', 100, 0)} drive 1,000 in; the best {best:,.0f} in"
    return ClaimResult(
        f"{ours}; {100 * MORE:.0f} % count as none", evidence=(ClaimFigure(figure, high=MORE),)
    )


def impoverished(material: Material) -> ClaimResult:
    """Count the failures of position tracking that came of no particle near the truth."""
    return _share_of_causes(material, 0, (PROPOSAL, RESAMPLING), "for want of particles at the true place")


def failures_of_many(material: Material) -> ClaimResult:
    """Count the failures with more than the critical count that came of odometry."""
    return _share_of_causes(material, CRITICAL, (MOTION,), "by odometry")


def _share_of_causes(material: Material, over: int, causes: Sequence[str], words: str) -> ClaimResult:
    """Count those of the lost runs, with more than so many particles, that `diagnose` gives these causes."""
    rows = _scored(material).filter(pl.col("particles") > over)
    failed = rows.filter(pl.col("lost"))
    if failed.is_empty():
        return ClaimResult(f"none of {len(rows)} runs was lost", UNTESTABLE)
    flags, clusters = failed["failure"].is_in(causes).fill_null(False).to_numpy(), clusters_of(failed)

    figure = partial(share, flags, clusters)
    ours = f"{len(failed)} of {len(rows)} runs were lost; {said(figure(0.95), '%', 100, 0)} of them {words}"
    return ClaimResult(f"{ours}; tested: most", evidence=(ClaimFigure(figure, MOST),))


def confidence(material: Material) -> ClaimResult:
    """Tell the confidence at the end of runs with 5,000 particles; the thesis does not define its own."""
    rows = material.part("position-tracking", particles=5000)
    figure = mean(rows["confidence_end"].to_numpy(), clusters_of(rows))
    caption = (
        f"its definition is not known; the weight within 12 in of the estimate is {said(figure, '', 1, 2)}"
    )
    return ClaimResult(caption, UNTESTABLE)


def difference(
    part: str, key: str, first: str, other: str, session: str = ""
) -> Callable[[Material], ClaimResult]:
    """Return the test that `other` has a smaller mean error than `first`, on the same drives."""

    def test(material: Material) -> ClaimResult:
        rows = material.part(part)
        figure = _differ(rows.filter(pl.col("session") == session) if session else rows, key, first, other)
        ours = f"{said(figure(0.95), 'in', 1 / INCH_M)}, {other} less {first}"
        return ClaimResult(ours, evidence=(ClaimFigure(figure, high=0),))

    return test


def _differ(rows: pl.DataFrame, key: str, first: object, other: object, metric: str = "error_m") -> Figure:
    """Return by how much a metric differs between two values of a column, on the same drives."""
    before, after = (
        rows.filter((pl.col(key) == value) & pl.col(metric).is_not_null()) for value in (first, other)
    )
    both = after.join(before, on=["session", "seed"], suffix="_first")
    if both.is_empty():
        raise MissingRuns(None, f"holds no runs of {first} and {other} on the same drives")
    values, others, clusters = both[metric].to_numpy(), both[f"{metric}_first"].to_numpy(), clusters_of(both)
    if rows.schema[metric] == pl.Boolean:
        return partial(rate_difference, others, values, clusters)
    return partial(mean, values - others, clusters)


def recovery(material: Material) -> ClaimResult:
    """Compare how often kidnapped runs are right at the end, with fresh particles and without."""
    key, rows = "recovery.strategy", material.part("recovery")
    names = [
        name for name in rows[key].unique(maintain_order=True) if name not in ("none", "expansion", None)
    ]
    if "none" not in rows[key].to_list() or not names:
        raise MissingRuns(material.folder, "holds no runs with and without fresh particles")
    once = rows.unique(["session", "seed", key], maintain_order=True)  # "threshold" is there twice
    figures = [_differ(once, key, "none", name, "right_at_end") for name in names]
    without = once.filter(pl.col(key) == "none")
    none = share(without["right_at_end"].fill_null(False).to_numpy(), clusters_of(without))
    more = ", ".join(
        f"{name} {one(0.95).text(100, 0, '+')}" for name, one in zip(names, figures, strict=True)
    )
    ours = f"right at the end: without {said(none, '%', 100, 0)}; more, in points: {more}"
    return ClaimResult(ours, evidence=tuple(ClaimFigure(figure, 0) for figure in figures))


def brightness(material: Material) -> ClaimResult:
    """Compare the error of color in brighter light with that in the survey's, drive by drive."""
    rows = material.part("brightness", feature="color").with_columns(session=pl.lit("tracking"))
    figure = _differ(rows, "lights", "", "dim:1.3@1")
    ours = said(figure(0.95), "in more at +30 %", 1 / INCH_M)
    return ClaimResult(ours, evidence=(ClaimFigure(figure, 0),))


def update_cost(material: Material) -> ClaimResult:
    """Look how the time of an update grows from 2,000 to 60,000 particles: a measurement, not a sample."""
    rows = material.timing.filter((pl.col("what") == "update") & (pl.col("feature") == "color"))
    took = dict(zip(rows["particles"], rows["median_s"], strict=True))
    grown = took[60_000] / took[2000]
    ours = f"{grown:.1f} times the time for 30 times the particles: a part is the same for any number"
    return ClaimResult(ours, REPRODUCED if grown > 2 else NOT)


def never(why: str) -> Callable[[Material], ClaimResult]:
    """Return the test of what no simulation can show."""
    return lambda material: ClaimResult(why, UNTESTABLE)


def _scored(material: Material, **wanted: int) -> pl.DataFrame:
    """Return the runs of position tracking whose truth is known."""
    rows = material.part("position-tracking", **wanted).filter(pl.col("lost").is_not_null())
    if rows.is_empty():
        raise MissingRuns(material.folder, "holds no runs of position-tracking whose truth is known")
    return rows


CLAIMS = (
    Claim(
        "Rotation constant",
        "3.2",
        "C = 1.3695, measured over actual",
        built_in("1.3695 by construction"),
        (5,),
    ),
    Claim(
        "Turns",
        "3.2",
        "residual N(0.2681, 4.916) degrees",
        built_in("N(0.2681, 4.916) by construction"),
        (8,),
    ),
    Claim(
        "Encoders", "3.2", "error N(-0.6978, 0.6356)", built_in("N(-0.6978, 0.6356) by construction"), (11,)
    ),
    Claim("Match quality", "3.3", "best five 0.82 to 0.84, most entries 0.3 to 0.7", best_quality, (17, 18)),
    Claim("Critical count", "3.6.2", "about 2,000 particles", critical_count, (26, 27)),
    Claim("Error and count", "3.6.2", "the error does not depend on the count", error_by_count, (28, 29)),
    Claim("Error and distance", "3.6.2", "9 in per 1,000 in", error_a_thousand, (29, 30)),
    Claim("100 particles", "3.6.2", "573.13 in at best, before it was lost", hundred_particles, (26,)),
    Claim(
        "Impoverishment",
        "3.6.2",
        "every failure followed an absence of particles near the truth",
        impoverished,
        (37,),
    ),
    Claim("Above 2,000", "3.6.2", "only uneven floor made runs fail", failures_of_many, (37,)),
    Claim("Confidence", "3.6.2", "0.97 in a run with 5,000 particles", confidence, (25,)),
    Claim(
        "Noise floor and relevance",
        "3.3",
        "without them more wrong matches",
        difference("tailoring", "label", "plain L1", "thesis"),
        (22, 23),
    ),
    Claim(
        "Smoothing",
        "4.2.1",
        "a remedy (title only)",
        difference("smoothing", "feature", "color", "smoothed", "tracking, brighter"),
        (47, 48, 49, 50),
    ),
    Claim(
        "Edges",
        "4.2.2",
        "a feature (title only)",
        difference("edges", "feature", "color", "edges"),
        (56,),
    ),
    Claim(
        "Blended features",
        "4.2.3",
        "more robust together (abstract)",
        difference("blended", "feature", "color", "blended"),
        (58, 59, 60),
    ),
    Claim(
        "Sensor-aided sampling",
        "4.3",
        "recovers a robot that is lost (abstract)",
        recovery,
        (65, 66, 67, 68, 69),
    ),
    Claim("Brightness", "5", "shifts histograms: an open limitation", brightness, (73,)),
    Claim("Time of an update", "5", "grows with the particles (figure 72, title only)", update_cost, (72,)),
    Claim("Real time", "2", "motion waits for the update", never("a matter of the robot's hardware")),
)
