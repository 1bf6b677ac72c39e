"""Tests of the thesis's claims on pictures and clouds, which are made again: matches, turns, losses."""

from __future__ import annotations

from functools import partial

import numpy as np
import polars as pl

from maurice_datasets.trials.statistics import mean, share
from maurice_datasets.trials.table import clusters_of
from maurice_mcl.scoring.metrics import FIRST_SCORED, LOST_FOR
from maurice_mcl.scoring.modes import near_truth
from maurice_mcl.values.arrays import F64
from maurice_mcl.values.geometry import INCH_M

from .clouds import turned
from .drives import TRAVEL_M, motion_clouds
from .example import DrivePictures, rooms_of
from .material import Material, MissingRuns, over_drives
from .run_claims import CRITICAL, MOST, paired, scored
from .success import rows_of
from .verdicts import UNTESTABLE, ClaimFigure, ClaimResult, said

RERUN = 24  # lost runs that are made again, the first by seed and count
TYPICAL_M, RARE_M = 16 * INCH_M, 30 * INCH_M
RARE = 0.1  # of the updates, up to which they are "occasional"
HALF = 0.5  # of the error that must go with the ambiguity for it to be "at the core"


def best_quality(material: Material) -> ClaimResult:
    """Compare qualities of some drives' pictures with the thesis's best five and its bulk."""
    qualities = [album.quality("color") for album in material.several]
    best = [np.asarray(album.max(axis=1), np.float64) for album in qualities]
    bulk = [np.asarray(((album >= 0.3) & (album <= 0.7)).mean(axis=1), np.float64) for album in qualities]
    first, second = partial(over_drives, best), partial(over_drives, bulk)
    middle = f"{said(second(0.95), '%', 100, 0)} of entries from 0.3 to 0.7"
    ours = f"best entry {said(first(0.95), '', 1, 2)}; {middle}"
    return ClaimResult(ours, evidence=(ClaimFigure(first, 0.8, 0.88), ClaimFigure(second, 0.5)))


def two_rooms(material: Material) -> ClaimResult:
    """Compare the quality of references in the robot's room with that of those in the other."""
    steps = [_step_of(album) for album in material.several if len(rooms_of(album.library)) > 1]
    if not steps:
        raise MissingRuns(material.folder, "holds no drives through more than one room")
    figure = partial(over_drives, steps)
    ours = f"{said(figure(0.95), 'in quality', 1, 2)}, references of the robot's room less those of the other"
    return ClaimResult(ours, evidence=(ClaimFigure(figure, 0),))


def _step_of(album: DrivePictures) -> F64:
    """Return, picture by picture (T,), how much better the references of its own room match."""
    quality, rooms = album.quality("color"), np.stack([there for _, there in rooms_of(album.library)])
    here = rooms[rooms[:, album.entries].argmax(axis=0)]  # (T, L)
    own, other = (np.where(some, quality, np.nan) for some in (here, ~here))
    return np.asarray(np.nanmean(own, axis=1) - np.nanmean(other, axis=1), np.float64)


def dark_bins(material: Material) -> ClaimResult:
    """Compare the largest counts of the library in the lower half of the bins with those in the upper."""
    found = []
    for album in material.several:
        largest = album.library.index["color"].relevance.reshape(3, -1)
        half = largest.shape[1] // 2
        found.append(float(largest[:, :half].mean() - largest[:, half:].mean()))
    figure = partial(mean, np.array(found), None)
    ours = f"{said(figure(0.95), 'of 256 more', 1, 0)} in the lower 14 bins than in the upper"
    return ClaimResult(ours, evidence=(ClaimFigure(figure, 0),))


def compounding(material: Material) -> ClaimResult:
    """Compare the deviation that the motion model alone gives after a way with that after half of it."""
    grown = []
    for album in material.several:
        clouds, ways = motion_clouds(material, album.drive)
        sds = np.array([np.hypot(*cloud[:, :2].std(axis=0)) for cloud in clouds]) / INCH_M
        half, whole = np.interp([ways[-1] / 2, ways[-1]], ways, sds)
        grown.append(whole - 2 * half)
    figure = partial(mean, np.array(grown), None)
    way = f"{TRAVEL_M / INCH_M:.0f} in"
    ours = f"{said(figure(0.95), 'in')}, deviation after {way} less twice that after half of it"
    return ClaimResult(ours, evidence=(ClaimFigure(figure, 0),))


def sharpened(material: Material) -> ClaimResult:
    """Compare the cloud's deviation after many pictures of one place with that after the first."""
    runs, places = turned(material, "color")
    sd, off = (np.array([one[k] for one in runs]) / INCH_M for k in (0, 1))
    figure = partial(mean, sd[:, -1] - sd[:, 0], places)
    before, after = (float(off[:, at].mean()) for at in (0, -1))
    ours = f"deviation {said(figure(0.95), 'in')}; error {before:.1f} in before, {after:.1f} in after"
    return ClaimResult(ours, evidence=(ClaimFigure(figure, high=0),))


def pulled(material: Material) -> ClaimResult:
    """Compare error and deviation after many pictures of one place: a cloud surer than it is right."""
    runs, places = turned(material, "color")
    figure = partial(mean, np.array([one[1, -1] - one[0, -1] for one in runs]) / INCH_M, places)
    return ClaimResult(
        f"{said(figure(0.95), 'in')}, error less deviation", evidence=(ClaimFigure(figure, 0),)
    )


def typical_error(material: Material) -> ClaimResult:
    """Count the updates up to the typical error and above the occasional one, run by run."""
    rows = scored(material).filter((pl.col("particles") >= CRITICAL) & pl.col("off_m").is_not_null())
    if rows.is_empty():
        raise MissingRuns(material.folder, f"holds no runs with {CRITICAL:,} particles or more")
    off = [np.array(values, np.float64)[FIRST_SCORED - 1 :] for values in rows["off_m"].to_list()]
    clusters = clusters_of(rows)
    typical = partial(mean, np.array([float((one <= TYPICAL_M).mean()) for one in off]), clusters)
    rare = partial(mean, np.array([float((one > RARE_M).mean()) for one in off]), clusters)
    ours = f"{said(typical(0.95), '% of updates', 100, 0)} up to 16 in, {rare(0.95).text(100, 1)} % above 30"
    return ClaimResult(ours, evidence=(ClaimFigure(typical, MOST), ClaimFigure(rare, 0, RARE)))


def ambiguous(material: Material) -> ClaimResult:
    """Replace the ambiguous sensor alone by the best one, on the same drives: how much error goes with it?"""
    rows = material.part("blended")
    before, after, clusters = paired(rows, "feature", "color", "best")
    kept = partial(mean, after - HALF * before, clusters)
    ranks = rows_of(material, "global-localization")["truth_rank"].drop_nulls().to_list()
    middle = float(np.median(np.concatenate(ranks))) if ranks else np.nan
    goes = 1 - float(after.mean()) / float(before.mean())
    ours = f"the truth's reference ranks {middle:.0f} in the median; {100 * goes:.0f} % of the error goes"
    words = f"{ours}: {said(kept(0.95), 'in', 1 / INCH_M)}, error with `best` less half of that with color"
    return ClaimResult(words, evidence=(ClaimFigure(kept, high=0),))


def precondition(material: Material) -> ClaimResult:
    """Look at the clouds of lost tracks when the loss begins: is any particle near the truth?"""
    rows = scored(material)
    lost = rows.filter(pl.col("lost")).sort("seed", "particles").head(RERUN)
    if lost.is_empty():
        return ClaimResult(f"none of {len(rows)} runs was lost", UNTESTABLE)
    none = np.array([_none_near(material, row) for row in lost.iter_rows(named=True)])
    figure = partial(share, none, clusters_of(lost))
    ours = f"{said(figure(0.95), '%', 100, 0)} of the lost had no particle within 12 in and 45 degrees"
    return ClaimResult(ours, evidence=(ClaimFigure(figure, MOST),))


def _none_near(material: Material, row: dict[str, object]) -> bool:
    begun = int(str(row["lost_at_update"])) - LOST_FOR + 1  # the first update of the loss
    for number, (moment, record) in enumerate(material.run_of(row), start=1):
        if number == begun and moment.truth is not None:
            return near_truth(record, moment.truth).particles == 0
    return False
