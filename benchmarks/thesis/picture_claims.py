"""Samples of the thesis's claims from pictures and clouds, which are made again: matches, turns, losses."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
import polars as pl

from maurice_datasets.trials.statistics import apart
from maurice_datasets.trials.table import clusters_of
from maurice_mcl.scoring.modes import near_truth
from maurice_mcl.scoring.table import LOST_FOR
from maurice_mcl.sensor.descriptors.registry import CHANNELS
from maurice_mcl.sensor.distances import thesis
from maurice_mcl.values.arrays import F64
from maurice_mcl.values.geometry import INCH_M
from maurice_mcl.values.library import ChannelIndex

from .clouds import turned
from .drives import motion_clouds
from .example import DrivePictures, rooms_of
from .material import Material, MissingRuns, Row
from .run_claims import differences, lost_tracks
from .verdicts import MEAN, SHARE, Sample, Samples

RERUN = 40  # lost tracks that are made again: of each drive that with the fewest particles, the first by seed
FLOOR_SHARE = 0.25  # of the noise floor's peak, from which on it dominates a bin


def of_drives(values: Sequence[F64] | Sequence[float], kind: str = MEAN) -> Sample:
    """Return the sample of what each drive's pictures (P,) show in the mean; each drive has an arena."""
    means = np.array([float(np.mean(drive)) for drive in values])
    return Sample(kind, means, apart(len(means)))


def best_quality(material: Material) -> Samples:
    """Tell the quality of the best entry, and the share of entries with a middling one."""
    qualities = [album.quality("color") for album in material.several]
    middling = [((quality >= 0.3) & (quality <= 0.7)).mean(axis=1) for quality in qualities]
    return of_drives([quality.max(axis=1) for quality in qualities]), of_drives(middling, SHARE)


def two_rooms(material: Material) -> Samples:
    """Compare the quality of references in the robot's room with that of those in the other."""
    steps = [_step_of(album) for album in material.several if len(rooms_of(album.library)) > 1]
    if not steps:
        raise MissingRuns(material.folder, "holds no drives through more than one room")
    return (of_drives(steps),)


def _step_of(album: DrivePictures) -> F64:
    """Return, picture by picture (T,), how much better the references of its own room match."""
    quality, rooms = album.quality("color"), np.stack([there for _, there in rooms_of(album.library)])
    here = rooms[rooms[:, album.entries].argmax(axis=0)]  # (T, L)
    own, other = (np.where(some, quality, np.nan) for some in (here, ~here))
    return np.asarray(np.nanmean(own, axis=1) - np.nanmean(other, axis=1), np.float64)


def dark_bins(material: Material) -> Samples:
    """Compare the largest counts of the library in the lower half of the bins with those in the upper."""
    more = []
    for album in material.several:
        largest = album.library.index["color"].relevance.reshape(3, -1)
        half = largest.shape[1] // 2
        more.append(float(largest[:, :half].mean() - largest[:, half:].mean()))
    return (of_drives(more),)


def floor_bins(material: Material) -> Samples:
    """Compare how far the best match is off in the noise floor's bins, with the floor and without it."""
    return (of_drives([_off_in_floor_bins(album) for album in material.several]),)


def _off_in_floor_bins(album: DrivePictures) -> F64:
    """Return, picture by picture (T,), how much farther off the best match is there with the floor."""
    index = album.library.index["color"]
    bins = index.noise_floor >= FLOOR_SHARE * index.noise_floor.max()
    without = ChannelIndex(index.references, np.zeros_like(index.noise_floor), index.relevance)
    more = []
    for image in album.images:
        sample = CHANNELS["color"].describe(image)
        off = np.abs(index.references[:, bins] - sample[bins]).mean(axis=1)
        with_floor, plain = (off[int(thesis(sample, each).argmin())] for each in (index, without))
        more.append(float(with_floor - plain))
    return np.array(more)


def compounding(material: Material) -> Samples:
    """Compare the deviation that the motion model alone gives after a way with that after half of it."""
    more = []
    for album in material.several:
        clouds, ways = motion_clouds(material, album.drive)
        sds = np.array([np.hypot(*cloud[:, :2].std(axis=0)) for cloud in clouds]) / INCH_M
        half, whole = np.interp([ways[-1] / 2, ways[-1]], ways, sds)
        more.append(float(whole - 2 * half))
    return (of_drives(more),)


def turning(material: Material) -> Samples:
    """Tell how error and deviation change while the robot turns in place."""
    runs, places = turned(material, "color")
    deviation, error = (np.array([run[k, -1] - run[k, 0] for run in runs]) / INCH_M for k in (0, 1))
    return Sample(MEAN, error, places), Sample(MEAN, deviation, places)


def sharpened(material: Material) -> Samples:
    """Tell how the deviation changes while the robot turns in place."""
    return turning(material)[1:]


def ambiguous(material: Material) -> Samples:
    """Replace the ambiguous sensor alone by the best one, on the same drives: how much error is left?"""
    rows = material.part("blended")
    before = rows.with_columns(
        error_mean_m=pl.when(pl.col("feature") == "color")
        .then(pl.col("error_mean_m") / 2)
        .otherwise("error_mean_m")
    )
    return (differences(before, "feature", "color", "best"),)


def precondition(material: Material) -> Samples:
    """Look at the clouds of lost tracks when the loss begins: is any particle near the truth?"""
    ends = _ends(material)
    return (Sample(SHARE, np.array([end[0] for end in ends]), clusters_of(_lost(material))),)


def by_chance(material: Material) -> Samples:
    """Tell which lost tracks that began with no particle near the truth are right at the end."""
    ends, lost = np.array(_ends(material)), _lost(material)
    alone = ends[:, 0] == 1
    if not alone.any():
        raise MissingRuns(material.folder, "holds no lost track without a particle near the truth")
    return (Sample(SHARE, ends[alone, 1], clusters_of(lost)[alone]),)


def _lost(material: Material) -> pl.DataFrame:
    lost = (
        lost_tracks(material).sort("particles").unique(["arena", "seed"], keep="first", maintain_order=True)
    )
    return (
        lost.sort("seed").head(RERUN).sort("arena", "seed")
    )  # an arena takes longer to light than a drive to make again


@cache
def _ends(material: Material) -> list[tuple[float, float]]:
    """Make lost tracks again: was no particle near the truth as the loss began, did it end right?"""
    return [_end(material, row) for row in _lost(material).iter_rows(named=True)]


def _end(material: Material, row: Row) -> tuple[float, float]:
    begun = int(row["lost_at_update"]) - LOST_FOR + 1  # the first update of the loss
    for number, (moment, record) in enumerate(material.run_of(row), start=1):
        if number == begun and moment.truth is not None:
            return float(near_truth(record, moment.truth).particles == 0), float(bool(row["right_at_end"]))
    return 0.0, float(bool(row["right_at_end"]))
