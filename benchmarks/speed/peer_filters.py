"""One filter step by other Python libraries; runs in an environment of their own, which has no maurice_*.

    python benchmarks/speed/peer_filters.py TABLES.npz

reads one request a line, `{"peer": "filterpy", "particles": 5000, "scheme": "systematic"}`, and answers each
with a line: the seconds of one step, or why there are none. Motion, likelihood and estimate are the same for
all, in float64 numpy as a user of these libraries writes them; filter and resampling are the library's.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator
from importlib import import_module
from time import perf_counter
from typing import Any

import numpy as np

FORWARD_M, TURN_RAD = 0.4, 0.5
SCHEMES = ("systematic", "multinomial")


class World:
    """The motion, the likelihood and the estimate that all peers share."""

    def __init__(self, tables: Any) -> None:
        self.place, self.entry_of, self.likelihood = tables["place"], tables["entry_of"], tables["likelihood"]
        self.corner, self.cell_m, self.shape = tables["corner"], float(tables["cell_m"]), tables["shape"]
        self.rng = np.random.default_rng(2007)

    def cloud(self, count: int) -> Any:
        """Return poses (N, 3) around the middle."""
        xy = (self.rng.random((count, 2)) - 0.5) * 1.5
        return np.column_stack([xy, self.rng.random(count) * 2 * np.pi - np.pi])

    def moved(self, poses: Any) -> Any:
        """Turn, then go straight, with noise of each and drift."""
        count = len(poses)
        heading = poses[:, 2] + TURN_RAD + self.rng.normal(0.005, 0.086, count)
        length = FORWARD_M + self.rng.normal(-0.018, 0.016, count)
        drift = FORWARD_M * self.rng.normal(0.01, 0.02, count)
        x, y = poses[:, 0] + length * np.cos(heading), poses[:, 1] + length * np.sin(heading)
        return np.stack([x, y, (heading + drift + np.pi) % (2 * np.pi) - np.pi], axis=1)

    def weights(self, poses: Any) -> Any:
        """Look up the likelihood (N,) of the reference that each pose is compared with; small outside."""
        rows, columns = self.shape
        column = np.floor((poses[:, 0] - self.corner[0]) / self.cell_m).astype(int)
        row = np.floor((poses[:, 1] - self.corner[1]) / self.cell_m).astype(int)
        inside = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
        place = np.where(inside, self.place[np.where(inside, row * columns + column, 0)], -1)
        bins = self.entry_of.shape[1]
        heading = np.floor((poses[:, 2] + np.pi) / (2 * np.pi) * bins).astype(int) % bins
        return np.where(place >= 0, self.likelihood[self.entry_of[place, heading]], 1e-300)

    def estimate(self, poses: Any, weights: Any) -> Any:
        """Return mean, spread, and the shares within two radii of the mean."""
        x, y = np.average(poses[:, 0], weights=weights), np.average(poses[:, 1], weights=weights)
        s, c = np.sum(weights * np.sin(poses[:, 2])), np.sum(weights * np.cos(poses[:, 2]))
        sd_x = np.sqrt(np.average((poses[:, 0] - x) ** 2, weights=weights))
        sd_y = np.sqrt(np.average((poses[:, 1] - y) ** 2, weights=weights))
        away = np.hypot(poses[:, 0] - x, poses[:, 1] - y)
        return (
            x,
            y,
            np.arctan2(s, c),
            np.hypot(s, c),
            sd_x,
            sd_y,
            weights[away < 0.3].sum(),
            weights[away < 0.6].sum(),
        )


def filterpy(world: World, count: int, scheme: str) -> Iterator[None]:
    """Its resampling functions; the rest of the filter is the user's."""
    resample = getattr(import_module("filterpy.monte_carlo"), f"{scheme}_resample")
    poses, weights = world.cloud(count), np.full(count, 1 / count)
    while True:
        poses = world.moved(poses)
        weights = weights * world.weights(poses)
        weights = weights / weights.sum()
        world.estimate(poses, weights)
        poses, weights = poses[resample(weights)], np.full(count, 1 / count)
        yield


def particles(world: World, count: int, scheme: str) -> Iterator[None]:
    """Its SMC sampler over a Feynman-Kac model, resampling at every step."""
    library = import_module("particles")

    class Model(library.FeynmanKac):  # type: ignore[misc,name-defined]
        def __init__(self) -> None:
            super().__init__(10**9)

        def M0(self, N: int) -> Any:
            return world.cloud(N)

        def M(self, t: int, xp: Any) -> Any:
            return world.moved(xp)

        def logG(self, t: int, xp: Any, x: Any) -> Any:
            return np.log(world.weights(x))

    sampler = library.SMC(fk=Model(), N=count, resampling=scheme, ESSrmin=1.0, collect="off")
    for _ in sampler:
        world.estimate(sampler.X, sampler.W)
        yield


def pfilter(world: World, count: int, scheme: str) -> Iterator[None]:
    """Its ParticleFilter, resampling at every update."""
    library = import_module("pfilter")
    weigh = {"weight_fn": lambda hypotheses, observed, **_: hypotheses[:, 0]}
    filter_ = library.ParticleFilter(
        prior_fn=world.cloud,
        observe_fn=lambda poses, **_: world.weights(poses)[:, None],
        dynamics_fn=lambda poses, **_: world.moved(poses),
        noise_fn=lambda poses, **_: poses,
        resample_fn=getattr(library, f"{scheme}_resample", library.resample),
        n_particles=count,
        n_eff_threshold=1.0,
        resample_proportion=0.0,
        **weigh,
    )
    while True:
        filter_.update(np.ones(1))
        world.estimate(filter_.original_particles, filter_.original_weights)
        yield


def stonesoup(world: World, count: int, scheme: str) -> Iterator[None]:
    """Its particle predictor and updater, with a motion and a measurement model as it asks for them."""
    from datetime import datetime, timedelta

    array = import_module("stonesoup.types.array").StateVectors
    Base = import_module("stonesoup.models.measurement.nonlinear").NonLinearGaussianMeasurement
    Transition = import_module("stonesoup.models.transition").TransitionModel
    resamplers = import_module("stonesoup.resampler.particle")
    state = import_module("stonesoup.types.state")
    detection = import_module("stonesoup.types.detection").Detection
    predictor = import_module("stonesoup.predictor.particle").ParticlePredictor
    updater = import_module("stonesoup.updater.particle").ParticleUpdater
    hypothesis = import_module("stonesoup.types.hypothesis").SingleHypothesis

    class Drive(Transition):  # type: ignore[misc,valid-type]
        ndim_state = 3

        def function(self, state: Any, noise: Any = False, **_: Any) -> Any:
            return array(world.moved(np.asarray(state.state_vector, float).T).T)

        def rvs(self, num_samples: int = 1, **_: Any) -> Any:
            raise NotImplementedError

        def pdf(self, *_: Any, **__: Any) -> Any:
            raise NotImplementedError

    class Picture(Base):  # type: ignore[misc,valid-type]
        ndim_meas = 3

        def function(self, state: Any, noise: Any = False, **_: Any) -> Any:
            return state.state_vector

        def logpdf(self, measured: Any, state: Any, **_: Any) -> Any:
            return np.log(world.weights(np.asarray(state.state_vector, float).T))

    model = Picture(ndim_state=3, mapping=(0, 1, 2), noise_covar=np.eye(3))
    resampler = {"systematic": "SystematicResampler", "multinomial": "MultinomialResampler"}[scheme]
    update = updater(model, resampler=getattr(resamplers, resampler)())
    predict = predictor(Drive())
    now = datetime(2000, 1, 1)
    equal = np.full(count, -np.log(count))
    cloud = state.ParticleState(array(world.cloud(count).T), log_weight=equal, timestamp=now)
    while True:
        now += timedelta(seconds=1)
        prediction = predict.predict(cloud, timestamp=now)
        seen = detection(np.zeros((3, 1)), timestamp=now, measurement_model=model)
        cloud = update.update(hypothesis(prediction, seen))
        world.estimate(np.asarray(cloud.state_vector, float).T, np.exp(cloud.log_weight))
        yield


PEERS: dict[str, Callable[[World, int, str], Iterator[None]]] = {
    "filterpy": filterpy,
    "particles": particles,
    "pfilter": pfilter,
    "stonesoup": stonesoup,
}


def main() -> None:
    """Answer requests until the input ends."""
    world = World(np.load(sys.argv[1]))
    running: dict[tuple[str, int, str], Iterator[None]] = {}
    for line in sys.stdin:
        asked = json.loads(line)
        key = asked["peer"], asked["particles"], asked["scheme"]
        try:
            if key not in running:
                running[key] = PEERS[asked["peer"]](world, *key[1:])
                next(running[key])  # the first step also sets up
            began = perf_counter()
            next(running[key])
            answer: dict[str, Any] = {"seconds": perf_counter() - began}
        except Exception as problem:  # whatever a library raises is its answer
            answer = {"problem": f"{type(problem).__name__}: {problem}"}
        print(json.dumps(answer), flush=True)


if __name__ == "__main__":
    main()
