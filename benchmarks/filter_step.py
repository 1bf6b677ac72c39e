"""The filter step against a naive float64 version, a complete update by stage, one picture against a library.

Run `.venv/bin/python benchmarks/filter_step.py`. Medians of interleaved rounds, one thread, one process:
trust the ratios more than the nanoseconds.
"""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter
from typing import Any

import cv2
import numpy as np

import maurice_mcl as mcl
from maurice_mcl.filter.estimate import weighted_mean
from maurice_mcl.filter.localizer import weigh
from maurice_mcl.filter.motion import FloorDrift, MauriceMotion, MauriceParameters
from maurice_mcl.filter.proposal import ProposedParticles
from maurice_mcl.filter.resampling import systematic
from maurice_mcl.geometry import INCH_M
from maurice_mcl.library import ChannelIndex, Library
from maurice_mcl.map import Arena
from maurice_mcl.randomness import normals
from maurice_mcl.records import Belief, uniform_log_weights
from maurice_mcl.sensor.descriptors.registry import CHANNELS
from maurice_mcl.sensor.distances import thesis
from maurice_mcl.sensor.model import SensorModel, SensorParameters
from maurice_mcl.sensor.references import NearestReference, nearest_reference
from maurice_mcl.session import Frame

PARTICLES = 5000
ROUNDS = 400
MOVEMENT = np.array([0.4, 0.0, 0.5])  # a turn, then a straight: both halves of the motion model
SHARPNESS = 8.0
THESIS = {"color": "thesis", "edges": "thesis"}


def a_library(rng: np.random.Generator) -> tuple[Library, NearestReference]:
    """Make 78 places with 8 headings each, 624 entries of random pictures, two rooms and no floors."""
    columns, rows = np.meshgrid(np.arange(11), np.arange(8))
    places = (8 + 18 * np.column_stack([columns.ravel(), rows.ravel()])[:78]) * INCH_M
    headings = np.arange(8) * np.pi / 4 - np.pi
    poses = np.column_stack([np.repeat(places, 8, axis=0), np.tile(headings, 78)])
    walls = np.array([[102, 0, 102, 60], [102, 96, 102, 156]]) * INCH_M
    arena = Arena((0.0, 0.0, 204 * INCH_M, 156 * INCH_M), walls)
    gray = np.full((144, 176, 3), 128, np.uint8)
    bins = {name: len(channel.describe(gray)) for name, channel in CHANNELS.items()}
    index = {name: _random_index(rng, len(poses), bins[name]) for name in CHANNELS}
    library = Library("benchmark", poses, (None,) * len(poses), index, arena)
    return library, nearest_reference(poses, arena)


def _random_index(rng: np.random.Generator, entries: int, bins: int = 84) -> ChannelIndex:
    references = rng.gamma(0.6, 6.0, (entries, bins)).astype(np.float32)
    return ChannelIndex(references, np.full(bins, 0.5, np.float32), references.max(axis=0))


class Naive:
    """The same step as one writes it first: float64 throughout, weights not logs, `searchsorted`."""

    def __init__(self, reference: NearestReference, parameters: MauriceParameters, origin: Any) -> None:
        self.p, self.grid = parameters, reference.grid
        self.place, self.entry_of = reference.place_of_cell, reference.entry_of
        self.corner = reference.grid.corner - origin
        self.drift = parameters.drift[""]

    def step(self, poses: Any, weights: Any, likelihood: Any, rng: np.random.Generator) -> Any:
        """Predict, weigh, stand for by the weighted mean, resample: poses (N, 3) to poses (N, 3)."""
        poses = self.predict(poses, rng)
        weights = weights * self.likelihood_of(poses, likelihood)
        weights = weights / weights.sum()
        estimate = self.estimate(poses, weights)
        positions = (np.arange(len(weights)) + rng.random()) / len(weights)
        parents = np.searchsorted(np.cumsum(weights), positions)
        return poses[np.minimum(parents, len(weights) - 1)], estimate

    def predict(self, poses: Any, rng: np.random.Generator) -> Any:
        """Turn by the gain and residual, then go straight with the encoders' error and the floor's drift."""
        p, n = self.p, len(poses)
        forward, left, turn = MOVEMENT
        way = np.hypot(forward, left)
        heading = poses[:, 2] + p.turn_gain * turn + rng.normal(p.turn_bias_rad, p.turn_sd_rad, n)
        length = way + rng.normal(p.straight_bias_m, p.straight_sd_m, n)
        drift = way * rng.normal(self.drift.bias_rad_per_m, self.drift.sd_rad_per_m, n)
        course = heading + np.arctan2(left, forward)
        x = poses[:, 0] + length * np.cos(course)
        y = poses[:, 1] + length * np.sin(course)
        return np.stack([x, y, (heading + drift + np.pi) % (2 * np.pi) - np.pi], axis=1)

    def likelihood_of(self, poses: Any, likelihood: Any) -> Any:
        """Look up the likelihood of the entry that each pose is compared with; 0 outside."""
        rows, columns = self.grid.shape
        column = np.floor((poses[:, 0] - self.corner[0]) / self.grid.cell_m).astype(int)
        row = np.floor((poses[:, 1] - self.corner[1]) / self.grid.cell_m).astype(int)
        inside = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
        place = np.where(inside, self.place[np.where(inside, row * columns + column, 0)], -1)
        bins = self.entry_of.shape[1]
        heading = np.floor((poses[:, 2] + np.pi) / (2 * np.pi) * bins).astype(int) % bins
        return np.where(place >= 0, likelihood[self.entry_of[place, heading]], 0.0)

    def estimate(self, poses: Any, weights: Any) -> Any:
        """Return what `weighted_mean` gives: mean, spread, and the shares within 12 and 24 in of the mean."""
        x, y = np.average(poses[:, 0], weights=weights), np.average(poses[:, 1], weights=weights)
        s, c = np.sum(weights * np.sin(poses[:, 2])), np.sum(weights * np.cos(poses[:, 2]))
        sd_x = np.sqrt(np.average((poses[:, 0] - x) ** 2, weights=weights))
        sd_y = np.sqrt(np.average((poses[:, 1] - y) ** 2, weights=weights))
        away = np.hypot(poses[:, 0] - x, poses[:, 1] - y)
        shares = weights[away < 12 * INCH_M].sum(), weights[away < 24 * INCH_M].sum()
        return x, y, np.arctan2(s, c), np.sqrt(-2 * np.log(np.hypot(s, c))), sd_x, sd_y, shares


def interleaved(works: dict[str, Callable[[], object]], rounds: int = ROUNDS) -> dict[str, float]:
    """Run the works in turn, `rounds` times; give the median seconds of each."""
    took: dict[str, list[float]] = {name: [] for name in works}
    for _ in range(rounds):
        for name, work in works.items():
            began = perf_counter()
            work()
            took[name].append(perf_counter() - began)
    return {name: float(np.median(times)) for name, times in took.items()}


def filter_step() -> None:
    """Print ns per particle of both versions at 5,000 particles, and the ratio."""
    rng = np.random.default_rng([2007, 1])
    library, reference = a_library(rng)
    parameters = MauriceParameters(drift={"": FloorDrift(0.01, 0.02)})
    motion = MauriceMotion(parameters, reference.grid)
    sensor = SensorModel(
        library, reference, SensorParameters({"color": 1.0}, SHARPNESS, "power", "sum", distances=THESIS)
    )
    sample = library.index["color"].references[300]
    xy = (rng.random((PARTICLES, 2)) - 0.5) * (library.arena.size_m[0] * 0.3)
    poses = np.column_stack([xy, rng.random(PARTICLES) * 2 * np.pi - np.pi])
    belief = Belief(np.asfortranarray(poses, np.float32), uniform_log_weights(PARTICLES), library.origin)
    comparison = sensor.compare({"color": sample})
    likelihood = np.exp(comparison.log_likelihood.astype(np.float64))
    naive = Naive(reference, parameters, library.origin)
    equal = np.full(PARTICLES, 1 / PARTICLES)

    def ours() -> object:
        moved = motion.move(belief.poses, belief.origin, MOVEMENT, normals(rng, PARTICLES))
        predicted = Belief(moved, belief.log_weights, belief.origin)
        weighted, _ = weigh(
            ProposedParticles(predicted), reference.at(comparison.log_likelihood, moved, belief.origin)
        )
        estimate = weighted_mean(weighted)
        parents = systematic(weighted.weights, PARTICLES, rng)
        copies = moved.T.take(parents, axis=1).T
        return Belief(copies, uniform_log_weights(PARTICLES), belief.origin), estimate

    took = interleaved({"ours": ours, "naive": lambda: naive.step(poses, equal, likelihood, rng)})
    print(f"systematic filter step at {PARTICLES} particles, ns per particle")
    for name, seconds in took.items():
        print(f"  {name:6} {seconds / PARTICLES * 1e9:6.1f}")
    print(f"  naive / ours = {took['naive'] / took['ours']:.2f}   (goal 2.5)")


def whole_step(feature: str, particles: int, virtual: bool) -> None:
    """Print how long `Localizer.step` takes by stage, with 624 entries and pictures of 176 x 144.

    With `virtual` there are 3,648 references more, midway between these entries, as by default.
    """
    rng = np.random.default_rng([2007, 2])
    library, _ = a_library(rng)
    localizer = mcl.make_localizer(
        library,
        feature=feature,
        particles=particles,
        motion={"model": "maurice"},
        settings={"references.interpolation.virtual": virtual},
    )
    state = localizer.initialize(None)
    rows = []
    for step in range(1, 201):
        image = cv2.GaussianBlur(rng.integers(0, 256, (144, 176, 3), np.uint8), (0, 0), 1.5)
        motions = np.array([[0.0, 0.0, rng.uniform(-1, 1)], [rng.uniform(0.1, 0.3), 0.0, 0.0]])
        state, record = localizer.step(state, Frame(step, float(step), motions, image, ""))
        rows.append(record.took_s)
    stages = {name: float(np.median([row[name] for row in rows])) * 1e6 for name in rows[0]}
    inside = ", ".join(f"{name} {us:.0f}" for name, us in stages.items())
    name = f"{feature}, {particles} particles, {'with' if virtual else 'without'} virtual references"
    print(f"Localizer.step, {name}, us: {sum(stages.values()):.0f} ({inside})")


def one_picture() -> None:
    """Print one descriptor against 624 entries, and the same by float64 broadcasting."""
    rng = np.random.default_rng([2007, 3])
    index = _random_index(rng, 624)
    sample = index.references[300] + np.float32(0.25)
    references, floor, relevance = (
        np.asarray(a, np.float64) for a in (index.references, index.noise_floor, index.relevance)
    )
    sample64 = sample.astype(np.float64)

    def naive() -> object:
        return (np.maximum(np.abs(references - sample64) - floor, 0) / relevance).mean(axis=1)

    took = interleaved({"ours": lambda: thesis(sample, index), "naive": naive})
    ours, slow = took["ours"] * 1e3, took["naive"] * 1e3
    print(f"one picture against 624 entries: {ours:.3f} ms")
    print(f"  float64 broadcasting {slow:.3f} ms, naive / ours = {slow / ours:.1f}")


def main() -> None:
    """Run everything on one thread."""
    cv2.setNumThreads(1)
    filter_step()
    for feature, particles in (("blended", 2000), ("blended", PARTICLES), ("best", 1000)):
        whole_step(feature, particles, virtual=True)
        whole_step(feature, particles, virtual=False)
    one_picture()


if __name__ == "__main__":
    main()
