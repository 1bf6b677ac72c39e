"""Samples of the thesis's claims from the rows of trials: what runs show, drive by drive."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import polars as pl

from maurice_datasets.trials.statistics import Clusters
from maurice_datasets.trials.table import clusters_of
from maurice_mcl.reasons.causes import MOTION, PROPOSAL, RESAMPLING
from maurice_mcl.scoring.metrics import FIRST_SCORED, GOAL_M
from maurice_mcl.values.arrays import F64
from maurice_mcl.values.geometry import INCH_M

from .material import Material, MissingRuns
from .verdicts import MEAN, MORE_OFTEN, SHARE, SLOPE, Sample, Samples

CRITICAL = 2000  # the thesis's critical count of particles
FEWER, AROUND, MOST = 500, 5000, 60_000  # counts below it, about it, and the largest
TYPICAL_M, RARE_M = 16 * INCH_M, 30 * INCH_M
TRACKS, THESIS = "one-change", "thesis"  # the largest sample of position tracking, and its filter
Test = Callable[[Material], Samples]


def tracks(material: Material) -> pl.DataFrame:
    """Return the runs of the largest sample of position tracking, with the thesis's filter."""
    return scored(material.part(TRACKS), label=THESIS)


def lost_tracks(material: Material, least: int = 0) -> pl.DataFrame:
    """Return all lost runs of position tracking with the thesis's filter, with so many particles or more."""
    parts = [tracks(material)]
    if "position-tracking" in material.rows["part"]:
        parts.append(material.part("position-tracking"))
    rows = pl.concat(parts).filter(pl.col("lost") & (pl.col("particles") >= least))
    if rows.is_empty():
        raise MissingRuns(material.folder, "holds no lost track")
    return rows


def scored(rows: pl.DataFrame, **wanted: object) -> pl.DataFrame:
    """Return the rows whose truth is known, with these values; MissingRuns for none."""
    for name, value in wanted.items():
        rows = rows.filter(pl.col(name) == value)
    rows = rows.filter(pl.col("lost").is_not_null())
    if rows.is_empty():
        raise MissingRuns(None, f"holds no runs of {wanted} whose truth is known")
    return rows


def shares(rows: pl.DataFrame, flags: pl.Expr) -> Sample:
    """Return the sample of a share of runs."""
    values = rows.select(flags.fill_null(False)).to_series().cast(pl.Float64).to_numpy()
    return Sample(SHARE, values, clusters_of(rows))


def differences(
    rows: pl.DataFrame, key: str, first: object, other: object, metric: str = "error_mean_m"
) -> Sample:
    """Return the sample of a metric of `other` less that of `first`, drive by drive; errors in inches."""
    before, after = (
        rows.filter((pl.col(key) == value) & pl.col(metric).is_not_null()) for value in (first, other)
    )
    both = after.join(before, on=["session", "seed"], suffix="_first")
    if both.is_empty():
        raise MissingRuns(None, f"holds no runs of {first} and {other} on the same drives")
    values, others = (both[name].cast(pl.Float64).to_numpy() for name in (metric, f"{metric}_first"))
    if rows.schema[metric] == pl.Boolean:
        return Sample(MORE_OFTEN, values, clusters_of(both), others)
    return Sample(MEAN, (values - others) / INCH_M, clusters_of(both))


def difference(part: str, key: str, first: str, other: str, *metrics: str, session: str = "") -> Test:
    """Return the test that compares `other` with `first` by some metrics: the mean error by default."""

    def test(material: Material) -> Samples:
        rows = material.part(part)
        rows = rows.filter(pl.col("session") == session) if session else rows
        return tuple(differences(rows, key, first, other, name) for name in metrics or ("error_mean_m",))

    return test


def critical_count(material: Material) -> Samples:
    """Compare losses below and about the thesis's count with those of the most particles, drive by drive."""
    rows = scored(material.part("position-tracking"))
    return tuple(differences(rows, "particles", MOST, count, "lost") for count in (FEWER, AROUND))


def error_by_count(material: Material) -> Samples:
    """Fit the error against the log of the count, over drives on which no count was lost."""
    rows = scored(material.part("position-tracking"))
    good = rows.filter(~pl.col("lost").any().over("session", "seed"))
    if good["particles"].n_unique() < 2:
        raise MissingRuns(None, "holds no drive with several particle counts, none of them lost")
    counts = good["particles"].cast(pl.Float64).to_numpy()
    return (Sample(SLOPE, good["error_mean_m"].to_numpy() / INCH_M, clusters_of(good), counts),)


def hundred_particles(material: Material) -> Samples:
    """Look how many runs with 100 particles get as far as no run of the thesis did."""
    rows = scored(material.part("position-tracking"), particles=100)
    rows = rows.filter(pl.col("distance_m") >= GOAL_M)
    if rows.is_empty():
        raise MissingRuns(None, "holds no drive of 1,000 in with 100 particles")
    return (shares(rows, pl.col("reached")),)


def typical_error(material: Material) -> Samples:
    """Tell the shares of updates up to the typical error and above the occasional one, run by run."""
    rows = tracks(material).filter(pl.col("error_m").is_not_null())
    if rows.is_empty():
        raise MissingRuns(None, "holds no errors of updates")
    off = [np.array(values, np.float64)[FIRST_SCORED - 1 :] for values in rows["error_m"].to_list()]
    typical, rare = (
        np.array([float(hits.mean()) for hits in flags])
        for flags in ([values <= TYPICAL_M for values in off], [values > RARE_M for values in off])
    )
    return Sample(SHARE, typical, clusters_of(rows)), Sample(SHARE, rare, clusters_of(rows))


def caused_by(*causes: str, least: int = 0) -> Test:
    """Return the test that lost tracks were lost for a reason, as `diagnose` names it."""

    def test(material: Material) -> Samples:
        return (shares(lost_tracks(material, least), pl.col("failure").is_in(causes)),)

    return test


impoverished, by_odometry = caused_by(PROPOSAL, RESAMPLING), caused_by(MOTION, least=CRITICAL)


def stays_lost(material: Material) -> Samples:
    """Count the kidnapped runs that are right at the end without fresh particles."""
    rows = scored(material.part("kidnapped"), label=THESIS).filter(pl.col("right_at_end").is_not_null())
    return (shares(rows, pl.col("right_at_end")),)


def recovery(strategies: Sequence[str]) -> Test:
    """Return the test that kidnapped runs are right at the end more often with fresh particles."""

    def test(material: Material) -> Samples:
        rows = material.part("recovery")
        return tuple(differences(rows, "label", "none", name, "right_at_end") for name in strategies)

    return test


def brightness(material: Material) -> Samples:
    """Compare the error of color in brighter light with that in the survey's, drive by drive."""
    rows = material.part("brightness", feature="color").with_columns(session=pl.lit("tracking"))
    return (differences(rows, "lights", "", "dim:1.3@1"),)


def update_cost(material: Material) -> Samples:
    """Tell how many times as long an update takes with 60,000 particles as with 2,000, drive by drive."""
    rows = material.timing.filter((pl.col("what") == "update") & (pl.col("feature") == "color"))
    slow, fast = (rows.filter(pl.col("particles") == count).sort("drive") for count in (MOST, CRITICAL))
    grown: F64 = slow["median_s"].to_numpy() / fast["median_s"].to_numpy()
    return (Sample(MEAN, grown, clusters_of_drives(slow["drive"].to_list())),)


def clusters_of_drives(drives: Sequence[object]) -> Clusters:
    """Return the clusters of values, each with its drive in an arena of its own."""
    return Clusters.of(drives, drives)
