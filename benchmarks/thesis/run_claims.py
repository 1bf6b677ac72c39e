"""Tests of the thesis's claims on the rows of trials: what runs show, drive by drive."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import polars as pl

from maurice_datasets.trials.statistics import Clusters, Interval, mean, rate_difference, share
from maurice_datasets.trials.table import clusters_of
from maurice_mcl.reasons.causes import MOTION, PROPOSAL, RESAMPLING
from maurice_mcl.scoring.metrics import GOAL_M
from maurice_mcl.values.arrays import F64
from maurice_mcl.values.geometry import INCH_M

from .material import Material, MissingRuns
from .over_particles import log_fit
from .verdicts import BUILT_IN, NOT, REPRODUCED, UNTESTABLE, ClaimFigure, ClaimResult, Figure, said

CRITICAL, AROUND = 2000, 2.5  # the thesis's critical count, and the factor within which ours is the same
MORE = 0.05  # of the runs, by which losses must differ to count as more
TOLERATED = 2.0  # inches a decade: a slope within it is none
MOST = 0.5  # of failures: what the thesis says of every one is tested of most


def critical_count(material: Material) -> ClaimResult:
    """Compare losses below and above the thesis's count with those of the most particles, drive by drive."""
    rows = scored(material)
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
    rows = scored(material)
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
    rows = scored(material).filter(pl.col("particles") >= CRITICAL)
    if rows.is_empty():
        raise MissingRuns(material.folder, f"holds no runs with {CRITICAL:,} particles or more")
    figure = mean(rows["error_m"].to_numpy() / INCH_M, clusters_of(rows))
    ours = (
        f"mean error {said(figure, 'in')}; the arena was made so hard that the thesis's filter has about 9 in"
    )
    return ClaimResult(ours, BUILT_IN)


def hundred_particles(material: Material) -> ClaimResult:
    """Look how many runs with 100 particles get as far as no run of the thesis did."""
    rows = scored(material, particles=100).filter(pl.col("distance_m") >= GOAL_M)
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


def fewer_lost(part: str, session: str, first: str, other: str) -> Callable[[Material], ClaimResult]:
    """Return the test that fewer runs are lost with one filter of a part than with another."""

    def test(material: Material) -> ClaimResult:
        rows = material.part(part).filter(pl.col("session") == session)
        figure = _differ(rows, "label", first, other, "lost")
        ours = f"{said(figure(0.95), 'points', 100, 0)} more lost, {other} less {first}"
        return ClaimResult(ours, evidence=(ClaimFigure(figure, high=0),))

    return test


def evenly_drawn(material: Material) -> ClaimResult:
    """Compare how often kidnapped runs are right at the end, with even draws below the threshold."""
    figure = _differ(material.part("recovery"), "label", "none", "threshold, evenly", "right_at_end")
    ours = f"{said(figure(0.95), 'points', 100, 0)} more right at the end than without"
    return ClaimResult(ours, evidence=(ClaimFigure(figure, 0),))


def stays_lost(material: Material) -> ClaimResult:
    """Count the kidnapped runs that are right at the end without fresh particles."""
    rows = material.part("kidnapped").filter(
        (pl.col("label") == "thesis") & pl.col("right_at_end").is_not_null()
    )
    if rows.is_empty():
        raise MissingRuns(material.folder, "holds no kidnapped runs of the preset thesis")
    figure = partial(share, rows["right_at_end"].to_numpy(), clusters_of(rows))
    ours = f"{said(figure(0.95), '%', 100, 0)} right at the end, 30 pictures later"
    return ClaimResult(ours, evidence=(ClaimFigure(figure, high=MOST),))


def _share_of_causes(material: Material, over: int, causes: Sequence[str], words: str) -> ClaimResult:
    """Count those of the lost runs, with more than so many particles, that `diagnose` gives these causes."""
    rows = scored(material).filter(pl.col("particles") > over)
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


def paired(
    rows: pl.DataFrame, key: str, first: object, other: object, metric: str = "error_m"
) -> tuple[F64, F64, Clusters]:
    """Return a metric (N,) for two values of a column, on the same drives, and those drives."""
    before, after = (
        rows.filter((pl.col(key) == value) & pl.col(metric).is_not_null()) for value in (first, other)
    )
    both = after.join(before, on=["session", "seed"], suffix="_first")
    if both.is_empty():
        raise MissingRuns(None, f"holds no runs of {first} and {other} on the same drives")
    return both[f"{metric}_first"].to_numpy(), both[metric].to_numpy(), clusters_of(both)


def _differ(rows: pl.DataFrame, key: str, first: object, other: object, metric: str = "error_m") -> Figure:
    """Return by how much a metric differs between two values of a column, on the same drives."""
    others, values, clusters = paired(rows, key, first, other, metric)
    if rows.schema[metric] == pl.Boolean:
        return partial(rate_difference, others.astype(bool), values.astype(bool), clusters)
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


def scored(material: Material, **wanted: int) -> pl.DataFrame:
    """Return the runs of position tracking whose truth is known."""
    rows = material.part("position-tracking", **wanted).filter(pl.col("lost").is_not_null())
    if rows.is_empty():
        raise MissingRuns(material.folder, "holds no runs of position-tracking whose truth is known")
    return rows
