"""Figures of clouds and of what moves them: turning in place, ambiguity, fresh particles."""

from __future__ import annotations

from functools import cache
from itertools import islice
from typing import TYPE_CHECKING

import cv2
import numpy as np
import polars as pl

from maurice_datasets.robot.behaviors import BehaviorProposal
from maurice_datasets.robot.drive import Robot
from maurice_datasets.sessions import frame_of, session_info
from maurice_datasets.simulation import stage
from maurice_datasets.trials.drives import Drive, RenderedSession, bench_of, plan_of, world_of
from maurice_datasets.trials.plan import SessionSpec
from maurice_datasets.trials.statistics import Clusters, mean
from maurice_mcl.filter.localizer import Localizer
from maurice_mcl.filter.proposal import belief_at
from maurice_mcl.values.arrays import F64
from maurice_mcl.values.geometry import INCH_M
from maurice_mcl.values.nearest import spacing
from maurice_mcl.values.records import Belief, FilterState, StepRecord
from maurice_mcl.values.session import Moment
from maurice_viz.plots.calibration import ACTUAL, figure

from . import maps
from .drives import PRESET
from .material import EXAMPLE, Material, MissingRuns, ThesisFigure
from .over_particles import STYLES
from .traces import AIDED, BANDS, DEVIATION, LABELS, OFF, STRATEGY, panels

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

TURNS, TURN_RAD = 43, float(np.pi / 4)  # as many steps as the thesis's figure 33 has
BEGUN_M, BEGUN_RAD = 6 * INCH_M, float(np.radians(20))  # "reasonably well localized": ours
DRIVES, RUNS_A_PLACE = 20, 2
AMBIGUOUS, AT = 200, 3  # particles of figure 34; the picture that it shows
OFFSET, LARGEST = 0.33, 0.3  # of a circle from its node, and its diameter, in spacings of nodes


def turning_drive(spec: SessionSpec, seed: int, turns: int, turn_rad: float) -> Drive:
    """Return a simulated drive that only turns on the spot where it starts, a picture after every turn."""
    plan = plan_of(spec, seed)
    cv2.setNumThreads(1)
    set_up = stage(plan, world_of(spec.world, plan.arena_seed, spec.tier))
    robot, pose, moments = Robot(set_up.world.arena, plan.seed), set_up.course.start, []
    for step in range(1, turns + 1):
        turned = robot.move(step, pose, BehaviorProposal("turning", 0, turn_rad))
        pose, motions = turned.pose, turned.turn.measured[None]
        frame = frame_of(step, float(step), motions, set_up.eye.take(step, pose))
        moments.append(Moment(frame, pose))
    bench = bench_of(spec.world, plan.arena_seed, spec.tier)
    return Drive(
        RenderedSession(session_info(set_up), tuple(moments)), set_up.course.start, bench, plan.arena_seed
    )


def turning(material: Material) -> Figure:
    """Draw deviation and error while the robot turns in place: simulated turns of 45 degrees, many runs."""
    drawing, both = panels(1, 2, "turns of 45 degrees", "")
    drawing.set_size_inches(10.0, 4.6)
    for number, feature in enumerate(("color", "blended")):
        found, places = turned(material, feature)
        for axes, column in zip(both, (0, 1), strict=True):
            limits = [mean(np.array([run[column, at] for run in found]), places) for at in range(TURNS)]
            y, low, high = np.array([[run.value, run.low, run.high] for run in limits]).T / INCH_M
            color, marker, line = STYLES[number]
            x, caption = np.arange(1, TURNS + 1), f"{feature}, {len(found)} runs in {places.count} places"
            axes.plot(x, y, color=color, marker=marker, markevery=5, linestyle=line, label=caption)
            axes.fill_between(x, low, high, color=color, alpha=0.15, linewidth=0)
    for axes, label in zip(both, (LABELS[DEVIATION], LABELS[OFF]), strict=True):
        axes.set_ylabel(label)
        axes.set_ylim(0)
        axes.set_xlim(0)
    caption = (
        f"simulated; clouds begin with sd {BEGUN_M / INCH_M:.0f} in along x and y, and 20 degrees; {BANDS}"
    )
    handles, labels = both[0].get_legend_handles_labels()
    drawing.legend(
        handles, labels, loc="outside lower center", ncols=2, fontsize=8, title=caption, title_fontsize=8
    )
    return drawing


@cache
def turned(material: Material, feature: str) -> tuple[list[F64], Clusters]:
    """Return deviation and error (2, turns), of runs that turn in place, and at which place each does.

    There are as many places as the trials have drives, up to DRIVES, so that quick trials stay quick.
    """
    drives = _turning_drives(material.spec(EXAMPLE), min(DRIVES, material.rows["seed"].n_unique()))
    places = np.arange(RUNS_A_PLACE * len(drives)) % len(drives)
    runs = [
        _turned(material.localizer_on(drives[place], seed, preset=PRESET, feature=feature), drives[place])
        for seed, place in enumerate(places)
    ]
    return runs, Clusters.of(places, places)  # a place has one drive


@cache
def _turning_drives(spec: SessionSpec, count: int) -> list[Drive]:
    return [turning_drive(spec, seed, TURNS, TURN_RAD) for seed in range(count)]


def _turned(localizer: Localizer, drive: Drive) -> F64:
    """Return deviation and error (2, turns), in meters, of a cloud that begins about the truth."""
    start = drive.start
    if start is None:
        raise MissingRuns(None, "the drive's start is not known")
    rng = np.random.default_rng(localizer.seed)
    begun = belief_at(start, localizer.particles, localizer.library.origin)
    spread = rng.standard_normal((begun.size, 3)) * (BEGUN_M, BEGUN_M, BEGUN_RAD)
    state = FilterState(0, Belief((begun.poses + spread).astype(np.float32), begun.log_weights, begun.origin))
    rows_ = []
    for moment in drive.session.moments():
        state, record = localizer.step(state, moment.frame)
        rows_.append((np.hypot(*record.mean_estimate.sd_m), maps.off_in(record.estimate, start) * INCH_M))
    return np.array(rows_).T


def ambiguity(material: Material) -> Figure:
    """Draw how well a picture matches each reference: a circle a heading at every node, under a cloud."""
    moment, record = next(islice(material.steps(preset=PRESET, particles=AMBIGUOUS), AT - 1, None))
    library = material.library
    drawing, axes = figure("", maps.X, maps.Y)
    drawing.set_size_inches(9.4, 5.6)
    maps.map_axes(drawing, axes, library.arena)
    quality = record.sighting.comparison.quality.astype(np.float64)
    _circles(axes, library.poses, quality)
    maps.cloud(axes, maps.poses_of(record.belief), f"{AMBIGUOUS} particles", maps.ESTIMATE, "^", 4.0)
    if moment.truth is not None:
        maps.truth(axes, moment.truth)
    caption = (
        f"diameter: quality, {quality.min():.2f} to {quality.max():.2f};\nat each node one for each heading"
    )
    axes.plot([], [], "o", markerfacecolor="none", markeredgecolor=ACTUAL, label=caption)
    axes.plot([], [], linestyle="", label=f"after picture {AT}, start unknown")
    maps.legend_beside(drawing, axes)
    return drawing


def _circles(axes: Axes, poses: F64, quality: F64) -> None:
    from matplotlib.collections import EllipseCollection

    spacing_in = spacing(np.unique(poses[:, :2].round(3), axis=0)) / INCH_M
    toward = np.stack([np.cos(poses[:, 2]), np.sin(poses[:, 2])], axis=1)
    at = poses[:, :2] / INCH_M + OFFSET * spacing_in * toward
    wide = np.maximum(LARGEST * spacing_in * quality, 0.01)
    circles = EllipseCollection(
        wide,
        wide,
        np.zeros(len(wide)),
        units="xy",
        offsets=at,
        offset_transform=axes.transData,
        facecolor="none",
        edgecolor=ACTUAL,
        linewidth=0.7,
        zorder=1,
    )
    axes.add_collection(circles)


def fresh_particles(material: Material) -> Figure:
    """Draw a cloud before and after the first fresh particles of a kidnapped robot."""
    rows = material.part("recovery").filter(pl.col("label") == AIDED).sort("seed")
    for row in rows.iter_rows(named=True):
        fresh_step = _first_fresh(material, row)
        if fresh_step is not None:
            break
    else:
        raise MissingRuns(material.folder, f"holds no run with {STRATEGY} = {AIDED} that drew particles")
    moment, record = fresh_step
    arena, fresh = material.drive_of(row).bench.library.arena, record.injected
    drawing, places = panels(1, 2, maps.X, maps.Y)
    drawing.set_size_inches(11.0, 4.9)
    before, after = maps.poses_of(record.weighted), maps.poses_of(record.belief)
    for axes in places:
        maps.map_axes(drawing, axes, arena)
        if moment.truth is not None:
            maps.truth(axes, moment.truth)
        maps.estimate(axes, record.estimate.pose)
    maps.cloud(places[0], before, None)
    maps.cloud(places[1], after[~fresh] if fresh is not None else after, f"{len(before):,} particles")
    if fresh is not None:
        caption = f"{int(fresh.sum())} of them fresh, drawn from the picture"
        maps.cloud(places[1], after[fresh], caption, ACTUAL, "^", 4.0)
    at = record.frame.step - row["kidnapped_at_update"] + 1
    places[0].set_title(f"before: picture {at} after the kidnapping", fontsize=10)
    places[1].set_title("after: fresh particles among them", fontsize=10)
    drawing.legend(*places[1].get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=8)
    return drawing


def _first_fresh(material: Material, row: dict[str, object]) -> tuple[Moment, StepRecord] | None:
    """Return the first update after the kidnapping at which fresh particles were drawn."""
    kidnapped = False
    for moment, record in material.run_of(row):
        kidnapped = kidnapped or moment.kidnapped
        if kidnapped and record.injected is not None:
            return moment, record
    return None


FIGURES = (
    ThesisFigure(33, "Deviation and error while the robot turns in place", turning),
    ThesisFigure(34, f"Ambiguity: match quality at every node, and {AMBIGUOUS} particles", ambiguity),
    ThesisFigure(65, "Kidnapped: what sensor-aided sampling does to the cloud", fresh_particles),
)
