"""From a session of a plan and a seed to a drive: its moments, its start, and its library."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import takewhile
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from maurice_loaders.errors import InputError
from maurice_loaders.formats.registry import open_session
from maurice_loaders.libraries.completed import FOUND_IN_PICTURES, completed
from maurice_loaders.libraries.store import open_library
from maurice_mcl.config.build import adapted, available, build_localizer
from maurice_mcl.config.parameters import Configuration
from maurice_mcl.filter.localizer import Localizer
from maurice_mcl.filter.motion import motion_model
from maurice_mcl.library.occupancy_building import build_occupancy
from maurice_mcl.scoring.metrics import FIRST_SCORED
from maurice_mcl.sensor.map_places import map_library, reference_of
from maurice_mcl.sensor.references import NearestReference
from maurice_mcl.values import (
    F64,
    INCH_M,
    Arena,
    Library,
    Moment,
    OccupancyMap,
    Session,
    SessionInfo,
)

from ..sessions import simulated_session, simulation_plan
from ..simulation import SimulationPlan
from ..surveys import cached_survey, surveyed_world
from ..tasks import SURVEY, TEST
from ..worlds.build import load_world
from ..worlds.world import World
from .plan import MISJUDGED, SHUFFLED, SessionSpec, configuration_of
from .stretches import Stretches

Settings = dict[str, Any]
FIRST = TEST.start  # arena k and drive k of a plan have the test seeds 1000 + k


@dataclass(slots=True)
class Bench:
    """A library, and the localizers that were built over it; those with the same sensor model share it."""

    library: Library
    nearest: NearestReference
    _localizers: dict[str, Localizer] = field(default_factory=dict)
    _sensors: dict[str, Localizer] = field(default_factory=dict)
    info: SessionInfo | None = None  # of the drive, whose camera counts where the library knows none
    _libraries: dict[str, Library] = field(default_factory=dict)  # the same with what filters compare by

    @classmethod
    def of(cls, library: Library, info: SessionInfo | None = None) -> Bench:
        """Make one for a library, and for drives with the camera of a session's header."""
        return cls(library, reference_of(library), info=info)

    def localizer(self, settings: Settings) -> Localizer:
        """Return the filter that `make_localizer` would make, without a seed. InputError for what none is."""
        key = repr(sorted(settings.items()))
        if key not in self._localizers:
            self._localizers[key] = self._build(settings)
        return self._localizers[key]

    def _build(self, settings: Settings) -> Localizer:
        try:
            base = configuration_of(settings)
            library = self._library(base)
            configuration = available(base, library)[0]
            parameters = configuration.parameters
            shared = repr((parameters.sensor, parameters.references, parameters.map))
            alike = self._sensors.get(shared)
            if alike is None:
                chosen = adapted(configuration, library, self.nearest)[0].parameters
                alike = build_localizer(library, None, chosen, reference=self.nearest)
                self._sensors[shared] = alike
            return build_localizer(library, None, parameters, reference=self.nearest, sensor=alike.sensor)
        except (KeyError, ValueError) as problem:
            raise InputError(None, str(problem)) from None

    def _library(self, asked: Configuration) -> Library:
        """Return the library with all that a filter compares by."""
        sensor = asked.parameters.sensor
        key = repr(([name in sensor.weights for name in FOUND_IN_PICTURES], sensor.channels))
        if key not in self._libraries:
            (self._libraries[key],) = completed([asked], self.library, self.info)
        return self._libraries[key]


@dataclass(frozen=True, slots=True)
class RenderedSession:
    """A simulated session whose moments are in memory: rendering costs more than a run."""

    info: SessionInfo
    all_moments: tuple[Moment, ...]

    def moments(self) -> Iterator[Moment]:
        """Yield every moment."""
        return iter(self.all_moments)


@dataclass(frozen=True, slots=True)
class Drive:
    """One drive of a plan."""

    session: Session
    start: F64 | None  # (3,) where the particles begin; None: anywhere
    bench: Bench
    arena: int | None  # seed of the simulated arena

    @property
    def is_simulated(self) -> bool:
        """Whether it is simulated, and not recorded."""
        return self.arena is not None


def open_drive(spec: SessionSpec, seed: int) -> Drive:
    """Return the drive of run `seed`: simulated anew, or the recorded one. InputError for neither."""
    if not spec.path:
        return _simulated(spec.drive, seed)
    return _part(spec, seed) if spec.is_cut else _recorded(spec.drive)


@lru_cache(1)
def _recorded(spec: SessionSpec) -> Drive:
    session = open_session(spec.path, spec.read_as)
    start = None if spec.start else session.info.start
    library = open_library(_library_of(session, spec.path, spec.library))
    return Drive(session, start, Bench.of(library, session.info), None)


def _library_of(session: Session, path: str, library: str) -> str | Path:
    source = library or session.info.survey
    if source is None:
        raise InputError(None, f"{path}: found no library in its header; give the session a library")
    return source


def _part(spec: SessionSpec, seed: int) -> Drive:
    """Return run `seed` over a part of a recording; it begins at the true pose, unless anywhere."""
    info, bench, stretches = _cut(replace(spec.drive, stretch=0, kidnap_at=None, start=""))
    moments = stretches.of_run(seed, spec.stretch, spec.kidnap_at)
    return Drive(RenderedSession(info, moments), None if spec.start else moments[0].truth, bench, None)


@lru_cache(1)
def _cut(spec: SessionSpec) -> tuple[SessionInfo, Bench, Stretches]:
    """Return what the stretches of a recording share."""
    path, mapped = spec.path, spec.mapped
    session = open_session(path, spec.read_as)
    moments = [moment for moment in session.moments() if moment.truth is not None]
    if not moments:
        raise InputError(None, f"{path}: found no true pose, and parts of a recording need some")
    half = len(moments) // 2 if mapped == "first half" else 0
    if mapped:
        until = moments[half] if half else None
        bench = Bench.of(map_library(_map_of(spec, until), session.info.name))
    else:
        bench = Bench.of(open_library(_library_of(session, path, spec.library)), session.info)
    return session.info, bench, Stretches.of(moments[half:], bench.library.occupancy)


def _map_of(spec: SessionSpec, until: Moment | None) -> OccupancyMap:
    """Return a map of all scans with true poses before an update, also of those that no update uses.

    The update is found by its scan: the times of all may be the same.
    """
    all_scans = replace(spec.read_as, min_distance_m=0.0, min_angle_rad=0.0, odometry_from_truth=False)
    every = open_session(spec.path, all_scans).moments()
    before = takewhile(lambda moment: not _is_same(moment, until), every)
    posed = ((moment.frame.scan, moment.truth) for moment in before)
    try:
        return build_occupancy((scan, pose) for scan, pose in posed if scan is not None and pose is not None)
    except ValueError as problem:
        raise InputError(None, f"{spec.path}: no map can be made of its scans: {problem}") from None


def _is_same(moment: Moment, other: Moment | None) -> bool:
    """Return whether two moments of a recording, read by other gates, are of one scan at one true pose."""
    if other is None or moment.frame.scan is None or other.frame.scan is None:
        return False
    if moment.truth is None or other.truth is None or not np.array_equal(moment.truth, other.truth):
        return False
    return np.array_equal(moment.frame.scan.ranges_m, other.frame.scan.ranges_m, equal_nan=True)


def _simulated(spec: SessionSpec, seed: int) -> Drive:
    plan = plan_of(spec, seed)
    cv2.setNumThreads(1)
    simulated = simulated_session(plan, world_of(spec.world, plan.arena_seed, spec.tier))
    start = None if spec.start else simulated.info.start
    bench = bench_of(spec.world, plan.arena_seed, spec.tier, spec.spacing_in, spec.headings, spec.camera)
    return Drive(RenderedSession(simulated.info, tuple(simulated.moments())), start, bench, plan.arena_seed)


def arena_of(spec: SessionSpec, seed: int) -> Arena:
    """Return the map that run `seed` drives in, without its pictures."""
    if spec.path:
        return open_drive(spec, seed).bench.library.arena
    return load_world(spec.world, FIRST + seed % spec.arenas, spec.tier).arena


def plan_of(spec: SessionSpec, seed: int) -> SimulationPlan:
    """Return the simulation of run `seed`."""
    return simulation_plan(
        spec.task,
        world=spec.world,
        tier=spec.tier,
        arena_seed=FIRST + seed % spec.arenas,
        seed=FIRST + seed,
        updates=spec.updates,
        kidnap_at=spec.kidnap_at,
        slip_at=spec.slip_at,
        lights=spec.lights,
        moved=spec.moved,
        people=spec.people,
    )


@lru_cache(1)
def world_of(world: str, arena: int, tier: str) -> World:
    """Load a world once: its lighting, a few seconds, is kept for as long as it is the same one."""
    return load_world(world, arena, tier)


@lru_cache(1)
def bench_of(
    world: str, arena: int, tier: str, spacing_in: int = 0, headings: int = 0, camera: str = "stated"
) -> Bench:
    """Return the library of a simulated arena, from the cache of surveys."""
    if not spacing_in and not headings:
        log = survey_log(world, arena, tier)
    else:
        surveyed = surveyed_world(world, arena, tier, spacing_in * INCH_M or None, headings or None)
        log = cached_survey(surveyed, arena, lambda done, total, what: None) / SURVEY.name
    library = open_library(log)
    return Bench.of(library if camera == "stated" else replace(library, camera=None))


def survey_log(world: str, arena: int, tier: str) -> Path:
    """Return the survey of a simulated arena, from the cache."""
    return cached_survey(world_of(world, arena, tier), arena, lambda done, total, what: None) / SURVEY.name


def oracle_m(library: Library, truths: Sequence[F64 | None]) -> float | None:
    """Return how far the nearest reference is from the truth, in the mean over updates 4 to the last."""
    places = library.poses[:, :2]
    known = [truth for truth in truths[FIRST_SCORED - 1 :] if truth is not None]
    far = [float(np.linalg.norm(places - truth[:2], axis=1).min()) for truth in known]
    return float(np.mean(far)) if far else None


# Controls: filters that are deliberately given something wrong, to show what a result depends on.

MORE = 1.3


def filter_for(drive: Drive, settings: Mapping[str, Any], seed: int) -> Localizer:
    """Return the filter of a variant for one run of a drive, with its control where it names one."""
    control = settings.get("control")
    plain = {key: value for key, value in settings.items() if key != "control"}
    bench = drive.bench if control != SHUFFLED else shuffled(drive.bench, seed)
    localizer = replace(bench.localizer(plain), seed=seed)
    if control == MISJUDGED:
        motion = misjudged(drive.session.info.motion or {})
        localizer = replace(localizer, motion=motion_model(motion, localizer.reference.grid))
    return localizer.of_session(drive.session)


def shuffled(bench: Bench, seed: int) -> Bench:
    """Return a library whose pictures belong to other poses: nothing but chance can localize with it."""
    library = bench.library
    order = np.random.default_rng(seed).permutation(library.size)
    return Bench.of(replace(library, poses=library.poses[order]), bench.info)


def misjudged(motion: Mapping[str, Any]) -> dict[str, Any]:
    """Return motion constants that are all 30 percent too large, as of a robot that was badly calibrated."""
    return {
        key: misjudged(value) if isinstance(value, Mapping) else value * MORE if key != "model" else value
        for key, value in motion.items()
    }
