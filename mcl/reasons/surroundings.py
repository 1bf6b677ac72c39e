"""What a library says of one place: how well its references there fit a picture, or others, or another light.

Another light shows in how much brighter a picture is than the references at the true place, how well it would
have fitted them with that taken out, and whether the same parts of the view are the light ones: another light
leaves that as it is, something in view does not.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from ..sensor.descriptors.chromaticity import BLACK
from ..sensor.descriptors.tiny import COLUMNS, ROWS, Tiny
from ..sensor.distances import contributions
from ..sensor.model import SensorModel
from ..values import F32, F64, U8, Bool, Comparison, Frame, Library, distinct_places, spacing, wrap

SAME_WAY_RAD = float(np.radians(46))  # a reference turned further shows another view
HISTOGRAMS = ("color", "smoothed", "blurred")  # channels that hold the camera's histogram
SAME_VIEW_SPACINGS = 1.1  # references nearer than this show the same view
SAMPLED = 64  # entries that the usual cost is taken from
ALIKE_NATS = 1.0  # a place that scores less than this below the true one looks the same
LEAST_LEVEL = 2.0  # above black; a darker picture has no usable brightness
NOTABLE_RATIO = 0.1  # log of the brightness, from which on the picture is corrected and compared again

Index = NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class PlaceFit:
    """How one picture fits the true place, and the best other place."""

    cost: float  # nats, of the best reference at the true place: comparable between pictures
    behind: float  # nats of log-likelihood by which the best other place is ahead of the true pose
    estimate_behind: float  # by which the place of the estimate is ahead; 0 where that is the true one
    rank: int  # of the true place's best reference among all, from 1
    references: int
    rivals: int  # other places that score as well, within a nat; not counted where the estimate is right
    rival: tuple[float, float]  # x and y in m of the best of them
    costliest: str  # the channel that costs the true place most against the best other one
    costs: float  # nats that it costs
    entry: int = -1  # the true place's best reference
    other: int = -1  # the best one of another place


@dataclass(frozen=True, slots=True)
class UsualFit:
    """What the pictures of a library say of each other: what can be expected of a session's."""

    cost: float  # median, in nats, of a picture at the most similar one of the same view
    confused: float  # share of other places that are more similar than a neighbor; 0.5: it tells nothing
    by_channel: Mapping[str, float]  # the same of each channel alone


def layouts_of(tiny: F32) -> F64:
    """Return how light each part (L, 108) of pictures is, from their tiny images (L, 324)."""
    return np.asarray(tiny.reshape(len(tiny), ROWS * COLUMNS, 3).mean(axis=2, dtype=np.float64))


@dataclass(eq=False)
class Surroundings:
    """A library as seen from the places of a drive; built once a run."""

    sensor: SensorModel
    lost_m: float  # references farther than this are at another place

    @cached_property
    def spacing_m(self) -> float:
        """The usual distance between neighboring places of the library."""
        return spacing(distinct_places(self.sensor.library.poses[:, :2])[0])

    def to_reference_m(self, pose: F64) -> float:
        """Return the distance from a pose (3,) to the nearest reference of a similar heading."""
        poses = self.sensor.library.poses
        alike = np.abs(wrap(poses[:, 2] - pose[2])) <= SAME_WAY_RAD
        if not alike.any():
            return float("inf")
        return float(np.hypot(*(poses[alike, :2] - pose[:2]).T).min())

    def is_outside(self, pose: F64) -> bool:
        """Return whether a pose (3,) lies outside the free space of the map."""
        return int(self.sensor.references.entries(self._relative(pose), self.sensor.library.origin)[0]) < 0

    def near(self, pose: F64) -> Index:
        """Return the references that show the view from a pose (3,): near it, looking the same way."""
        return self._near(self._squared(pose), pose)

    def _near(self, squared: F64, pose: F64) -> Index:
        close = np.flatnonzero(squared <= (SAME_VIEW_SPACINGS * self.spacing_m) ** 2)
        entries: Index = close[np.abs(wrap(self._columns[2][close] - pose[2])) <= SAME_WAY_RAD]
        return entries

    def far(self, pose: F64) -> Bool:
        """Return which references (L,) are at another place than a pose (3,)."""
        return self._squared(pose) > self.lost_m**2

    def _squared(self, pose: F64) -> F64:
        """Return the squared distance (L,) of every reference from a pose (3,)."""
        x, y, _ = self._columns
        dx: F64 = x - pose[0]
        dy: F64 = y - pose[1]
        dx *= dx
        dy *= dy
        dx += dy
        return dx

    @cached_property
    def _columns(self) -> F64:
        """The poses of the references, (3, L): a column after the other."""
        return np.ascontiguousarray(self.sensor.library.poses.T)

    def fit(self, comparison: Comparison, truth: F64, estimate: F64) -> PlaceFit | None:
        """Say how a picture fits the truth (3,); None where nothing near it was compared.

        References are judged by channels, truth and estimate by all sensors, which know their own poses.
        """
        whole, comparison = comparison, comparison.by_channels
        squared, likely = self._squared(truth), comparison.log_likelihood
        near = self._near(squared, truth)
        others = np.flatnonzero(squared > self.lost_m**2)
        if not comparison.channels or not len(likely) or not len(near) or not len(others):
            return None
        poses = np.concatenate([self._relative(truth), self._relative(estimate)])
        nats = self.sensor.at(comparison, poses).log_likelihood
        here = float(nats[0])
        if not np.isfinite(here):
            return None
        sensed = None if whole is comparison else self.sensor.sense_at(whole, poses)
        if sensed is not None:
            nats = nats + np.float32(self.sensor.parameters.sharpness) * sensed
        there = float(nats[1]) - float(nats[0])
        entry = int(near[comparison.cost[near].argmin()])
        likely_there = likely[others]
        best = int(others[likely_there.argmax()])
        channel, costs = self._costliest(comparison, entry, best)
        same = float(np.hypot(*(truth - estimate)[:2])) <= self.lost_m
        x, y = self.sensor.library.poses[best, :2].tolist()
        return PlaceFit(
            cost=float(comparison.cost[entry]),
            behind=float(likely[best]) - here,
            estimate_behind=0.0 if same or not np.isfinite(there) else there,
            rank=int((likely > likely[near].max()).sum()) + 1,
            references=len(likely),
            rivals=0 if same else self._places(others[likely_there >= here - ALIKE_NATS]),
            rival=(x, y),
            costliest=channel,
            costs=costs,
            entry=entry,
            other=best,
        )

    def elements(self, image: U8, fit: PlaceFit) -> F32:
        """Return what each element (D,) of the costliest channel costs the true place, above the other one.

        In units of the channel's distance, see `maurice_mcl.sensor.distances.contributions`.
        """
        sensor, name = self.sensor, fit.costliest
        index, distance = sensor.library.index[name], sensor.parameters.distance_of(name)
        references = index.references[[fit.entry, fit.other]]
        adds = contributions(distance, sensor.measure(image)[name], references, index)
        return np.asarray(adds[0] - adds[1])

    @cached_property
    def usual(self) -> UsualFit:
        """How well the library's own pictures fit their neighbors, and other places."""
        sensor, library = self.sensor, self.sensor.library
        names, costs = list(sensor.weights), list[float]()
        confused: list[F64] = []
        if not names:  # a robot without a camera
            return UsualFit(float("nan"), 0.0, {})
        for entry in range(0, library.size, max(library.size // SAMPLED, 1)):
            near = self.near(library.poses[entry])
            near, far = near[near != entry], self.far(library.poses[entry])
            if not len(near) or not far.any():
                continue
            comparison = sensor.compare_reference(entry)
            costs.append(float(comparison.cost[near].min()))
            rows = np.concatenate([comparison.cost[None], comparison.channel_cost])
            confused.append((rows[:, far] < np.median(rows[:, near], axis=1)[:, None]).mean(axis=1))
        if not costs:
            return UsualFit(float("nan"), 0.0, {})
        shares = np.mean(confused, axis=0).tolist()
        return UsualFit(float(np.median(costs)), shares[0], dict(zip(names, shares[1:], strict=True)))

    @cached_property
    def levels(self) -> F64 | None:
        """The mean level (L, 3) of red, green and blue in each reference; None where it is not measured."""
        return levels_of(self.sensor.library)

    def expected_levels(self, pose: F64) -> F64 | None:
        """Return the mean levels (3,) that a picture from a pose (3,) should have; None where not known."""
        return self._expected(self.levels, pose)

    @cached_property
    def layouts(self) -> F64 | None:
        """How light each of 12 x 9 parts (L, 108) of each reference is; None where it is not measured."""
        tiny = self.sensor.library.index.get(Tiny.name)
        return None if tiny is None else layouts_of(tiny.references)

    def expected_layout(self, pose: F64) -> F64 | None:
        """Return how light each part (108,) of a picture from a pose (3,) should be; None where not known."""
        return self._expected(self.layouts, pose)

    def _expected(self, measured: F64 | None, pose: F64) -> F64 | None:
        """Average what was measured (L, N) over the references that show the view from a pose (3,)."""
        near = self.near(pose)
        if measured is None or not len(near):
            return None
        poses = self.sensor.library.poses[near]
        distance = np.hypot(*(poses[:, :2] - pose[:2]).T) / (0.5 * self.spacing_m)
        turned = 1.01 - np.abs(wrap(poses[:, 2] - pose[2])) / SAME_WAY_RAD
        return np.asarray(np.average(measured[near], axis=0, weights=np.exp(-0.5 * distance**2) * turned))

    def _costliest(self, comparison: Comparison, entry: int, other: int) -> tuple[str, float]:
        weights = np.array([self.sensor.weights[name] for name in comparison.channels])
        costs = weights * (comparison.channel_cost[:, entry] - comparison.channel_cost[:, other])
        most = int(costs.argmax())
        return comparison.channels[most], float(costs[most])

    def _places(self, entries: Index) -> int:
        """Count places at least `lost_m` apart among entries."""
        places, count = self.sensor.library.poses[entries, :2], 0
        while len(places):
            places, count = places[np.hypot(*(places - places[0]).T) > self.lost_m], count + 1
        return count

    def _relative(self, pose: F64) -> F32:
        return np.asarray(pose - np.append(self.sensor.library.origin, 0.0), np.float32)[None]


# Another light.


@dataclass(frozen=True, slots=True)
class LightFit:
    """One picture beside what the references at the true place make expect."""

    ratio: float  # log of its brightness over the expected one: negative where it is darker
    level: float  # mean gray level of the picture
    expected: float  # and that of the references
    cost: float  # nats of the true place, as `PlaceFit.cost`, of the corrected picture
    behind: float  # and as `PlaceFit.behind`
    colors: float = 1.0  # share of `ratio` by which the least changed of red, green and blue changed


def levels_of(library: Library) -> F64 | None:
    """Return the mean level (L, 3) of red, green and blue in each reference; None where not measured."""
    color = next((library.index[name] for name in HISTOGRAMS if name in library.index), None)
    if color is None:
        return None
    shares = color.references.reshape(len(color.references), 3, -1).astype(np.float64)
    centers = np.linspace(16, 240, shares.shape[2], endpoint=False) + 112 / shares.shape[2]
    return np.asarray((shares * centers).sum(axis=2) / np.maximum(shares.sum(axis=2), 1e-9))


def mean_level(image: U8) -> float:
    """Return the mean gray level of a picture, 0 to 255; NaN for one without pixels."""
    return sum(cv2.mean(image)[:3]) / 3 if image.size else float("nan")


def light_fit(
    surroundings: Surroundings, image: U8, truth: F64, estimate: F64, fit: PlaceFit
) -> LightFit | None:
    """Compare a picture's brightness with that expected at the truth (3,); None where not known."""
    expected = surroundings.expected_levels(truth)
    if expected is None:
        return None
    levels = image.reshape(-1, 3).mean(axis=0)
    over, target = (np.maximum(mean - BLACK, LEAST_LEVEL) for mean in (levels, expected))
    ratio = float(np.log(over.sum() / target.sum()))
    if abs(ratio) < NOTABLE_RATIO:
        return LightFit(ratio, float(levels.mean()), float(expected.mean()), fit.cost, fit.behind)
    brighter = np.clip((image - BLACK) * (target / over) + BLACK, 0, 255).astype(np.uint8)
    corrected = surroundings.sensor.see(Frame(0, 0.0, np.empty((0, 3)), brighter, ""))
    again = surroundings.fit(corrected, truth, estimate)
    colors = float((np.log(over / target) / ratio).min())
    cost, behind = (fit.cost, fit.behind) if again is None else (again.cost, again.behind)
    return LightFit(ratio, float(levels.mean()), float(expected.mean()), cost, behind, colors)


def layout_fit(
    surroundings: Surroundings, image: U8, truth: F64, descriptors: Mapping[str, F32]
) -> float | None:
    """Correlate a picture's layout with the expected one; 0 for an even picture, None where not known.

    `descriptors` are what was measured in the picture.
    """
    expected = surroundings.expected_layout(truth) if image.size else None
    if expected is None:
        return None
    tiny = descriptors.get(Tiny.name)
    seen = layouts_of((Tiny().describe(image) if tiny is None else tiny)[None])[0]
    return float(np.corrcoef(seen, expected)[0, 1]) if seen.std() > 0 < expected.std() else 0.0
