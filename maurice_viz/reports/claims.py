"""What the thesis says, beside what trials of this program show: reproduced, not reproduced, or not testable.

A verdict goes as far as its interval: where that allows both, the claim is undecided.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import polars as pl

from maurice_datasets.trials.statistics import Interval, log_fit, mean, rate
from maurice_datasets.trials.table import paired
from maurice_datasets.trials.tally import IMPOVERISHED, MOVED_OTHERWISE
from maurice_mcl.geometry import INCH_M

from ..plots.material import Material, NothingToDraw

REPRODUCED, NOT, UNDECIDED, UNTESTABLE = "reproduced", "not reproduced", "undecided", "not testable"
CRITICAL, AROUND = 2000, 2.5  # the thesis's critical count, and the factor within which ours is the same
FACTOR = 1.5  # within which an error is about the thesis's
TOLERATED = 2.0  # inches a decade: an interval about 0 that reaches farther leaves it open


@dataclass(frozen=True, slots=True)
class ClaimResult:
    """What trials show of a claim."""

    ours: str
    verdict: str


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
        except NothingToDraw as problem:
            return ClaimResult(str(problem).partition(": ")[2] or str(problem), UNTESTABLE)


def between(found: Interval, low: float, high: float) -> str:
    """Return the verdict on a figure that should lie between two values."""
    if low <= found.low and found.high <= high:
        return REPRODUCED
    return NOT if found.high < low or found.low > high else UNDECIDED


def below(found: Interval, limit: float) -> str:
    """Return the verdict on a figure that should be below a limit."""
    return REPRODUCED if found.high < limit else NOT if found.low >= limit else UNDECIDED


def said(found: Interval, unit: str, factor: float = 1.0, digits: int = 1) -> str:
    """Return a figure with its interval and the number of runs."""
    value, low, high = (one * factor for one in (found.value, found.low, found.high))
    shown = f"{value:.{digits}f} {unit}".rstrip()
    return f"{shown} ({low:.{digits}f} to {high:.{digits}f}, {found.count} runs)"


def built_in(what: str) -> Callable[[Material], ClaimResult]:
    """Return the test of a number that the simulated robot was made with."""
    told = (
        f"{what}; the simulated robot is built with it, so finding it again shows only that calibration works"
    )
    return lambda material: ClaimResult(told, UNTESTABLE)


def best_quality(material: Material) -> ClaimResult:
    """Compare qualities of the example drive's pictures with the thesis's best five and its bulk."""
    sensor = material.localizer(preset="thesis").sensor
    found = [
        sensor.compare(sensor.measure(one.frame.image)).quality for one in material.drive.session.moments()
    ]
    best = np.array([float(one.max()) for one in found])
    bulk = float(np.mean([((one >= 0.3) & (one <= 0.7)).mean() for one in found]))
    middle = mean(best)
    best_said = said(middle, "", 1, 2).replace("runs", "pictures")
    ours = f"best entry {best_said}; {bulk:.0%} of entries from 0.3 to 0.7"
    return ClaimResult(ours, REPRODUCED if 0.8 <= middle.value <= 0.88 and bulk > 0.5 else NOT)


def critical_count(material: Material) -> ClaimResult:
    """Find the smallest count from which runs are lost no more often than with the most particles."""
    rows = _scored(material)
    counts = sorted(rows["particles"].unique())
    lost = {count: _lost(rows.filter(pl.col("particles") == count)) for count in counts}
    _expect_several(material, counts)
    most = lost[counts[-1]]
    enough = [count for count in counts if lost[count].value <= most.high]
    first = min(count for count in counts if all(other in enough for other in counts if other >= count))
    least = f"{said(lost[counts[0]], '%', 100, 0)} lost with {counts[0]:,}"
    told = f"{least}; from {first:,} on as few as with {counts[-1]:,}"
    return ClaimResult(told, REPRODUCED if CRITICAL / AROUND <= first <= CRITICAL * AROUND else NOT)


def error_by_count(material: Material) -> ClaimResult:
    """Fit the error of runs that were not lost against the log of the count."""
    rows = _scored(material).filter(~pl.col("lost"))
    _expect_several(material, rows["particles"].unique().to_list())
    x, y = rows["particles"].to_numpy(), rows["error_m"].to_numpy() / INCH_M
    slope = log_fit(x, y, rows["seed"].to_numpy()).slope
    flat = not slope.excludes(0) and -TOLERATED <= slope.low <= slope.high <= TOLERATED
    verdict = REPRODUCED if flat else NOT if slope.excludes(0) else UNDECIDED
    return ClaimResult(
        f"{said(slope, 'in per decade of particles', 1, 2)}, of runs that were not lost", verdict
    )


def error_a_thousand(material: Material) -> ClaimResult:
    """Compare the error per 1,000 in driven with 9 in, at the critical count and above."""
    rows = _scored(material).filter((pl.col("particles") >= CRITICAL) & ~pl.col("lost"))
    if rows.is_empty():
        raise NothingToDraw(material.folder, f"holds no runs with {CRITICAL:,} particles that were not lost")
    values = 1000 * rows["error_m"].to_numpy() / rows["distance_m"].to_numpy()
    found = mean(values, rows["arena"].to_numpy())
    told = f"{said(found, 'in per 1,000 in')}; judged within a factor {FACTOR}"
    return ClaimResult(told, between(found, 9 / FACTOR, 9 * FACTOR))


def hundred_particles(material: Material) -> ClaimResult:
    """Look how far runs with 100 particles get."""
    rows = _scored(material, particles=100)
    reached = rate(int(rows["reached"].sum()), len(rows))
    best = float(rows["before_loss_m"].to_numpy().max()) / INCH_M
    ours = f"{said(reached, '%', 100, 0)} drive 1,000 in; the best {best:,.0f} in"
    return ClaimResult(ours, NOT if reached.low > 0.05 else UNDECIDED if reached.value > 0 else REPRODUCED)


def impoverished(material: Material) -> ClaimResult:
    """Count the failures of position tracking that had no particle near the truth."""
    failed = material.part("position-tracking").filter(pl.col("lost"))
    found = rate(int((failed["failure"] == IMPOVERISHED).sum()), len(failed))
    if not len(failed):
        return ClaimResult("no run was lost", UNTESTABLE)
    return ClaimResult(
        said(found, "% of lost runs", 100, 0),
        REPRODUCED if found.low > 0.5 else NOT if found.high < 0.5 else UNDECIDED,
    )


def failures_of_many(material: Material) -> ClaimResult:
    """Look what made runs fail that had more than the critical count."""
    rows = material.part("position-tracking").filter(pl.col("particles") > CRITICAL)
    failed = rows.filter(pl.col("lost"))
    if failed.is_empty():
        return ClaimResult(f"none of {len(rows)} runs was lost", UNTESTABLE)
    found = rate(int((failed["failure"] == MOVED_OTHERWISE).sum()), len(failed))
    return ClaimResult(
        f"{len(failed)} of {len(rows)} were lost; {said(found, '% of them by odometry', 100, 0)}",
        NOT if found.high < 1 else REPRODUCED if found.low > 0.5 else UNDECIDED,
    )


def confidence(material: Material) -> ClaimResult:
    """Tell the confidence at the end of runs with 5,000 particles; the thesis does not define its own."""
    rows = material.part("position-tracking", particles=5000)
    found = mean(rows["confidence_end"].to_numpy(), rows["arena"].to_numpy())
    told = f"its definition is not known; the weight within 12 in of the estimate is {said(found, '', 1, 2)}"
    return ClaimResult(told, UNTESTABLE)


def difference(
    part: str, metric: str, key: str, first: str, other: str, session: str = ""
) -> Callable[[Material], ClaimResult]:
    """Return the test that `other` has less of a metric (in inches) than `first`, on the same drives."""

    def test(material: Material) -> ClaimResult:
        rows = material.part(part).filter(pl.col(key).is_in([first, other]))
        rows = rows.filter(pl.col("session") == session) if session else rows
        rows = rows.sort(pl.col(key) != first)
        found = paired(rows, [key], metric)[0].figure if len(rows[key].unique()) == 2 else None
        if found is None or not found.count:
            raise NothingToDraw(material.folder, f"holds no runs of {first} and {other} on the same drives")
        return ClaimResult(f"{other} less {first}: {said(found, 'in', 1 / INCH_M)}", below(found, 0))

    return test


def recovery(material: Material) -> ClaimResult:
    """Compare how often kidnapped runs are right at the end, with fresh particles and without."""
    rows = material.part("recovery")
    ends = {name: _right(some) for (name,), some in rows.group_by(["recovery.strategy"], maintain_order=True)}
    others = {str(name): found for name, found in ends.items() if name not in ("none", "expansion", None)}
    if "none" not in ends or not others:
        raise NothingToDraw(material.folder, "holds no runs with and without fresh particles")
    none = ends["none"]
    told = ", ".join(f"{name} {found.value:.0%}" for name, found in others.items())
    better = sum(found.low > none.high for found in others.values())
    ours = f"right at the end: without {said(none, '%', 100, 0)}; {told}"
    return ClaimResult(ours, REPRODUCED if better == len(others) else NOT if better == 0 else UNDECIDED)


def brightness(material: Material) -> ClaimResult:
    """Compare the error of color in brighter light with that in the survey's."""
    rows = material.part("brightness", feature="color").filter(pl.col("lights").is_in(["", "dim:1.3@1"]))
    if rows["lights"].n_unique() < 2:
        raise NothingToDraw(material.folder, "holds no runs in the survey's light and in brighter light")
    pairs = rows.pivot("lights", index=["seed", "arena"], values="error_m").drop_nulls()
    apart = (pairs["dim:1.3@1"] - pairs[""]).to_numpy() / INCH_M
    found = mean(apart, pairs["arena"].to_numpy())
    return ClaimResult(
        said(found, "in more at +30 %"), REPRODUCED if found.low > 0 else NOT if found.high < 0 else UNDECIDED
    )


def update_cost(material: Material) -> ClaimResult:
    """Look how the time of an update grows from 2,000 to 60,000 particles."""
    rows = material.timing.filter((pl.col("what") == "update") & (pl.col("feature") == "color"))
    took = dict(zip(rows["particles"], rows["median_s"], strict=True))
    grown = took[60_000] / took[2000]
    told = f"{grown:.1f} times the time for 30 times the particles: a part is the same for any number"
    return ClaimResult(told, REPRODUCED if grown > 2 else NOT)


def never(why: str) -> Callable[[Material], ClaimResult]:
    """Return the test of what no simulation can show."""
    return lambda material: ClaimResult(why, UNTESTABLE)


def _scored(material: Material, **wanted: int) -> pl.DataFrame:
    """Return the runs of position tracking whose truth is known."""
    rows = material.part("position-tracking", **wanted).filter(pl.col("lost").is_not_null())
    if rows.is_empty():
        raise NothingToDraw(material.folder, "holds no runs of position-tracking whose truth is known")
    return rows


def _expect_several(material: Material, counts: Sequence[int]) -> None:
    if len(counts) < 2:
        raise NothingToDraw(material.folder, "holds no runs with several particle counts")


def _lost(rows: pl.DataFrame) -> Interval:
    return rate(int(rows["lost"].sum()), len(rows))


def _right(rows: pl.DataFrame) -> Interval:
    return rate(int(rows["right_at_end"].fill_null(False).sum()), len(rows))


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
        difference("tailoring", "error_m", "label", "plain L1", "thesis"),
        (22, 23),
    ),
    Claim(
        "Smoothing",
        "4.2.1",
        "a remedy (title only)",
        difference("smoothing", "error_m", "feature", "color", "smoothed", "tracking, brighter"),
        (47, 48, 49, 50),
    ),
    Claim(
        "Edges",
        "4.2.2",
        "a feature (title only)",
        difference("edges", "error_m", "feature", "color", "edges"),
        (56,),
    ),
    Claim(
        "Blended features",
        "4.2.3",
        "more robust together (abstract)",
        difference("blended", "error_m", "feature", "color", "blended"),
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
