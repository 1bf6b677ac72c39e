"""Runs over one drive: many filters, every picture compared once for all that share a sensor model."""

from __future__ import annotations

import hashlib
import json
import platform
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.metadata import version
from typing import Any

import numpy as np

from maurice_loaders.errors import InputError
from maurice_mcl.analysis.events import is_kidnapping
from maurice_mcl.analysis.failures.causes import JUMPED, SLIPPED, TURNED, CauseFinder
from maurice_mcl.analysis.failures.near_truth import has_near
from maurice_mcl.analysis.metrics import Scorer, StepScore, SuccessJudge, first_mostly
from maurice_mcl.arrays import F64
from maurice_mcl.config.parameters import FilterParameters
from maurice_mcl.filter.localizer import Localizer
from maurice_mcl.records import FilterState, StepRecord
from maurice_mcl.sensor.ahead import compared_ahead
from maurice_mcl.session import Moment

from .controls import filter_for
from .drives import Drive, open_drive, oracle_m
from .plan import Part, Plan, SessionSpec, configuration_of

Row = dict[str, Any]
Key = tuple[str, str, int, int]  # part, session, variant and seed of a run
SEEDS_A_JOB = 32  # of a recorded session
IMPOVERISHED, MOVED_OTHERWISE, OTHER = "impoverishment", "motion", "other"
BEFORE = 10  # updates: a slip explains a loss that comes so soon after it


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
    seed: int  # of the drive; 0 for a recorded one
    asked: tuple[TrialRun, ...]


@dataclass(slots=True)
class RunTally:
    """One run's figures, update by update; keeps a few numbers per update and no cloud."""

    localizer: Localizer
    state: FilterState
    judge: SuccessJudge
    known_start: bool
    scorer: Scorer = field(default_factory=Scorer)
    causes: CauseFinder = field(default_factory=CauseFinder)
    scores: list[StepScore] = field(default_factory=list)
    off_m: list[float] = field(default_factory=list)
    sd_m: list[float] = field(default_factory=list)
    confidence: list[float] = field(default_factory=list)
    driven_m: list[float] = field(default_factory=list)
    time_s: list[float] = field(default_factory=list)
    near: list[bool] = field(default_factory=list)
    ess: float = 0.0
    fresh: int = 0
    took_s: float = 0.0
    kidnapped_at: int | None = None

    def add(self, moment: Moment, record: StepRecord) -> None:
        """Process the next update."""
        truth, motions = moment.truth, moment.frame.motions
        score = self.scorer.add(record.estimate, truth, motions)
        self.judge.add(record, truth)
        self.causes.see(moment, record)
        self.scores.append(score)
        self.off_m.append(np.nan if score.position_error_m is None else score.position_error_m)
        self.sd_m.append(float(np.hypot(*record.mean_estimate.sd_m)))
        self.confidence.append(record.estimate.confidence)
        right_m = record.estimate.radii.right_m
        self.near.append(truth is not None and has_near(record.weighted, truth, right_m))
        self.driven_m.append(self.scorer.driven_m)
        self.time_s.append(moment.frame.time_s)
        self.ess += record.effective_sample_size / record.weighted.size
        self.fresh += record.injected is not None
        self.took_s += sum(record.took_s.values())
        if any(is_kidnapping(text) for text in moment.events):
            self.kidnapped_at = len(self.scores)

    def row(self) -> Row:
        """Return all figures: meters, radians, seconds; None where the truth is not known."""
        found, since = self.scorer.result(), (self.kidnapped_at or 1) - 1
        localized = first_mostly(np.array([one.localized is True for one in self.scores[since:]], bool))
        at = None if localized is None else since + localized - 1
        begun_m, begun_s = (values[since] if since else 0.0 for values in (self.driven_m, self.time_s))
        good = len(self.scores) if found.lost_at_update is None else found.lost_at_update - 4
        return {
            "updates": found.updates,
            "distance_m": found.distance_m,
            "error_m": found.position_error_mean_m,
            "error_median_m": found.position_error_median_m,
            "final_error_m": found.position_error_final_m,
            "heading_error_rad": found.heading_error_mean_rad,
            "relative_error_m": None if found.relative is None else found.relative.position_median_m,
            "lost": found.lost,
            "lost_at_update": found.lost_at_update,
            "before_loss_m": (self.driven_m[good - 1] if good > 0 else 0.0)
            if found.lost is not None
            else None,
            "reached": found.reached,
            "kidnapped_at_update": self.kidnapped_at,
            "pictures_to_localize": localized,
            "localized_m": None if at is None else self.driven_m[at] - begun_m,
            "localized_s": None if at is None else self.time_s[at] - begun_s,
            "pictures_after": None if found.lost is None else len(self.scores) - since,
            "right_at_end": found.right_at_end,
            "wrong_confident": found.wrong_confident_share,
            "succeeded_tenth": _succeeded(self.judge, 0),
            "succeeded_circle": _succeeded(self.judge, 1),
            "confidence_end": self.confidence[-1],
            "sd_end_m": self.sd_m[-1],
            "ess_share": self.ess / len(self.scores),
            "reseeded": self.fresh,
            "failure": self.failure(found.lost_at_update, found.right_at_end),
            "took_s": self.took_s,
            "off_m": self.off_m,
            "sd_m": self.sd_m,
            "confidence": self.confidence,
        }

    def failure(self, lost_at: int | None, right_at_end: bool | None) -> str | None:
        """Say why a run failed: None for one that did not, or without truth (thesis 3.6.2 and figure 37).

        A run whose start was known and that nobody carried away fails if it was lost, any other if it is not
        right at its end.
        """
        tracking = self.known_start and self.kidnapped_at is None
        lost_at = lost_at if tracking else None
        if lost_at is None and (tracking or right_at_end is not False):
            return None
        last = len(self.scores) if lost_at is None else lost_at
        moved = [one for one in self.causes.found if one.kind in (SLIPPED, TURNED, JUMPED)]
        if lost_at is not None and any(last - BEFORE <= one.step <= last for one in moved):
            return MOVED_OTHERWISE
        return IMPOVERISHED if not all(self.near[:last]) else OTHER


def _succeeded(judge: SuccessJudge, reading: int) -> bool:
    found = judge.result()[reading]
    return found.at_update is not None and found.failed is None


def run_job(job: Job) -> list[Row]:
    """Return a row for each run; one that fails is a row with its error."""
    try:
        drive = open_drive(job.spec, job.seed)
    except Exception as problem:
        return [_failed(asked, job.spec, problem) for asked in job.asked]
    tallies: dict[int, RunTally] = {}
    rows: dict[int, Row] = {}
    for number, asked in enumerate(job.asked):
        try:
            tallies[number] = _begun(drive, asked)
        except Exception as problem:
            rows[number] = _failed(asked, job.spec, problem)
    truths: list[F64 | None] = []
    for number, why in _stepped(drive, tallies, truths):
        del tallies[number]
        rows[number] = _failed(job.asked[number], job.spec, why)
    oracle = oracle_m(drive.bench.library, truths)
    for number, tally in tallies.items():
        about = _about(job.asked[number], job.spec) | {"arena": drive.arena, "oracle_m": oracle}
        rows[number] = about | tally.row()
    return [rows[number] for number in sorted(rows)]


def _begun(drive: Drive, asked: TrialRun) -> RunTally:
    localizer = filter_for(drive, asked.settings, asked.seed)
    size_m = drive.bench.library.arena.size_m
    return RunTally(
        localizer, localizer.initialize(drive.start), SuccessJudge(size_m), drive.start is not None
    )


def _stepped(
    drive: Drive, tallies: Mapping[int, RunTally], truths: list[F64 | None]
) -> Iterator[tuple[int, Exception]]:
    """Step all runs through the drive and note the truths; yield those that fail, to be left out.

    A recording that cannot be read on fails all of them.
    """
    sensors = {id(one.localizer.sensor): one.localizer.sensor for one in tallies.values()}
    source = compared_ahead(list(sensors.values()), drive.session.moments())
    try:
        for moment, pictures in source:
            truths.append(moment.truth)
            picture_of = dict(zip(sensors, pictures, strict=True))
            for number, tally in list(tallies.items()):
                try:
                    picture = picture_of[id(tally.localizer.sensor)]
                    tally.state, record = tally.localizer.step(tally.state, moment.frame, picture)
                    tally.add(moment, record)
                except Exception as problem:
                    yield number, problem
    except Exception as problem:
        for number in list(tallies):
            yield number, problem
    if not truths:
        for number in list(tallies):
            yield number, InputError(None, "found no picture, expected one or more")


def _about(asked: TrialRun, spec: SessionSpec) -> Row:
    parameters = configuration_of(asked.settings).parameters
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
        "particles": parameters.particles,
        "configuration": configuration_hash(parameters),
        "version": version("maurice-replay"),
        "numpy": version("numpy"),
        "host": platform.node(),
        "error": None,
    }


def _failed(asked: TrialRun, spec: SessionSpec, problem: Exception) -> Row:
    what = str(problem) or type(problem).__name__
    try:
        about = _about(asked, spec)
    except ValueError:  # a configuration that cannot be
        about = {"part": asked.part, "session": asked.session, "variant": asked.variant, "seed": asked.seed}
    return about | {"label": asked.label, "error": what.splitlines()[0]}


def configuration_hash(parameters: FilterParameters) -> str:
    """Return a hash of every setting of a filter."""
    return hashlib.sha256(repr(parameters).encode()).hexdigest()[:12]


def jobs_of(plan: Plan, done: set[Key], most: int = 256) -> Iterator[Job]:
    """Yield the work that is left of a plan, lazily; sessions that are alike share their drives.

    Drives of one arena follow one another, whatever their session: a worker lights an arena once.
    """
    users: dict[SessionSpec, list[tuple[Part, str]]] = {}
    for part in plan.parts:
        for spec in part.sessions:
            users.setdefault(spec.drive, []).append((part, spec.label))
    for spec, seeds in _drives(users):
        waiting: list[TrialRun] = []
        for asked in (one for seed in seeds for one in _asked(users[spec], seed) if one.key not in done):
            waiting.append(asked)
            if len(waiting) == most:
                yield Job(spec, seeds[0], tuple(waiting))
                waiting = []
        if waiting:
            yield Job(spec, seeds[0], tuple(waiting))


def _drives(
    users: Mapping[SessionSpec, Sequence[tuple[Part, str]]],
) -> Iterator[tuple[SessionSpec, Sequence[int]]]:
    """Yield every drive with the seeds of its runs: a simulated one has one seed, a recorded one many."""
    count = {spec: max(part.seeds for part, _ in parts) for spec, parts in users.items()}
    for spec in users:
        if spec.path:
            for first in range(0, count[spec], SEEDS_A_JOB):
                yield spec, range(first, min(first + SEEDS_A_JOB, count[spec]))
    simulated = [spec for spec in users if not spec.path]
    places = sorted({(spec.world, spec.tier, k) for spec in simulated for k in range(spec.arenas)})
    for world, tier, arena in places:
        for spec in simulated:
            if (spec.world, spec.tier) == (world, tier):
                for seed in range(arena, count[spec], spec.arenas) if arena < spec.arenas else ():
                    yield spec, (seed,)


def _asked(users: Sequence[tuple[Part, str]], seed: int) -> Iterator[TrialRun]:
    for part, label in users:
        if seed >= part.seeds:
            continue
        varied = tuple(part.variants.varied)
        for variant in range(len(part.variants)):
            one = part.variants[variant]
            yield TrialRun(part.name, label, variant, one.label, one.settings, varied, seed)


def run_alone(plan: Plan, part: str, session: str, variant: int, seed: int) -> Row:
    """Return the row of one run, computed by itself: the same as within the plan, bit for bit."""
    chosen = next(one for one in plan.parts if one.name == part)
    spec = next(one for one in chosen.sessions if one.label == session)
    one = chosen.variants[variant]
    asked = TrialRun(part, session, variant, one.label, one.settings, tuple(chosen.variants.varied), seed)
    return run_job(Job(spec.drive, 0 if spec.path else seed, (asked,)))[0]
