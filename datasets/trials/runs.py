"""Runs over one drive: many filters, every picture compared once for all that share a sensor model."""

from __future__ import annotations

import hashlib
import json
import platform
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from importlib.metadata import version
from traceback import walk_tb
from typing import Any

from maurice_loaders.errors import InputError
from maurice_loaders.libraries.measured import known_descriptors
from maurice_mcl.config.parameters import FilterParameters
from maurice_mcl.filter.batch_step import can_batch
from maurice_mcl.filter.localizer import Localizer
from maurice_mcl.reasons.causes import UNKNOWN
from maurice_mcl.reasons.diagnosis import DiagnosisBuilder
from maurice_mcl.reasons.surroundings import Surroundings
from maurice_mcl.sensor.ahead import Compared, compared_ahead
from maurice_mcl.sensor.model import SensorModel
from maurice_mcl.values import Moment
from maurice_mcl.values.own_parts import give_parts, given_parts

from .drives import Drive, filter_for, open_drive, oracle_m
from .plan import SHUFFLED, Part, Plan, SessionSpec, configuration_of
from .tally import RunTally, TruthRanks, mapped_shares

Row = dict[str, Any]
Key = tuple[str, str, int, int]  # part, session, variant and seed of a run
RUNS_A_JOB = 256
FEWEST_SEEDS, MOST_SEEDS = 8, 64  # of a job over a recorded session, first and later: stepped as one array


@dataclass(frozen=True, slots=True)
class TrialRun:
    """One run of a plan: its part, session, variant and seed."""

    part: str
    session: str
    variant: int
    label: str
    settings: Mapping[str, Any]
    varied: tuple[str, ...]  # the settings in which variants of the part differ
    seed: int

    @property
    def key(self) -> Key:
        """What names the run within its plan."""
        return self.part, self.session, self.variant, self.seed


@dataclass(frozen=True, slots=True)
class Job:
    """Runs that share a drive."""

    spec: SessionSpec
    seed: int  # of the drive, or of the first of its runs
    asked: tuple[TrialRun, ...]
    parts: Mapping[str, Any] = field(default_factory=dict)  # of the user's own, by name


class Unread(Exception):
    """A recording that cannot be read on: no run over it can be made."""


def run_job(job: Job) -> list[Row]:
    """Return a row for each run; one that fails is a row with its error.

    Runs that differ in their seeds alone are stepped as one array. If such a step fails, its runs are made
    once more, one by one: so the others of a failing run are rows.
    """
    give_parts(job.parts)
    try:
        drive = open_drive(job.spec, job.seed)
    except Exception as problem:  # here and below: one run that fails is a row, and the others go on
        return [_failed(run, job.spec, problem) for run in job.asked]
    rows, again = _rows(job, drive)
    if again:
        rows |= _rows(job, drive, numbers=again)[0]
    return [rows[number] for number in sorted(rows)]


def _rows(job: Job, drive: Drive, numbers: Sequence[int] = ()) -> tuple[dict[int, Row], list[int]]:
    """Return the rows of a job's runs, by number, and the runs to be made again; or of some runs, alone."""
    rows: dict[int, Row] = {}
    again: list[int] = []
    steppers: list[RunTally] = []
    for tally in _begun(job, drive, numbers or range(len(job.asked)), together=not numbers):
        if isinstance(tally, tuple):
            number, problem = tally
            rows[number] = _failed(job.asked[number], job.spec, problem)
        else:
            steppers.append(tally)
    moments: list[Moment] = []
    truths = TruthRanks({id(tally.localizer.sensor): tally.localizer.sensor for tally in steppers})
    for stepper, why in _stepped(drive, steppers, moments, truths):
        steppers.remove(stepper)
        if len(stepper.numbers) > 1 and not isinstance(why, Unread):
            again += stepper.numbers
            continue
        rows |= {number: _failed(job.asked[number], job.spec, why) for number in stepper.numbers}
    lost: dict[int, tuple[Localizer, bool]] = {}
    oracle = oracle_m(drive.bench.library, [moment.truth for moment in moments])
    mapped = mapped_shares(drive.bench.library.occupancy, moments)
    for stepper in steppers:
        about_runs = truths.columns(stepper.localizer.sensor, moments) | {"mapped": mapped}
        about_runs["right_m"] = stepper.localizer.radii.right_m
        about_runs |= _about_filter(job.asked[stepper.numbers[0]])
        for number, figures in zip(stepper.numbers, stepper.figures(moments), strict=True):
            run = job.asked[number]
            about = _about(run, job.spec) | {"arena": drive.arena, "oracle_m": oracle}
            rows[number] = about | figures.row() | about_runs
            if figures.failed:
                lost[number] = replace(stepper.localizer, seed=run.seed), figures.tracks
    for number, cause in _causes(drive, lost):
        rows[number]["failure"] = cause
    return rows, again


def _causes(drive: Drive, lost: Mapping[int, tuple[Localizer, bool]]) -> Iterator[tuple[int, str]]:
    """Make runs that failed once more, side by side; yield why each was lost, as `diagnose` says.

    Each comes with whether it tracks: then that is why it was lost first, else last. Every picture is
    compared once for all of them.
    """
    sensors = {id(localizer.sensor): localizer.sensor for localizer, _ in lost.values()}
    around = {
        (id(each.sensor), each.radii): Surroundings(each.sensor, each.radii.lost_m)
        for each, _ in lost.values()
    }
    builders = {
        number: DiagnosisBuilder(each, surroundings=around[id(each.sensor), each.radii])
        for number, (each, _) in lost.items()
    }
    states = {number: localizer.initialize(drive.start) for number, (localizer, _) in lost.items()}
    for moment, pictures in _compared(drive, sensors) if lost else ():
        for number, (localizer, _) in lost.items():
            picture = pictures[id(localizer.sensor)]
            states[number], record = localizer.step(states[number], moment.frame, picture)
            builders[number].add(moment, record)
    for number, builder in builders.items():
        failures = builder.result()
        yield number, failures[0 if lost[number][1] else -1].kind if failures else UNKNOWN


def _compared(
    drive: Drive, sensors: Mapping[int, SensorModel]
) -> Iterator[tuple[Moment, Mapping[int, Compared]]]:
    """Yield every moment of a drive with its picture compared by each sensor model, by their keys."""
    known = None if drive.is_simulated else known_descriptors()  # drawn anew, pictures are never the same
    for moment, pictures in compared_ahead(list(sensors.values()), drive.session.moments(), known):
        yield moment, dict(zip(sensors, pictures, strict=True))


def _begun(
    job: Job, drive: Drive, numbers: Sequence[int], *, together: bool
) -> Iterator[RunTally | tuple[int, Exception]]:
    """Initialize runs, those of one filter together where batches know it; yield them, or why one failed."""
    alike: dict[str, list[tuple[int, Localizer]]] = {}
    for number in numbers:
        run = job.asked[number]
        try:
            localizer = filter_for(drive, run.settings, run.seed)
        except Exception as problem:
            yield number, problem
            continue
        batched = together and can_batch(localizer) and run.settings.get("control") != SHUFFLED
        key = repr(sorted(run.settings.items())) if batched else str(number)
        alike.setdefault(key, []).append((number, localizer))
    arena = drive.bench.library.arena
    for pairs in alike.values():
        try:
            runs, localizers = zip(*pairs, strict=True)
            yield RunTally.begin(runs, localizers, drive.start, arena)
        except Exception as problem:
            yield from ((number, problem) for number, _ in pairs)


def _stepped(
    drive: Drive, steppers: Sequence[RunTally], moments: list[Moment], truths: TruthRanks
) -> Iterator[tuple[RunTally, Exception]]:
    """Step all runs through the drive, noting its moments without pictures; yield those that fail.

    A recording that cannot be read on fails all of them.
    """
    left = list(steppers)
    try:
        for moment, pictures in _compared(drive, truths.sensors):
            moments.append(moment.without_picture)
            truths.add(moment, pictures)
            for stepper in list(left):
                try:
                    stepper.step(moment, pictures[id(stepper.localizer.sensor)])
                except Exception as problem:
                    left.remove(stepper)
                    yield stepper, problem
        if not moments:
            raise InputError(None, "found no picture, expected one or more")
    except Exception as problem:
        for stepper in left:
            yield stepper, Unread(_why(problem))


def _about_filter(asked: TrialRun) -> Row:
    """Return what a row tells of a filter, the same for all of its runs: it takes longer than some runs."""
    parameters = configuration_of(asked.settings).parameters
    return {"particles": parameters.particles, "configuration": configuration_hash(parameters)}


def _about(asked: TrialRun, spec: SessionSpec) -> Row:
    return {
        "part": asked.part,
        "session": asked.session,
        "variant": asked.variant,
        "label": asked.label,
        "seed": asked.seed,
        "settings": json.dumps({key: asked.settings[key] for key in asked.varied if key in asked.settings}),
        "task": None if spec.path else spec.task,
        "tier": None if spec.path else spec.tier,
        "lights": None if spec.path else spec.lights,
        "preset": asked.settings.get("preset"),
        "feature": asked.settings.get("feature"),
        "version": _version("maurice-replay"),
        "numpy": _version("numpy"),
        "host": platform.node(),
        "error": None,
    }


def _failed(asked: TrialRun, spec: SessionSpec, problem: Exception) -> Row:
    try:
        about = _about(asked, spec) | _about_filter(asked)
    except ValueError:  # a configuration that cannot be
        about = {"part": asked.part, "session": asked.session, "variant": asked.variant, "seed": asked.seed}
    return about | {"label": asked.label, "error": _why(problem)}


def _why(problem: Exception) -> str:
    """Return one line; what nobody expected also says where our own code broke."""
    what = (str(problem) or type(problem).__name__).splitlines()[0]
    if isinstance(problem, InputError | Unread):
        return what
    places = ((frame.f_globals.get("__name__", ""), line) for frame, line in walk_tb(problem.__traceback__))
    module, line = [place for place in places if place[0].startswith("maurice_")][-1]
    return f"{type(problem).__name__} in {module}, line {line}: {what}"


@cache
def _version(package: str) -> str:
    return version(package)


def configuration_hash(parameters: FilterParameters) -> str:
    """Return a hash of every setting of a filter."""
    return hashlib.sha256(repr(parameters).encode()).hexdigest()[:12]


def jobs_of(plan: Plan, done: set[Key], most: int = RUNS_A_JOB) -> Iterator[Job]:
    """Yield the work that is left of a plan, lazily; sessions that are alike share their drives.

    Drives of one arena follow one another, whatever their session: a worker lights an arena once.
    """
    users: dict[SessionSpec, list[tuple[Part, str]]] = {}
    for part in plan.parts:
        for spec in part.sessions:
            users.setdefault(spec.drive, []).append((part, spec.label))
    for spec, seeds in _drives(users, done):
        waiting: list[TrialRun] = []
        for trial_run in (trial for trial in _asked(users[spec], seeds) if trial.key not in done):
            waiting.append(trial_run)
            if len(waiting) == most:
                yield _job(spec, seeds[0], waiting)
                waiting = []
        if waiting:
            yield _job(spec, seeds[0], waiting)


def _job(spec: SessionSpec, seed: int, asked: Sequence[TrialRun]) -> Job:
    return Job(spec, seed, tuple(asked), given_parts([run.settings for run in asked]))


def _drives(
    users: Mapping[SessionSpec, Sequence[tuple[Part, str]]], done: set[Key]
) -> Iterator[tuple[SessionSpec, Sequence[int]]]:
    """Yield every drive with the seeds of its runs: a simulated one and a stretch have one seed.

    Over a recorded one a few first, then more and more: progress shows early, and a stop loses little.
    """
    count = {spec: max(part.seeds for part, _ in parts) for spec, parts in users.items()}
    for spec in users:
        if spec.path:
            runs_of_seeds = ((seed, _asked(users[spec], (seed,))) for seed in range(count[spec]))
            left = deque(seed for seed, runs in runs_of_seeds if any(run.key not in done for run in runs))
            alike = 1 if spec.stretch else FEWEST_SEEDS  # runs over one drive
            while left:
                yield spec, [left.popleft() for _ in range(min(alike, len(left)))]
                alike = 1 if spec.stretch else min(2 * alike, MOST_SEEDS)
    simulated = [spec for spec in users if not spec.path]
    places = sorted({(spec.world, spec.tier, k) for spec in simulated for k in range(spec.arenas)})
    for world, tier, arena in places:
        for spec in simulated:
            if (spec.world, spec.tier) == (world, tier):
                for seed in range(arena, count[spec], spec.arenas) if arena < spec.arenas else ():
                    yield spec, (seed,)


def _asked(users: Sequence[tuple[Part, str]], seeds: Sequence[int]) -> Iterator[TrialRun]:
    """Yield the runs over one drive, those of one filter after one another."""
    for part, label in users:
        varied = tuple(part.variants.varied)
        for variant in range(len(part.variants)):
            chosen = part.variants[variant]
            for seed in seeds:
                if seed < part.seeds:
                    yield TrialRun(part.name, label, variant, chosen.label, chosen.settings, varied, seed)
