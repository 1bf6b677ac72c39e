"""The error budget of a drive: what remains of its error when one part of the filter is made perfect.

Each part is made perfect alone, over the same pictures and seeds, by what only the truth can tell; so these
are measurements of a filter, never a filter. What perfection takes off the error is what the part costs. The
costs need not add up to the error: parts make up for one another.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np

from ..errors import InputError
from ..filter.localizer import Localizer
from ..filter.proposal import MotionProposal, regions
from ..scoring.batch import SeededRuns
from ..scoring.metrics import score_table
from ..scoring.table import RunTable
from ..sensor.model import SensorModel
from ..sensor.references import nearest_reference
from ..sensor.virtual_references import virtual_references
from ..values.arrays import F32, F64, Bool
from ..values.geometry import compose, motion_between, wrap, wrap_angle
from ..values.library import Library
from ..values.nearest import distinct_places, spacing
from ..values.records import Comparison
from ..values.session import Moment

AS_IS = "as it is"
MOTION = "true movements"
SENSOR = "perfect sensor, same references"
LIBRARY = "perfect sensor, dense references"
SAMPLING = "100,000 particles"
PARTS = (AS_IS, MOTION, SENSOR, LIBRARY, SAMPLING)
MANY_PARTICLES = 100_000

DENSER = 4  # times as many references along each direction
MOST_PLACES = 2_500  # of the dense references
DENSE_HEADINGS = 16
WIDEST_RAD = np.pi / 4  # between headings of a library's place: above it, a picture shows another view
LEAST_NATS = -60.0  # of a perfect sensor far from the truth: one that is not sure forever
NOISE_SHARE, NOISE_M, NOISE_RAD = 0.01, 0.001, float(np.radians(0.1))


@dataclass(frozen=True, slots=True, eq=False)
class BudgetLine:
    """What a filter reaches with one part made perfect."""

    part: str  # one of PARTS
    errors_m: F64  # (R,) mean position error of each run, over updates 4 to the last
    lost: Bool  # (R,) whether each run was ever lost


@dataclass(frozen=True, slots=True)
class TrueMotion:
    """Moves every particle by the true movement; 1 % of noise keeps copies apart."""

    def move(self, poses: F32, origin: F64, motion: F64, noise: F32) -> F32:
        """See `MotionModel.move`; columns of `noise`: along, across, turn."""
        forward, left, turn = (float(value) for value in motion)
        sd_m = NOISE_M + NOISE_SHARE * float(np.hypot(forward, left))
        sd_rad = NOISE_RAD + NOISE_SHARE * abs(turn)
        sin, cos = np.sin(poses[:, 2]), np.cos(poses[:, 2])
        along = np.float32(forward) + noise[:, 0] * np.float32(sd_m)
        across = np.float32(left) + noise[:, 1] * np.float32(sd_m)
        heading = wrap(poses[:, 2] + np.float32(turn) + noise[:, 2] * np.float32(sd_rad))
        moved = (poses[:, 0] + cos * along - sin * across, poses[:, 1] + sin * along + cos * across, heading)
        return np.asarray(np.stack(moved), np.float32).T


def with_perfect(part: str, runs: SeededRuns) -> SeededRuns:
    """Return runs of a filter with one part made perfect. InputError for a drive without truth."""
    localizer, moments, comparisons = runs.localizer, runs.moments, runs.comparisons
    if not any(moment.truth is not None for moment in moments):
        raise InputError(None, "found no truth in the session; an error budget is made from the errors")
    if part == MOTION:
        localizer, moments = replace(localizer, motion=TrueMotion()), with_true_motions(moments, runs.start)
    elif part == SENSOR:
        comparisons = perfect_comparisons(localizer, moments, comparisons)
    elif part == LIBRARY:
        localizer = with_dense_references(localizer)
        comparisons = perfect_comparisons(localizer, moments, comparisons)
    elif part == SAMPLING:
        localizer = replace(localizer, particles=max(MANY_PARTICLES, localizer.particles))
    return replace(runs, localizer=localizer, moments=moments, comparisons=comparisons)


def budget_line(part: str, runs: Sequence[RunTable]) -> BudgetLine:
    """Score runs of a filter with one part made perfect."""
    scores = [score_table(run) for run in runs]
    errors = [np.nan if s.error_mean_m is None else s.error_mean_m for s in scores]
    return BudgetLine(part, np.array(errors), np.array([score.lost is True for score in scores]))


def with_true_motions(moments: Sequence[Moment], start: F64 | None) -> list[Moment]:
    """Return the moments with the movement from truth to truth in place of odometry.

    Where the robot was carried there is no movement: no odometer measures it. An update without truth
    keeps its own, and the next one with truth leads from there.
    """
    moved, here = [], start
    for moment in moments:
        truth, here = moment.truth, None if moment.kidnapped else here
        if truth is not None:
            motions = np.zeros((0, 3)) if here is None else motion_between(here, truth)[None]
            moment, here = replace(moment, frame=replace(moment.frame, motions=motions)), truth
        elif here is not None:
            here = reduce(compose, moment.frame.motions, here)
        moved.append(moment)
    return moved


def perfect_comparisons(
    localizer: Localizer, moments: Sequence[Moment], comparisons: Sequence[Comparison]
) -> list[Comparison]:
    """Return comparisons in which the references nearest the truth are the best, by a Gaussian of distance.

    Its standard deviation is half the references' spacing, and half the angle between their headings. A
    picture without truth, or that was not compared, says nothing.
    """
    library, virtual = localizer.library, any(len(comparison.virtual) for comparison in comparisons)
    poses = library.poses
    if virtual and localizer.sensor.references is not localizer.reference:
        poses = np.concatenate([poses, virtual_references(poses, library.arena).poses])
    sd_m, sd_rad = _spread(library)
    return [
        _perfect(poses, library.size, moment.truth if len(comparison.quality) else None, sd_m, sd_rad)
        for moment, comparison in zip(moments, comparisons, strict=True)
    ]


def _spread(library: Library) -> tuple[float, float]:
    places, _ = distinct_places(library.poses[:, :2])
    between_rad = 2 * np.pi * len(places) / library.size
    return spacing(places) / 2, float(min(between_rad, WIDEST_RAD)) / 2


def _perfect(poses: F64, entries: int, truth: F64 | None, sd_m: float, sd_rad: float) -> Comparison:
    """Return what a perfect sensor would say of poses (K, 3), of which the first are a library's."""
    log = np.zeros(len(poses))
    if truth is not None:
        away = np.square(poses[:, :2] - truth[:2]).sum(axis=1) / sd_m**2
        away += np.square(wrap_angle(poses[:, 2] - truth[2]) / sd_rad)
        log = -0.5 * (away - away[:entries].min())
    nats = np.clip(log, LEAST_NATS, None).astype(np.float32)
    cost = np.maximum(-nats[:entries], 0)
    quality = np.exp(-cost)
    return Comparison(
        channels=("truth",),
        descriptors={},
        distances=cost[None],
        channel_quality=quality[None],
        quality=quality,
        channel_cost=cost[None],
        cost=cost,
        log_likelihood=nats[:entries],
        virtual=nats[entries:],
    )


def with_dense_references(localizer: Localizer) -> Localizer:
    """Return the filter over references that lie a quarter as far apart, all over the free floor.

    On a floor so large that there would be more than 2,500 places, they lie farther apart.
    """
    grid, places = localizer.reference.grid, localizer.reference.places
    floor = grid.centers()[grid.free.ravel()]
    every = max(spacing(places) / DENSER, float(np.sqrt(len(floor) * grid.cell_m**2 / MOST_PLACES)))
    columns = np.round((floor - places[0]) / every).astype(np.int64)
    off_m = np.abs(floor - (places[0] + columns * every)).max(axis=1)
    order = np.lexsort((off_m, columns[:, 1], columns[:, 0]))
    _, first = np.unique(columns[order], axis=0, return_index=True)
    dense = np.repeat(floor[order][first], DENSE_HEADINGS, axis=0)
    headings = np.tile(np.arange(DENSE_HEADINGS) * (2 * np.pi / DENSE_HEADINGS) - np.pi, len(first))
    poses = np.column_stack([dense, headings])
    library = Library("dense", poses, (None,) * len(poses), {}, localizer.arena)
    nearest = nearest_reference(poses, library.arena)
    where, mixture = regions(nearest, library.size), localizer.proposal.mixture
    return replace(
        localizer,
        library=library,
        reference=nearest,
        regions=where,
        sensor=SensorModel(library, nearest, localizer.sensor.parameters),
        proposal=replace(mixture, reference=nearest, regions=where) if mixture else MotionProposal(),
        recovery=replace(localizer.recovery, reference=nearest, regions=where),
    )
