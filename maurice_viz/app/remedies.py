"""Remedies: what would have helped a saved run, tried from a branch over many seeds and ranked."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from maurice_datasets.trials.engine import tables_of
from maurice_datasets.trials.statistics import Interval, holm, mean, of_one_drive, share, sign_flip
from maurice_loaders.errors import InputError
from maurice_mcl.config.build import equipped
from maurice_mcl.config.parameters import ALPHAS, PRECISE, PRESETS, FilterParameters
from maurice_mcl.filter.branch import recovery_evidence
from maurice_mcl.filter.following import KEPT_UPDATES, can_propose
from maurice_mcl.filter.localizer import Localizer
from maurice_mcl.scoring.batch import SeededRuns
from maurice_mcl.scoring.metrics import RIGHT_AT_END, mostly_at_end, score_table
from maurice_mcl.scoring.table import RunTable
from maurice_mcl.sensor.ahead import compared
from maurice_mcl.sensor.descriptors.registry import FEATURES
from maurice_mcl.sensor.laser.sensor import LASER
from maurice_mcl.sensor.model import SensorModel
from maurice_mcl.values import F64, MOVABLE, Belief, Bool, Comparison, Frame, Moment, Past, plain

from ..errors import SILENT, Listener, progress_of
from ..running.saved_steps import Pictures, Restored, restored_together
from ..text.comparison import USUAL_SHARE, remedies_line
from .branch import BranchChange, BranchPoint, open_branch

SEEDS = 14
AS_IT_WAS = "as it was"
BETTER, WORSE, UNCLEAR = "better", "worse", "no difference seen"
STRATEGIES = ("none", "always", "threshold", "sensor", "augmented", "expansion", "mixture")
TIMES_PARTICLES = 4
MANY_TIMES = (16, 64)  # the particles, where that is
MOST_PARTICLES = 16_000  # at most: more cost a third of all that is tried
MOST_UPDATES = 150  # after the branch, by which remedies are judged
TIMES_ALPHAS = {"twice": 4.0, "half": 0.25}  # AMCL's alphas are variances
OUTLIER_COST: float = PRECISE["sensor.outlier_cost"]
AMCL_RECOVERY = {  # as its documentation advises
    "recovery.strategy": "augmented",
    "recovery.augmented.slow": 0.001,
    "recovery.augmented.fast": 0.1,
    "recovery.augmented.most": 1.0,
    "recovery.augmented.resets": 0.0,
}
MORE_NOISE = {"motion_outliers.share": 1.0, "motion_outliers.widen": 2.0}
ROBUST = "robust"  # the preset that is also tried with more particles
P_BELOW = 0.05  # of all that is tried together: p-values are adjusted for their number


@dataclass(frozen=True, slots=True)
class Remedy:
    """One thing to try from the branch on."""

    name: str
    change: BranchChange


@dataclass(frozen=True, slots=True)
class RemedyResult:
    """What came of it, over all seeds; the errors are over the updates after the branch."""

    name: str
    change: BranchChange
    localized: Interval  # share of the runs that are localized at the end
    error_mean_m: Interval  # mean position error
    verdict: str  # BETTER, WORSE or UNCLEAR, against the run as it was with the same seeds
    p_localized: float  # of no difference, adjusted for the number of remedies
    p_error: float

    def to_json(self) -> dict[str, Any]:
        """Return everything as JSON."""
        return plain(self) | {"change": list(self.change.words), "options": list(self.change.options)}


@dataclass(frozen=True, slots=True)
class Remedies:
    """All that was tried, best first."""

    run: str  # the folder
    name: str  # of the session
    display_units: str
    from_step: int
    seeds: tuple[int, ...]
    as_it_was: RemedyResult
    tried: tuple[RemedyResult, ...]
    left_out: tuple[str, ...]  # and why
    line: str = ""

    @property
    def proposed(self) -> RemedyResult | None:
        """The best of those that are better and usually localized; None: none is."""
        good = [
            result
            for result in self.tried
            if result.verdict == BETTER and result.localized.value >= USUAL_SHARE
        ]
        return good[0] if good else None

    def to_json(self) -> dict[str, Any]:
        """Return everything as JSON, lengths in meters."""
        values = plain(self) | {"proposed": None if self.proposed is None else self.proposed.name}
        return {key: value for key, value in values.items() if key not in ("name", "display_units")}


def remedies(
    run: str | Path,
    from_step: int | None = None,
    *,
    seeds: int | Sequence[int] = SEEDS,
    names: Iterable[str] = (),
    listener: Listener = SILENT,
) -> Remedies:
    """Try what might have kept a saved run localized, from a step on, and rank it.

    Tried are recovery strategies, more particles, particles anywhere, other features, presets and models of a
    laser, the filter without one of its channels, other motion noise, motion outliers, roughening and a
    weaker sensor model; with `names` only those. Each is run with the same `seeds` (their number, or the
    seeds themselves) from the belief after `from_step` (None: before the first loss), and so is the run as it
    was; at most `MOST_UPDATES` after the branch count.

    InputError where session, library or truth is gone, or fewer than ten updates follow; OptionError for a
    step that is not there.

        >>> import maurice_viz as mv
        >>> found = mv.remedies("my-run", 2, seeds=5, names=["particles x4"])
        >>> found.tried[0].verdict, found.proposed
        ('no difference seen', None)
    """
    point = open_branch(run, listener)
    step = point.step_or_default(from_step)
    tested = tuple(range(1, seeds + 1)) if isinstance(seeds, int) else tuple(seeds)
    chosen_names, (possible, left_out) = set(names), candidates(point)
    chosen = [remedy for remedy in possible if not chosen_names or remedy.name in chosen_names]
    tried = [Remedy(AS_IT_WAS, BranchChange()), *chosen]
    filters = [point.localizer_with(remedy.change) for remedy in tried]
    if len(tested) < (least := least_seeds(len(chosen))):
        listener.remark(
            f"{len(tested)} seeds cannot tell {len(chosen)} remedies from chance; give at least {least}"
        )
    past = _Past.read(
        point, step, list({id(localizer.sensor): localizer.sensor for localizer in filters}.values())
    )
    outcomes = past.tried(tried, filters, tested, listener)
    first, *others = compared_with_first(tried, outcomes)
    ranked = sorted(others, key=lambda result: (-result.localized.value, result.error_mean_m.value))
    info = point.session.info
    ranking = Remedies(
        str(run), info.name, info.display_units, step, tested, first, tuple(ranked), tuple(left_out)
    )
    return replace(ranking, line=remedies_line(ranking.to_json()))


@dataclass(frozen=True, slots=True, eq=False)
class SeedResults:
    """One filter from the branch, by seed (S,)."""

    localized: Bool  # at the end
    error_mean_m: F64

    @classmethod
    def of(cls, tables: Sequence[RunTable]) -> SeedResults:
        """Judge runs by their updates after the branch."""
        at_end = np.array([mostly_at_end(run.is_localized.tolist()) is True for run in tables], bool)
        return cls(at_end, np.array([score_table(run).error_mean_m for run in tables], np.float64))


@dataclass(slots=True, eq=False)
class _Past:
    """What all branches share: the belief they start from, and the pictures after it, as descriptors."""

    point: BranchPoint
    step: int
    sensors: Sequence[SensorModel]
    belief: Belief | None = None
    evidences: list[float] = field(default_factory=list)
    updates: list[Sequence[Past]] = field(default_factory=list)  # the last, for each sensor model
    moments: list[Moment] = field(default_factory=list)  # after the branch, without pictures
    comparisons: list[list[Comparison]] = field(default_factory=list)  # of each sensor model, by moment

    @classmethod
    def read(cls, point: BranchPoint, step: int, sensors: Sequence[SensorModel]) -> _Past:
        """Go through the run once and measure every picture after the branch once. InputError."""
        past, label = cls(point, step, sensors), point.run.manifest.label
        seen = restored_together([Restored(point.run, None)], Pictures(point.session, point.refuse))
        last = deque[tuple[Frame, F64]](maxlen=KEPT_UPDATES)  # the latest first
        for moment, records in seen:
            if len(past.moments) == MOST_UPDATES:
                break
            if moment.frame.step <= step:
                past.evidences.append(recovery_evidence(records[label]))
                past.belief = records[label].belief
                last.appendleft((moment.frame, records[label].estimate.pose))
            else:
                past.comparisons.append([model.comparison for model in compared(sensors, moment.frame)])
                past.moments.append(moment.without_picture)
        past.updates = [_updates_read(sensor, last) for sensor in sensors]
        known = sum(moment.truth is not None for moment in past.moments)
        if known < RIGHT_AT_END[1]:
            advice = f"expected at least {RIGHT_AT_END[1]} to judge remedies by; name an earlier step"
            raise InputError(point.run.folder, f"found {known} true poses after step {step}, {advice}")
        return past

    def tried(
        self,
        remedies: Sequence[Remedy],
        filters: Sequence[Localizer],
        seeds: Sequence[int],
        listener: Listener,
    ) -> list[SeedResults]:
        """Run every filter with every seed; every picture is compared once by each sensor model."""
        runs = [self._runs(*each, seeds) for each in zip(remedies, filters, strict=True)]
        return [SeedResults.of(tables) for tables in tables_of(runs, progress_of(listener, "remedies"))]

    def _runs(self, remedy: Remedy, localizer: Localizer, seeds: Sequence[int]) -> SeededRuns:
        """Return the runs of a filter from the branch on."""
        position = next(i for i, sensor in enumerate(self.sensors) if sensor is localizer.sensor)
        comparisons = [seen[position] for seen in self.comparisons]
        known, anywhere = (self.step, self.belief, self.evidences), remedy.change.anywhere
        states = [
            self.point.begin(replace(localizer, seed=seed), *known, self.updates[position], anywhere=anywhere)
            for seed in seeds
        ]
        return SeededRuns(localizer, self.moments, comparisons, seeds, states=states)


def _updates_read(sensor: SensorModel, last: Iterable[tuple[Frame, F64]]) -> list[Past]:
    """Return updates as a sensor model reads them, where it proposes poses, which are checked by them."""
    if not can_propose(sensor.sensors.values()):
        return []
    return [Past(frame.motions, sensor.see(frame).sensed, pose) for frame, pose in last]


def least_seeds(remedies: int) -> int:
    """Return with how many seeds a remedy that always works, on a run that never does, can be better."""
    return math.ceil(math.log2(2 * 2 * remedies / P_BELOW)) if remedies else 0


def compared_with_first(tried: Sequence[Remedy], outcomes: Sequence[SeedResults]) -> list[RemedyResult]:
    """Compare all but the first with the first, seed by seed.

    One is better where it is localized at the end in more seeds, or as often with a smaller
    error, by sign-flip tests whose p-values are adjusted for the number of all of them (Holm).
    """
    first, count = outcomes[0], len(outcomes) - 1
    tests = [sign_flip(outcome.localized.astype(float) - first.localized) for outcome in outcomes[1:]]
    tests += [sign_flip(outcome.error_mean_m - first.error_mean_m) for outcome in outcomes[1:]]
    adjusted = holm(tests)
    of = zip([1.0, *adjusted[:count]], [1.0, *adjusted[count:]], strict=True)
    return [
        RemedyResult(
            name=remedy.name,
            change=remedy.change,
            localized=share(outcome.localized, of_one_drive(len(outcome.localized))),
            error_mean_m=mean(outcome.error_mean_m, of_one_drive(len(outcome.error_mean_m))),
            verdict=_verdict(outcome, first, p_localized, p_error),
            p_localized=p_localized,
            p_error=p_error,
        )
        for remedy, outcome, (p_localized, p_error) in zip(tried, outcomes, of, strict=True)
    ]


def _verdict(outcome: SeedResults, first: SeedResults, p_localized: float, p_error: float) -> str:
    """Return BETTER, WORSE or UNCLEAR: by the share that is localized at the end, then by the error."""
    if p_localized < P_BELOW:
        return BETTER if outcome.localized.mean() > first.localized.mean() else WORSE
    if p_error < P_BELOW:
        return BETTER if outcome.error_mean_m.mean() < first.error_mean_m.mean() else WORSE
    return UNCLEAR


def candidates(point: BranchPoint) -> tuple[list[Remedy], list[str]]:
    """Return what can be tried on a run, and what cannot, with the reason."""
    configuration = point.run.configuration
    own = configuration.parameters
    by_laser = set(own.sensor.weights) == {LASER}
    settings = _laser_settings(own) if by_laser else _settings(own)
    remedies = [Remedy(name, BranchChange(settings=values)) for name, values in settings]
    remedies += [Remedy(name, change) for name, change in _clouds(own, () if by_laser else MANY_TIMES)]
    sensors = {f"feature {name}": (BranchChange(feature=name), weights) for name, weights in FEATURES.items()}
    for name, values in PRESETS.items():
        if name == "thesis-exact":  # it has one robot's constants
            continue
        sensors[f"preset {name}"] = BranchChange(preset=name), values["sensor.weights"]
    more = BranchChange(preset=ROBUST, particles=TIMES_PARTICLES * own.particles)
    sensors[f"preset {ROBUST}, particles x{TIMES_PARTICLES}"] = more, PRESETS[ROBUST]["sensor.weights"]
    library = point.localizer.library
    left_out, holds = [], {*library.index, *equipped(library, own.sensor).sensors}
    for name, (change, weights) in sensors.items():
        missing = [channel for channel in weights if channel not in holds]
        if missing:
            left_out.append(f"{name}: the library has no {missing[0]}")
        else:
            remedies.append(Remedy(name, change))
    others = [
        remedy
        for remedy in remedies
        if remedy.change.anywhere or remedy.change.configuration(configuration).parameters != own
    ]
    return others, left_out


def _clouds(own: FilterParameters, many_times: Sequence[int]) -> Iterator[tuple[str, BranchChange]]:
    """Yield other clouds to go on with, by name."""

    def larger(times: int) -> BranchChange:
        particles = times * own.particles
        limit = {"resampling.kld.most": particles} if own.resampling.adaptive else {}
        return BranchChange(particles=particles, settings=limit)

    affordable = [times for times in many_times if times * own.particles <= MOST_PARTICLES]
    for times in (TIMES_PARTICLES, *affordable):
        yield f"particles x{times}", larger(times)
    yield "anywhere", BranchChange(anywhere=True)
    if many_times:
        yield f"anywhere, particles x{TIMES_PARTICLES}", replace(larger(TIMES_PARTICLES), anywhere=True)


def _laser_settings(own: FilterParameters) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Yield what can be set of a filter that has a laser alone, by name; AMCL's where AMCL has it."""
    prob = {"sensor.laser.model": "likelihood_field_prob"}
    yield "model calibrated", {"sensor.laser.model": "calibrated"}
    yield "likelihood_field_prob", prob
    yield "likelihood_field_prob, do_beamskip", prob | {"sensor.laser.do_beamskip": True}
    yield "likelihood_field_prob, recovery augmented", prob | AMCL_RECOVERY
    yield "recovery none", {"recovery.strategy": "none"}
    yield "recovery augmented", AMCL_RECOVERY
    yield "recovery mixture", {"recovery.strategy": "mixture"}
    motion = dict(own.motion or {})
    for name, times in TIMES_ALPHAS.items():
        if alphas := {alpha: times * float(str(motion[alpha])) for alpha in ALPHAS if alpha in motion}:
            yield f"alphas x{times:g} ({name} the noise)", {"motion": motion | alphas}
    if not motion:
        yield "motion noise x2", MORE_NOISE


def _settings(own: FilterParameters) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Yield what can be set, by name, without what the run has already."""
    for name in STRATEGIES:
        yield f"recovery {name}", {"recovery.strategy": name}
    if own.resampling.roughening <= 0:
        yield "roughening 0.2", {"resampling.roughening": 0.2}
    if own.resampling.when == "always":
        yield "resampling when needed", {"resampling.when": "effective"}
    if own.resampling.scheme != "systematic":
        yield "resampling systematic", {"resampling.scheme": "systematic"}
    yield "motion noise x2", MORE_NOISE
    moved = {"map.obstacles": MOVABLE, "sensor.outlier_cost": OUTLIER_COST}
    if own.map.obstacles != MOVABLE:
        yield "obstacles movable", {"map.obstacles": MOVABLE}
    if own.sensor.outlier_cost <= 0:
        yield f"obstacles movable, outlier cost {OUTLIER_COST:g}", moved
    if own.motion_outliers.share < 0.1:
        yield "motion outliers 10 %", {"motion_outliers.share": 0.1, "motion_outliers.widen": 4.0}
    weights = own.sensor.weights
    for name in weights:
        others = {other: weight for other, weight in weights.items() if other != name}
        if any(others.values()):
            yield f"without {name}", {"sensor.weights": others}
    if own.sensor.sharpness > 0:
        yield "sharpness x0.5", {"sensor.sharpness": own.sensor.sharpness / 2}
