"""One filter step: ours, a naive float64 version, and the peers', in turn."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from maurice_mcl.filter.estimate import weighted_mean
from maurice_mcl.filter.motion import FloorDrift, MauriceMotion, MauriceParameters
from maurice_mcl.filter.proposal import ProposedParticles
from maurice_mcl.filter.resampling import multinomial, systematic
from maurice_mcl.filter.weighting import weigh
from maurice_mcl.sensor.descriptors.registry import CHANNELS
from maurice_mcl.sensor.model import SensorModel, SensorParameters
from maurice_mcl.sensor.references import NearestReference, nearest_reference
from maurice_mcl.values.arrays import F32, F64
from maurice_mcl.values.geometry import INCH_M
from maurice_mcl.values.library import ChannelIndex, Library
from maurice_mcl.values.map import Arena
from maurice_mcl.values.randomness import normals
from maurice_mcl.values.records import Belief, uniform_log_weights

from .measure import REPEATS, Table, Work, interleaved, ratio
from .peers import PeerProcess

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
    index = {name: random_index(rng, len(poses), bins[name]) for name in CHANNELS}
    library = Library("benchmark", poses, (None,) * len(poses), index, arena)
    return library, nearest_reference(poses, arena)


def random_index(rng: np.random.Generator, entries: int, bins: int = 84) -> ChannelIndex:
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


SIZES = {500: 40, 5_000: 20, 50_000: 6, 500_000: 3}  # particles -> rounds
SCHEMES = {"systematic": systematic, "multinomial": multinomial}


@dataclass(frozen=True, slots=True, eq=False)
class World:
    """What all filters of this benchmark share."""

    reference: NearestReference
    parameters: MauriceParameters
    origin: F64
    log_likelihood: F32

    @classmethod
    def make(cls) -> World:
        """Return a library of two rooms and one picture's likelihood."""
        library, reference = a_library(np.random.default_rng([2007, 1]))
        parameters = SensorParameters({"color": 1.0}, SHARPNESS, "power", "sum", distances=THESIS)
        sensor = SensorModel(library, reference, parameters)
        comparison = sensor.compare({"color": library.index["color"].references[300]})
        motion = MauriceParameters(drift={"": FloorDrift(0.01, 0.02)})
        return cls(reference, motion, library.origin, comparison.log_likelihood)

    def likelihood(self) -> F64:
        """Return the likelihood (L,) of every reference."""
        return np.exp(self.log_likelihood.astype(np.float64))


def ours(world: World, particles: int, scheme: str) -> Work:
    """Return our step: propose, weigh, estimate, resample."""
    rng = np.random.default_rng([2007, 4])
    motion, log_likelihood = MauriceMotion(world.parameters, world.reference.grid), world.log_likelihood
    poses = np.asfortranarray(_cloud(rng, particles), np.float32)
    belief = Belief(poses, uniform_log_weights(particles), world.origin)

    def step() -> object:
        moved = motion.move(belief.poses, belief.origin, MOVEMENT, normals(rng, particles))
        predicted = ProposedParticles(Belief(moved, belief.log_weights, belief.origin))
        weighted, _ = weigh(predicted, world.reference.at(log_likelihood, moved, belief.origin))
        estimate = weighted_mean(weighted)
        parents = SCHEMES[scheme](weighted.weights, particles, rng)
        copies = moved.T.take(parents, axis=1).T
        return Belief(copies, uniform_log_weights(particles), belief.origin), estimate

    return step


def naively(world: World, particles: int, scheme: str) -> Work:
    """Return the same step as one writes it first; systematic for either scheme."""
    rng = np.random.default_rng([2007, 5])
    naive = Naive(world.reference, world.parameters, world.origin)
    poses, equal, likelihood = _cloud(rng, particles), np.full(particles, 1 / particles), world.likelihood()
    return lambda: naive.step(poses, equal, likelihood, rng)


def _cloud(rng: np.random.Generator, particles: int) -> F64:
    xy = (rng.random((particles, 2)) - 0.5) * 1.5
    return np.column_stack([xy, rng.random(particles) * 2 * np.pi - np.pi])


def filter_steps(peers: Mapping[str, str], quick: bool) -> Table:
    """Measure one step of every filter in turn, at several sizes, with both schemes of resampling."""
    world, rows = World.make(), []
    there = [name for name, what in peers.items() if not what.startswith("missing")]
    names = ["ours", "naive float64", *there]
    with (
        tempfile.TemporaryDirectory() as folder,
        PeerProcess(Path(folder), world.reference, world.likelihood(), world.origin) as process,
    ):
        for particles, rounds in SIZES.items():
            for scheme in SCHEMES:
                works: dict[str, Work] = {"ours": ours(world, particles, scheme)}
                if scheme == "systematic":
                    works["naive float64"] = naively(world, particles, scheme)
                for name in there:
                    works[name] = partial(process.step, name, particles, scheme)
                took = interleaved(works, max(rounds // 5, 3) if quick else rounds, REPEATS)
                cells = [f"{took[n].median / particles * 1e9:.0f}" if n in took else "-" for n in names]
                fastest = min((took[name] for name in there), key=lambda times: times.median, default=None)
                against = "-" if fastest is None else ratio(fastest, took["ours"])
                rows.append([f"{particles:,}", scheme, *cells, against])
    notes = [f"{name} is {what}." for name, what in peers.items() if name not in there]
    return Table(
        "filter-step",
        "One filter step (predict, weigh, estimate, resample), nanoseconds a particle",
        ["particles", "resampling", *names, "fastest peer / ours"],
        rows,
        notes,
    )
