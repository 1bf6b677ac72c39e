"""Figures of single runs: true paths, clouds, estimates on the map, and how wrong they were meanwhile."""

from __future__ import annotations

from itertools import takewhile
from typing import TYPE_CHECKING

import numpy as np
import polars as pl

from maurice_datasets.trials.drives import Drive
from maurice_mcl.filter.localizer import run
from maurice_mcl.values.arrays import F64
from maurice_mcl.values.geometry import INCH_M
from maurice_mcl.values.map import Arena
from maurice_mcl.values.records import StepRecord
from maurice_mcl.values.session import Moment
from maurice_viz.plots.calibration import INK, figure

from . import maps
from .material import Material, MissingRuns, ThesisFigure
from .traces import LABELS, OFF, UPDATE, curve, panels

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PRESET = "thesis"
MANY, MOTION_ONLY, FEW = 5000, 500, 20  # particles of the thesis's figures 25, 12 and 64
TRAVEL_M = 116 * INCH_M  # of figure 12
CLOUDS, SEQUENCE = 7, 12
Run = list[tuple[Moment, StepRecord]]


def motion_only(material: Material) -> Figure:
    """Draw clouds along a path: 500 particles that only the motion model moves, and no picture corrects."""
    drive = material.tracking
    clouds, ways = motion_clouds(material, drive)
    way, truths = ways[-1], [_start_of(drive.start), *_truths_of(drive)][: len(clouds)]
    drawing, axes = figure("", maps.X, maps.Y)
    maps.map_axes(drawing, axes, drive.bench.library.arena)
    maps.path(axes, np.array(truths), f"true path, {way / INCH_M:.0f} in; arrow: start")
    chosen = np.unique(np.linspace(0, len(clouds) - 1, CLOUDS).round().astype(int))
    for number, at in enumerate(chosen):
        gray = str(0.75 - 0.5 * number / len(chosen))
        caption = f"{MOTION_ONLY} particles, motion model only" if at == chosen[-1] else None
        maps.cloud(axes, clouds[at], caption, color=gray)
        maps.truth(axes, truths[at], "truth at these updates" if number == 0 else None)
    maps.legend_beside(drawing, axes)
    return drawing


def motion_clouds(material: Material, drive: Drive) -> tuple[list[F64], F64]:
    """Return clouds (N, 3) that only the motion model moves, and how far the robot had driven at each."""
    localizer, truths = material.localizer_on(drive, 0, preset=PRESET), _truths_of(drive)
    first = truths[0] if drive.start is None else drive.start
    rng = np.random.default_rng(0)
    poses = np.tile(first.astype(np.float32), (MOTION_ONLY, 1))
    clouds, ways, last = [poses.astype(np.float64)], [0.0], first
    for moment, truth in zip(drive.session.moments(), truths, strict=False):
        if ways[-1] >= TRAVEL_M or localizer.motion is None:
            break
        for motion in moment.frame.motions if truth is not first else ():
            noise = rng.standard_normal((MOTION_ONLY, 3), np.float32)
            poses = localizer.motion.move(poses, np.zeros(2), motion, noise)
        ways.append(ways[-1] + float(np.hypot(*(truth[:2] - last[:2]))))
        clouds.append(poses.astype(np.float64))
        last = truth
    return clouds, np.array(ways)


def _truths_of(drive: Drive) -> list[F64]:
    """Return the true poses of a drive, up to where they are not known."""
    known = takewhile(lambda moment: moment.truth is not None, drive.session.moments())
    return [_truth_of(moment) for moment in known]


def true_path(material: Material) -> Figure:
    """Draw the true path of a drive on the map, with its start."""
    drive = material.tracking
    truths = [_start_of(drive.start)]
    truths += [moment.truth for moment in drive.session.moments() if moment.truth is not None]
    drawing, axes = figure("", maps.X, maps.Y)
    maps.map_axes(drawing, axes, drive.bench.library.arena)
    poses = np.array(truths)
    way = float(np.hypot(*np.diff(poses[:, :2], axis=0).T).sum()) / INCH_M
    maps.path(axes, poses, f"true path, {way:,.0f} in; arrow: start")
    axes.plot(*(poses[1:, :2] / INCH_M).T, ".", color=INK, markersize=5, label=f"{len(poses) - 1} pictures")
    maps.truth(axes, poses[-1], "end")
    maps.legend_beside(drawing, axes)
    return drawing


def final_cloud(material: Material) -> Figure:
    """Draw the cloud at the end of that drive: on the map, and close up."""
    drive = material.tracking
    localizer = material.localizer_on(drive, 0, preset=PRESET, particles=MANY)
    steps = list(run(localizer, drive.session, drive.start))
    moment, record = steps[-1]
    true, found = _truth_of(moment), record.estimate
    drawing, (whole, near) = panels(1, 2, maps.X, maps.Y)
    for axes in (whole, near):
        maps.map_axes(drawing, axes, drive.bench.library.arena)
        maps.cloud(axes, maps.poses_of(record.belief), f"{MANY:,} particles after {len(steps)} pictures")
        maps.truth(axes, true)
        caption = f"estimate: {maps.off_in(found, true):.1f} in off, confidence {found.confidence:.0%}"
        maps.estimate(axes, found.pose, caption)
    maps.close_up(near, true)
    drawing.legend(*whole.get_legend_handles_labels(), loc="outside lower center", ncols=3, fontsize=8)
    return drawing


def failed_run(material: Material) -> Figure:
    """Draw the clouds of a run with 500 particles that failed: the first one, by seed."""
    rows = material.part("global-localization", particles=MOTION_ONLY, feature="color")
    failed = rows.filter(pl.col("failure").is_not_null()).sort("seed")
    if failed.is_empty():
        why = f"none of its {len(rows)} global runs with {MOTION_ONLY} particles failed; --seeds makes more"
        raise MissingRuns(material.folder, why)
    row = failed.row(0, named=True)
    run = list(material.run_of(row))
    arena = material.drive_of(row).bench.library.arena
    drawing, places = panels(3, 4, maps.X, maps.Y)
    drawing.set_size_inches(11.0, 7.4)
    chosen = np.linspace(0, len(run) - 1, SEQUENCE).round().astype(int)
    for number, (axes, at) in enumerate(zip(places, chosen, strict=True)):
        moment, record = run[at]
        true = _truth_of(moment)
        maps.map_axes(drawing, axes, arena)
        maps.cloud(axes, maps.poses_of(record.belief), f"{MOTION_ONLY} particles")
        maps.truth(axes, true)
        maps.estimate(axes, record.estimate.pose)
        axes.set_title(f"picture {at + 1}: {maps.off_in(record.estimate, true):.0f} in off", fontsize=9)
        axes.label_outer()
        axes.tick_params(labelsize=7)
        if number == 0:
            caption = f"seed {row['seed']}, the first of {len(failed)} failed of {len(rows)} runs"
            axes.plot([], [], linestyle="", label=f"{caption}; cause: {row['failure']}")
    drawing.legend(*places[0].get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=8)
    return drawing


def evolution(material: Material) -> Figure:
    """Draw how the estimate of a global localization evolves: on the map, and its error."""
    run = list(material.steps(preset=PRESET))
    drawing, axes = _path_and_error(material.library.arena, run, "thesis filter, unknown start")
    off = [maps.off_in(record.estimate, _truth_of(moment)) for moment, record in run]
    deviation = [np.hypot(*record.mean_estimate.sd_m) / INCH_M for _, record in run]
    x = np.arange(1, len(run) + 1)
    axes.plot(x, off, color=maps.ESTIMATE, marker="o", markerfacecolor="none", label="error of the estimate")
    axes.plot(x, deviation, color="#0072B2", linestyle="--", label="deviation of the cloud")
    axes.set_ylabel("distance (in)")
    axes.legend(fontsize=8)
    axes.set_ylim(0)
    return drawing


def few_particles(material: Material) -> Figure:
    """Draw a global run with 20 particles: its estimates on the map, its error, and that of all such runs."""
    rows = material.part("global-localization", particles=FEW, feature="color").sort("seed")
    row = rows.row(0, named=True)
    run = list(material.run_of(row))
    arena = material.drive_of(row).bench.library.arena
    drawing, axes = _path_and_error(arena, run, f"{FEW} particles, seed {row['seed']}")
    x = np.arange(1, len(run) + 1)
    axes.plot(x, np.array(row[OFF]) / INCH_M, color=maps.ESTIMATE, label="this run")
    band = (
        np.array([[interval.value, interval.low, interval.high] for interval in curve(rows, OFF)]).T / INCH_M
    )
    steps = np.arange(1, band.shape[1] + 1)
    axes.plot(steps, band[0], "--", color=INK, label=f"mean, 95 % interval, {len(rows)} runs")
    axes.fill_between(steps, band[1], band[2], color=INK, alpha=0.15, linewidth=0)
    axes.set_ylabel(LABELS[OFF])
    axes.set_ylim(0)
    axes.legend(fontsize=8)
    return drawing


def _path_and_error(arena: Arena, run: Run, what: str) -> tuple[Figure, Axes]:
    """Return a figure whose left half is a map of truth and estimates, and its right half."""
    drawing, (place, axes) = panels(1, 2, UPDATE, "")
    drawing.set_size_inches(11.0, 4.6)
    maps.map_axes(drawing, place, arena)
    truths = [_truth_of(moment) for moment, _ in run]
    maps.path(place, np.array(truths), "true path; arrow: first picture")
    maps.estimates(place, [record.estimate for _, record in run], truths, f"estimates: {what}")
    for at in range(9, len(run), 10):
        x, y = run[at][1].estimate.pose[:2] / INCH_M
        place.annotate(str(at + 1), (x, y), (4, 4), textcoords="offset points", fontsize=7)
    place.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14), fontsize=8)
    return drawing, axes


def _start_of(pose: F64 | None) -> F64:
    if pose is None:
        raise MissingRuns(None, "the drive's start is not known")
    return pose


def _truth_of(moment: Moment) -> F64:
    if moment.truth is None:
        raise MissingRuns(None, "the drive's true poses are not known")
    return moment.truth


FIGURES = (
    ThesisFigure(12, "Clouds along a path, moved by the motion model only", motion_only),
    ThesisFigure(24, "Position tracking: the true path", true_path),
    ThesisFigure(25, "Position tracking: the cloud at the end", final_cloud),
    ThesisFigure(36, "Global localization: clouds of a run that failed", failed_run),
    ThesisFigure(40, "Global localization: how the estimate evolves", evolution),
    ThesisFigure(64, f"Global localization with {FEW} particles", few_particles),
)
