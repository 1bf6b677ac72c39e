"""Simulated drives for the lost signal, and the numbers of many runs over them; both are kept on disk.

Arenas FITTED are what the signal was fitted on (fitting seeds, tiers nominal and hard), arenas UNSEEN what it
is judged on (test seeds, all tiers): no seed is in both, or in any other table of docs/results.md. Every
arena has four drives of 120 updates: two of position tracking, two in which the robot is kidnapped once.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from maurice_datasets.sessions import simulated_session, simulation_plan
from maurice_datasets.surveys import cached_survey
from maurice_datasets.tasks import DEMO, FITTING, GENERATOR, SURVEY, TEST
from maurice_datasets.trials.drives import Bench, Drive, RenderedSession, filter_for
from maurice_datasets.worlds.build import load_world
from maurice_loaders.libraries.store import open_library
from maurice_mcl.filter.localizer import Localizer
from maurice_mcl.reasons.second_opinion import SecondFilter
from maurice_mcl.scoring.batch import compared_once, run_batch
from maurice_mcl.values.arrays import F64

from .planted.drives import pack, unpack

Numbers = dict[str, NDArray[Any]]
SEEDS = (1, 2, 3)  # of the filter, for each drive
UPDATES = 120
FILTERS: dict[str, dict[str, Any]] = {
    "best": {"preset": "robust", "particles": 1000, "recovery.strategy": "none"},
    "robust": {"preset": "robust", "particles": 1000},
    "thesis": {"preset": "thesis"},
}


@dataclass(frozen=True, slots=True)
class Course:
    """One drive: what it is made from."""

    world: str
    tier: str
    arena: int  # seed of the arena, a multiple of four
    number: int  # of the drive in it, 0 to 3: even ones are tracking, odd ones kidnapped

    @property
    def task(self) -> str:
        """Whether the robot is carried away."""
        return "kidnapped" if self.number % 2 else "tracking"

    @property
    def seed(self) -> int:
        """The seed of the drive: one that no other drive has."""
        return self.arena + self.number

    @property
    def name(self) -> str:
        """What its files are called."""
        return f"{GENERATOR}-{self.world}-{self.tier}-{self.seed}"


def _courses(world: str, tiers: Sequence[str], arenas: range, drives: int = 4) -> list[Course]:
    return [
        Course(world, tiers[k % len(tiers)], arena, number)
        for k, arena in enumerate(arenas)
        for number in range(drives)
    ]


FITTED = _courses("two-rooms", ("nominal", "hard"), range(52, 76, 4))
UNSEEN = _courses("two-rooms", ("nominal", "dim", "hard"), range(1500, 1536, 4))


def for_fitting(seed: int) -> int:
    """Return a seed that may be fitted on; ValueError for any other, above all for test seeds."""
    if seed not in FITTING:
        raise ValueError(f"found seed {seed}, expected a fitting seed, {_span(FITTING)}{_whose(seed)}")
    return seed


def for_testing(seed: int) -> int:
    """Return a seed that results may be reported on; ValueError for any other."""
    if seed not in TEST:
        raise ValueError(f"found seed {seed}, expected a test seed, {_span(TEST)}{_whose(seed)}")
    return seed


def _span(seeds: range) -> str:
    return f"{seeds.start} to {seeds.stop - 1}"


def _whose(seed: int) -> str:
    names = {"the demo's": seed == DEMO, "a fitting seed": seed in FITTING, "a test seed": seed in TEST}
    return "".join(f"; it is {name}" for name, is_it in names.items() if is_it)


def drive_of(course: Course, folder: Path) -> Drive:
    """Return a drive, rendered at the first time and kept."""
    (for_fitting if course.arena < 1000 else for_testing)(course.seed)
    world = load_world(course.world, course.arena, course.tier)
    survey = cached_survey(world, course.arena, lambda done, total, what: None) / SURVEY.name
    file = folder / f"{course.name}.drive.npz"
    if not file.exists():
        cv2.setNumThreads(1)
        plan = simulation_plan(
            course.task,
            world=course.world,
            tier=course.tier,
            arena_seed=course.arena,
            seed=course.seed,
            updates=UPDATES,
        )
        simulated = simulated_session(plan, world)
        put(file, pack(RenderedSession(simulated.info, tuple(simulated.moments()))))
    session = unpack(file.read_bytes())
    return Drive(session, session.info.start, Bench.of(open_library(survey)), course.arena)


def numbers_of(course: Course, folder: Path) -> dict[str, Numbers]:
    """Return what every filter found on a drive: arrays (R, U), of R seeds and U updates."""
    file = folder / f"{course.name}.numbers.npz"
    if not file.exists():
        drive = drive_of(course, folder)
        kept = {
            f"{label}/{name}": values
            for label, settings in FILTERS.items()
            for name, values in _numbers(drive, settings).items()
        }
        put_arrays(file, kept)
    found: dict[str, Numbers] = {label: {} for label in FILTERS}
    with np.load(file) as held:
        for key in held:
            label, name = key.split("/")
            found[label][name] = held[key]
    return found


def _numbers(drive: Drive, settings: dict[str, Any]) -> Numbers:
    localizer, moments = filter_for(drive, settings, 0), list(drive.session.moments())
    comparisons = compared_once(localizer.sensor, moments)
    traces = run_batch(localizer, moments, SEEDS, drive.start, comparisons)
    library = np.array(
        [(comparison.mean, comparison.best) for c in comparisons if (comparison := c.library_evidence)]
    ).T
    found: Numbers = {
        "library_mean": np.tile(library[0], (len(SEEDS), 1)),
        "library_best": np.tile(library[1], (len(SEEDS), 1)),
        "error_m": np.array([t.error_m for t in traces]),
        "correct": np.array([t.is_correct for t in traces]),
        "lost": np.array([t.is_off for t in traces]),
        "evidence": np.array([t.calibrated_evidence for t in traces]),
        "log_evidence": np.array([t.log_evidence for t in traces]),
        "mass": np.array([t.mass for t in traces]),
        "spread": np.array([t.spread_m / t.radii.right_m for t in traces]),
        "survivors": np.array([t.parents / t.particles for t in traces]),
        "fresh": np.array([t.fresh / t.particles for t in traces]),
        "ess": np.array([t.effective_sample_size / t.particles for t in traces]),
        "confidence": np.array([t.confidence for t in traces]),
        "converged": np.array([t.converged for t in traces]),
    }
    likelihoods, estimates = (
        [comparison.explained_by_channels.relative[0] for comparison in comparisons],
        np.array([t.poses for t in traces]),
    )
    return found | second_opinions(localizer, [m.frame.motions for m in moments], likelihoods, estimates)


def second_opinions(
    localizer: Localizer, motions: Sequence[F64], likelihoods: Sequence[F64], estimates: F64
) -> Numbers:
    """Return what a second filter says of estimates (R, U, 3) of one drive, (R, U) each."""
    second, rows = SecondFilter.of(localizer), []
    for moved, likelihood, poses in zip(motions, likelihoods, estimates.swapaxes(0, 1), strict=True):
        second.see(moved, likelihood)
        rows.append([[comparison.near, comparison.elsewhere] for comparison in map(second.shares, poses)])
    near, elsewhere = np.array(rows).T
    return {"near": near, "elsewhere": elsewhere}


def put(file: Path, data: bytes) -> None:
    """Write a file at once or not at all."""
    part = file.with_suffix(".part")
    part.write_bytes(data)
    part.replace(file)


def put_arrays(file: Path, arrays: Numbers) -> None:
    """Write arrays by name, at once or not at all."""
    with file.with_suffix(".part").open("wb") as part:
        np.savez(part, **arrays)  # type: ignore[arg-type]  # its stubs know no names
    file.with_suffix(".part").replace(file)


def all_numbers(courses: Sequence[Course], folder: Path) -> Iterator[tuple[Course, dict[str, Numbers]]]:
    """Yield the numbers of some drives; those that are kept are not made again."""
    folder.mkdir(parents=True, exist_ok=True)
    for course in courses:
        yield course, numbers_of(course, folder)
