"""Explaining one update of a saved run, as text and numbers: why the filter believed what it did."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from maurice_loaders.errors import InputError
from maurice_loaders.runs.store import runs_beside
from maurice_mcl.reasons.explanation import StepExplanation, explain_step
from maurice_mcl.reasons.place import fits_best
from maurice_mcl.sensor.laser.beams import BeamJudgment
from maurice_mcl.sensor.laser.sensor import Laser
from maurice_mcl.sensor.model import SensorModel
from maurice_mcl.values import F64, Comparison, Moment, StepRecord

from ..entities import Phase, Place, open_command
from ..errors import SILENT, Listener, OptionError
from ..layouts.registry import EXPLAIN, SENSORS
from ..panels.story import place_of
from ..running.open import typed_pose
from ..running.saved import Opened, open_saved
from ..running.saved_steps import Pictures, Restored, restored_together
from ..style import Scale
from ..text.explanation import GLOSSARY, say_step
from ..text.explanation_table import say_sensors, to_json
from ..text.laser.scan import say_beams, scan_json
from ..text.lesson import say_lesson
from .convert import only_run
from .snapshot import snapshot


@dataclass(frozen=True, slots=True, eq=False)
class Explanation:
    """One explained step of a saved run."""

    label: str  # of the run
    source: Path  # its folder
    number: int  # of the step
    step: StepExplanation | None  # every number, per channel and reference; None: no picture was compared
    of_sensors: tuple[str, ...]  # what the pose sensors say, a paragraph each
    scale: Scale
    lesson: str = ""  # whether the picture knows the place, and which runs of the comparison have dots there
    phase: Phase = Phase.WEIGHT  # the one that did most: resampling where that happened
    scan: Mapping[str, object] | None = None  # what a laser's beams say, by pose

    @property
    def text(self) -> str:
        """The explanation in sentences, paragraphs separated by blank lines."""
        compared = [] if self.step is None else say_step(self.step, self.scale)
        glossary = GLOSSARY if self.step else GLOSSARY.split(" Rank")[0]  # of nats alone
        paragraphs = [*filter(None, [self.lesson]), *compared, *self.of_sensors, glossary]
        paragraphs.append(f"Walk through it: {open_command(self.source, Place(self.number, self.phase))}")
        return "\n\n".join([f"{self.label}, step {self.number}", *paragraphs])

    def __str__(self) -> str:
        return self.text

    def to_json(self) -> dict[str, object]:
        """Return every number as JSON, lengths in meters and angles in radians."""
        if self.step is None:
            return {"runs": [{"label": self.label, "step": self.number, "scan": self.scan}]}
        return to_json(self.label, self.step)


def explain(
    run: str | Path,
    step: int | None = None,
    *,
    label: str | None = None,
    at: F64 | str | None = None,
    entry: int | None = None,
    particle: int | None = None,
    to: str | Path | None = None,
    force: bool = False,
    listener: Listener = SILENT,
) -> Explanation:
    """Explain one step of a saved run, the last one without `step`; of a comparison the run of this `label`.

    The references nearest to the truth and to the estimate are compared with the one that matches best. One
    more may be asked for: the one nearest to the pose `at`, (3,) in meters and radians or as text
    "X,Y,HEADING" in display units and degrees; the library's `entry`; or the one of a `particle`, by its
    number in the saved cloud. `to` also writes a picture (.png) of the layout `explain` at that step, as
    `snapshot` does.

    Raises OptionError for arguments out of range and InputError for a folder that is no saved run, a step
    that it does not have, or where its session or library is gone.

        >>> import maurice_viz as mv
        >>> explanation = mv.explain("my-run", 12)
        >>> print(explanation.text.splitlines()[0])
        blended, step 12
    """
    if sum(choice is not None for choice in (at, entry, particle)) > 1:
        raise OptionError("--at, --entry and --particle exclude each other")
    folder = only_run(Path(run), label).folder
    opened = open_saved(folder, listener)
    (restored,) = opened.restored
    library = opened.scene.library
    scale = opened.scene.scale
    moment, record = _update(opened, folder, step)
    comparison, phase = record.sighting.comparison, Phase.WEIGHT if record.parents is None else Phase.RESAMPLE
    sensor = _sensor_of(restored, comparison, folder)
    if entry is not None:
        _check_number("entry", entry, library.size)
    at = _pose_of(at, particle, record, scale)
    sensors = tuple(say_sensors(record, moment.truth, library.arena, scale))
    label, step, explained, of_scan = restored.saved.manifest.label, moment.frame.step, None, None
    lesson = _lesson(opened, folder, moment, record)
    if comparison.channels:
        place = entry if at is None else np.asarray(at, float)
        explained = explain_step(record, sensor, moment.truth, place, weigh=True)
    else:
        poses = {"estimate": record.estimate.pose, "truth": moment.truth}
        poses["pose asked for"] = library.poses[entry] if entry is not None else at
        judged, nats = _judged(comparison, {name: pose for name, pose in poses.items() if pose is not None})
        others = [name for name in judged if name != "estimate"]
        sensors += tuple(say_beams(name, judged[name], nats[name], scale) for name in others)
        of_scan = scan_json(judged, nats)
    if to is not None:
        layout = EXPLAIN if comparison.channels or of_scan else SENSORS
        snapshot(folder, to=to, step=step, layout=layout, force=force, listener=listener)
    return Explanation(label, folder, step, explained, sensors, scale, lesson, phase, of_scan)


def _sensor_of(restored: Restored, comparison: Comparison, folder: Path) -> SensorModel:
    """Return the sensor model of a run; InputError for a run of which no step can be explained."""
    if restored.saved.manifest.recorded:
        unknown = "how it weighed its particles is not in the recording, so no step is explained"
        raise InputError(folder, f"is another localizer's run, as recorded: {unknown}")
    if restored.sensor is None or not (len(comparison.quality) or comparison.sensed):
        raise InputError(folder, "cannot be explained without its session and library; put them back")
    return restored.sensor


def _pose_of(at: F64 | str | None, particle: int | None, record: StepRecord, scale: Scale) -> F64 | None:
    """Return the pose (3,) of a particle, or the one that was typed; OptionError."""
    if particle is not None:
        _check_number("particle", particle, record.weighted.size)
        pose: F64 = record.weighted.world_poses[particle]
        return pose
    return typed_pose(at, scale.units, "--at is X,Y,HEADING") if isinstance(at, str) else at


def _lesson(opened: Opened, folder: Path, moment: Moment, record: StepRecord) -> str:
    """Return what a step teaches, with where the other runs of the same comparison have their dots."""
    (restored,) = opened.restored
    scene, sensors = opened.scene, {} if restored.sensor is None else restored.sensor.sensors
    lasers = [sensor for sensor in sensors.values() if isinstance(sensor, Laser)]
    own = place_of(moment, record, scene, lasers[0] if lasers else None)
    places = {restored.saved.manifest.label: own}
    fits, step = fits_best(record, scene.library), moment.frame.step
    if own is not None:
        others = [run for run in runs_beside(folder) if run.folder.name != folder.name]
        for other, records in restored_together([Restored(run, None) for run in others], Pictures()):
            if other.frame.step == step:
                beside = {label: place_of(moment, each, scene, None, fits) for label, each in records.items()}
                return say_lesson(places | beside, scene.scale)
    return say_lesson(places, scene.scale)


def _judged(
    comparison: Comparison, poses: Mapping[str, F64]
) -> tuple[dict[str, BeamJudgment], dict[str, float]]:
    """Return what each beam of a laser says at poses, and their nats; nothing without a laser."""
    for each in comparison.sensed:
        if isinstance(each.sensor, Laser):
            judged = {name: each.sensor.judged(each.reading, pose) for name, pose in poses.items()}
            return judged, {name: each.sensor.nats_at(each.reading, pose) for name, pose in poses.items()}
    return {}, {}


def _update(opened: Opened, folder: Path, number: int | None) -> tuple[Moment, StepRecord]:
    """Return one update of the only run; only pictures up to it are read."""
    last: tuple[Moment, StepRecord] | None = None
    for moment, records in opened.updates():
        (record,) = records.values()
        last = moment, record
        if moment.frame.step == number:
            return last
    if last is None:
        raise InputError(folder, "holds no step")
    if number is not None:
        raise InputError(folder, f"has no step {number}; it has 1 to {last[0].frame.step}")
    return last


def _check_number(what: str, number: int, count: int) -> None:
    if not 0 <= number < count:
        raise OptionError(f"there is no {what} {number}; they are 0 to {count - 1}")
