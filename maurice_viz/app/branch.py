"""Where a saved run is branched, and what is changed from there on."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, partial
from pathlib import Path
from typing import Any

from maurice_loaders.errors import InputError
from maurice_loaders.libraries.completed import completed
from maurice_loaders.reading.session import RecordedSession
from maurice_loaders.runs.store import SavedRun
from maurice_mcl.config.build import build_localizer
from maurice_mcl.config.parameters import PRESETS, Configuration, FilterParameters, Layer, configure, defaults
from maurice_mcl.filter.branch import branched
from maurice_mcl.filter.localizer import Localizer
from maurice_mcl.library.drive_score import DrivePicture
from maurice_mcl.reasons.verdict import RunVerdict, VerdictBuilder
from maurice_mcl.sensor.map_places import reference_of
from maurice_mcl.sensor.references import NearestReference
from maurice_mcl.values import F64, Belief, FilterState, Library, Moment, Past, StepRecord

from ..errors import SILENT, Listener, OptionError
from ..running.drive_check import MOST_UPDATES
from ..running.filters import Filter, word_of
from ..running.open import GLOBAL, fitted
from ..running.saved import changed_versions, library_of, localizer_of, session_of
from ..running.saved_steps import Pictures, Restored, restored_together
from .convert import only_run

KEEPS_SCALES = ("sensor.sharpness", "sensor.widening", "sensor.scales")  # others ask for new ones


@dataclass(frozen=True, slots=True)
class BranchChange:
    """What is different from the branch on; what is None stays as it was in the run."""

    preset: str | None = None
    feature: str | None = None
    particles: int | None = None
    seed: int | None = None
    settings: Mapping[str, Any] = field(default_factory=dict)  # by key of the configuration, over the others
    anywhere: bool = False  # the branch begins with particles spread over all free space

    @property
    def _named(self) -> dict[str, Any]:
        """What is given besides settings and start, by name."""
        named = {
            "preset": self.preset,
            "feature": self.feature,
            "particles": self.particles,
            "seed": self.seed,
        }
        return {name: value for name, value in named.items() if value is not None}

    @property
    def words(self) -> tuple[str, ...]:
        """What is changed, one thing each: "recovery.strategy=augmented"."""
        named = self._named.items()
        words = [f"{value} {name}" if name == "particles" else f"{name} {value}" for name, value in named]
        words += ["particles anywhere"] if self.anywhere else []
        return (*words, *(f"{key}={_short(value)}" for key, value in self.settings.items()))

    @property
    def label(self) -> str:
        """A short name for the branch, after what is changed."""
        named = [
            f"{name} {value}" if isinstance(value, int) else value for name, value in self._named.items()
        ]
        named += ["anywhere"] if self.anywhere else []
        named += [str(_short(value)).replace("/", "-") for value in self.settings.values()]
        return " ".join(named)[:24].strip() or "unchanged"

    @property
    def options(self) -> tuple[str, ...]:
        """The change as typed on the command line: "--set", "recovery.strategy=augmented"."""
        named = self._named | ({"start": GLOBAL} if self.anywhere else {})
        pairs = [(f"--{name}", str(value)) for name, value in named.items()]
        pairs += [("--set", f"{key}={_short(value)}") for key, value in self.settings.items()]
        return tuple(word for pair in pairs for word in pair)

    @property
    def has_other_sensor(self) -> bool:
        """Whether pictures are compared otherwise, so that scales have to be found again."""
        return self.feature is not None or any(
            key.startswith("sensor.") and key not in KEEPS_SCALES for key in self.settings
        )

    def configuration(self, saved: Configuration, fitted: Sequence[str] = ()) -> Configuration:
        """Return the settings from the branch on. OptionError for what is not known or out of range.

        A preset is a whole filter: of the run's settings only motion, unless a preset set it, particles and
        sensors of other packages stay. Keys that the library `fitted` to the run's own channels are left out
        where the branch has another sensor.
        """
        changes = Filter(self.preset, self.feature, self.particles, settings=self.settings).changes
        if any(key.startswith("radii.") for key in changes):
            raise OptionError("radii cannot be changed: both runs are judged by those of the saved run")
        settings = {key: value for key, value in saved.values().items() if value is not None}
        if self.preset is not None:
            other = {key: settings[key] for key in OF_THE_ROBOT if key in settings}
            if other.get("motion") in OF_PRESETS:
                del other["motion"]
            settings = dict(PRESETS[self.preset]) | other
        if self.has_other_sensor:
            settings = {key: value for key, value in settings.items() if key not in fitted}
        try:
            own = saved.parameters.sensor.weights
            return configure([Layer("run", settings), Layer("command line", changes)], own)
        except ValueError as problem:
            raise OptionError(str(problem)) from None


OF_THE_ROBOT = ("motion", "particles", "sensor.outside")  # keys that a preset leaves as they are
OF_PRESETS = [values["motion"] for values in PRESETS.values() if "motion" in values]  # not of the robot


def _short(value: Any) -> Any:
    if isinstance(value, Mapping):
        return ",".join(f"{name}={part}" for name, part in value.items())
    return value if isinstance(value, (str, int, float)) else word_of(value)


@dataclass(frozen=True, slots=True, eq=False)
class BranchPoint:
    """A saved run with all that it was made from."""

    run: SavedRun
    session: RecordedSession
    library: Library
    localizer: Localizer  # the run's own
    reference: NearestReference  # of the library's own map
    pictures: Callable[[], Sequence[DrivePicture]]  # some of the drive whose true poses are known

    @property
    def restored(self) -> Restored:
        """The run, to go through its steps."""
        return Restored(self.run, self.localizer)

    def steps(self) -> Iterator[tuple[Moment, StepRecord]]:
        """Go through the run with the pictures that it saw. InputError for other pictures."""
        label, pictures = self.run.manifest.label, Pictures(self.session, self.refuse)
        for moment, records in restored_together([self.restored], pictures):
            yield moment, records[label]

    def refuse(self, text: str) -> None:
        """Raise InputError for a picture that is missing or another."""
        raise InputError(self.run.folder, f"{text.split(';')[0]}; put it back, a branch has to see it")

    def step_or_default(self, from_step: int | None) -> int:
        """Return the step to branch after: the given one, else the one before the first loss.

        OptionError for a step that the run does not have, or where it was never lost.
        """
        steps = self.run.manifest.steps
        if from_step is None:
            step = step_before_loss(verdict_of(self))
            if step is None:
                raise OptionError("the run was never lost, as far as is known; name a step with --from")
            return step
        if from_step < 0 or (steps is not None and from_step >= steps):
            last = "" if steps is None else f" to {steps - 1}"
            raise OptionError(f"--from: found {from_step}, expected a step from 0{last}")
        return from_step

    def localizer_with(self, change: BranchChange, listener: Listener = SILENT) -> Localizer:
        """Return the filter from the branch on: with the run's sensors, or those of a replay with the change.

        InputError where the library lacks a channel, OptionError for settings.
        """
        own, before = self.localizer, self.run.configuration.parameters
        seed = own.seed if change.seed is None else change.seed
        if not replace(change, seed=None, anywhere=False).words:
            return replace(own, seed=seed)
        keys = self._fitted() if change.has_other_sensor else ()
        configuration = change.configuration(self.run.configuration, keys)
        same = _seen_by(configuration.parameters) == _seen_by(before)
        try:
            if not same:
                start = None if change.anywhere else self.restored.start
                configuration, localizer = self._fit(configuration, start, listener, seed=seed)
                is_own = _seen_by(configuration.parameters) == _seen_by(before)
                return replace(localizer, sensor=own.sensor) if is_own else localizer
            return build_localizer(
                own.library,
                self.session,
                configuration.parameters,
                reference=self.reference,
                seed=seed,
                radii=self.run.manifest.radii,
                sensor=own.sensor,
            )
        except InputError as problem:
            raise InputError(self.run.folder, problem.message) from None
        except ValueError as problem:  # motion parameters
            raise OptionError(str(problem)) from None

    def _fit(
        self, configuration: Configuration, start: F64 | None, listener: Listener = SILENT, *, seed: int = 0
    ) -> tuple[Configuration, Localizer]:
        """Fit a configuration to the run's library and drive, as a replay does."""
        info, own = self.session.info, self.localizer.library
        (library,) = completed([configuration], own, info, listener.progress, listener.warning)
        return fitted(
            configuration,
            library,
            self.session,
            self.reference,
            start,
            self.pictures,
            listener.warning,
            seed=seed,
            radii=self.run.manifest.radii,
        )

    def _fitted(self) -> tuple[str, ...]:
        """Return the keys that library and drive set in the run, and nobody else: they set them again."""
        saved = self.run.configuration
        usual = defaults()  # what is as usual is nobody's choice
        settings = {key: value for key, value in saved.values().items() if value not in (None, usual[key])}
        for keys in (("sensor.widening", "sensor.scales"), ("sensor.widening",)):
            without = Layer("run", {key: settings[key] for key in settings if key not in keys})
            configuration = configure([without], saved.parameters.sensor.weights)
            if self._fit(configuration, self.restored.start)[0].parameters == saved.parameters:
                return keys
        return ()

    def begin(
        self,
        localizer: Localizer,
        step: int,
        belief: Belief | None,
        evidences: Sequence[float],
        past: Sequence[Past] = (),
        *,
        anywhere: bool = False,
    ) -> FilterState:
        """Return the state in which a filter goes on after a step; without a belief, at the run's start.

        `evidences` are what recovery was told until then, update by update; `past` are the last updates, the
        latest first, as the filter's own sensors read them.
        """
        if belief is None:
            return localizer.initialize(None if anywhere else self.restored.start)
        evidences = evidences if localizer.sensor is self.localizer.sensor else ()
        if anywhere:
            return branched(localizer, step, localizer.initialize(None).belief, evidences)
        resized = localizer.particles != self.localizer.particles
        return branched(localizer, step, belief, evidences, localizer.particles if resized else None, past)


def _seen_by(parameters: FilterParameters) -> tuple[object, ...]:
    """Return what a sensor model is made from, besides the library."""
    return parameters.sensor, parameters.references, parameters.map


def open_branch(run: str | Path, listener: Listener = SILENT) -> BranchPoint:
    """Open a saved run and what it was made from. InputError if anything is gone or was changed."""
    saved = only_run(Path(run))
    session, library = session_of(saved), library_of(saved, listener)
    for text in changed_versions(saved):
        listener.warning(f"{saved.folder}: {text}: a branch may differ from the run for that alone")
    localizer = localizer_of(saved, session, library)
    reference = reference_of(library)
    return BranchPoint(
        saved, session, library, localizer, reference, cache(partial(session.known_pictures, MOST_UPDATES))
    )


def step_before_loss(verdict: RunVerdict) -> int | None:
    """Return the step to branch from: before the first failure that did not end, or the first; None: none.

    It is before the step at which the failure's cause shows first, so that a remedy has something to work
    with; 0 for a run that was never localized.
    """
    if not verdict.failures:
        return None
    failures = verdict.failures
    ending = [failure for failure in failures if failure.episode.last == verdict.last] or list(failures)
    return 0 if verdict.localized is None else max(min(ending[0].first, ending[0].episode.onset) - 1, 0)


def verdict_of(point: BranchPoint) -> RunVerdict:
    """Return what happened in a saved run, and why, as `diagnose` does."""
    builder = VerdictBuilder(point.localizer)
    for moment, record in point.steps():
        builder.add(moment, record)
    return builder.result()
