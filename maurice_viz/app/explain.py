"""Explaining one update of a saved run, as text and numbers: why the filter believed what it did."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from maurice_loaders.errors import InputError
from maurice_mcl.reasons.explanation import Asked, StepExplanation, explain_step
from maurice_mcl.values.arrays import F64
from maurice_mcl.values.records import StepRecord
from maurice_mcl.values.session import Moment

from ..entities import Phase
from ..errors import OptionError
from ..listener import SILENT, Listener
from ..running.open import typed_pose
from ..running.output import walk_command
from ..running.saved import Opened, open_saved
from ..style import Scale
from ..text.explanation import GLOSSARY, say_step
from ..text.explanation_table import to_json
from ..text.sensors import say_sensors
from .convert import only_run
from .snapshot import snapshot


@dataclass(frozen=True, slots=True, eq=False)
class Explanation:
    """One explained step of a saved run."""

    label: str  # of the run
    source: Path  # its folder
    step: StepExplanation  # every number, per channel and reference
    of_sensors: tuple[str, ...]  # what the pose sensors say, a paragraph each
    scale: Scale
    phase: Phase = Phase.WEIGHT  # the one that did most: resampling where that happened

    @property
    def text(self) -> str:
        """The explanation in sentences, paragraphs separated by blank lines."""
        paragraphs = [*say_step(self.step, self.scale), *self.of_sensors, GLOSSARY]
        paragraphs.append(f"Walk through it: {walk_command(self.source, self.step.step, self.phase)}")
        return "\n\n".join([f"{self.label}, step {self.step.step}", *paragraphs])

    def __str__(self) -> str:
        return self.text

    def to_json(self) -> dict[str, object]:
        """Return every number as JSON, lengths in meters and angles in radians."""
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
    if sum(given is not None for given in (at, entry, particle)) > 1:
        raise OptionError("--at, --entry and --particle exclude each other")
    folder = only_run(Path(run), label).folder
    opened = open_saved(folder, listener)
    (restored,) = opened.restored
    library = opened.scene.library
    scale = opened.scene.scale
    moment, record = _update(opened, folder, step)
    if restored.saved.manifest.recorded:
        unknown = "how it weighed its particles is not in the recording, so no step is explained"
        raise InputError(folder, f"is another localizer's run, as recorded: {unknown}")
    if restored.sensor is None or not len(record.sighting.comparison.quality):
        raise InputError(folder, "cannot be explained without its session and library; put them back")
    if not record.sighting.comparison.channels:
        raise InputError(folder, _of_readings(record, moment, library.origin, scale))
    if entry is not None:
        _check_number("entry", entry, library.size)
    if particle is not None:
        _check_number("particle", particle, record.weighted.size)
        at = record.weighted.world_poses[particle]
    if isinstance(at, str):
        at = typed_pose(at, scale.units, "--at is X,Y,HEADING")
    asked = None
    if at is not None or entry is not None:
        asked = Asked(entry=entry) if at is None else Asked(pose=np.asarray(at, float))
    explained = explain_step(record, restored.sensor, moment.truth, asked, weigh=True)
    saved = restored.saved.manifest
    if to is not None:
        snapshot(folder, to=to, step=moment.frame.step, layout="explain", force=force, listener=listener)
    sensors = tuple(say_sensors(record, moment.truth, library.arena, scale))
    phase = Phase.WEIGHT if record.parents is None else Phase.RESAMPLE
    return Explanation(saved.label, folder, explained, sensors, scale, phase)


def _of_readings(record: StepRecord, moment: Moment, origin: F64, scale: Scale) -> str:
    """Return why an update that compared no picture is not explained, and what its sensors say of it."""
    poses = {"estimate": record.estimate.pose}
    if moment.truth is not None:
        poses["truth"] = moment.truth
    readings = []
    for sensed in record.sighting.comparison.sensed:
        at = np.stack(list(poses.values())) - np.append(origin, 0)
        nats = sensed.sensor.log_likelihood(sensed.reading, at.astype(np.float32), origin)
        each = ", ".join(f"{value:.2f} at the {name}" for name, value in zip(poses, nats, strict=True))
        readings.append(f"{sensed.shown(poses).text(scale.say)} (nats: {each})")
    read = "; ".join(readings) or "its sensors read nothing"
    where = "the tab `sensors` shows it for every step"
    why = f"step {record.frame.step} compared no picture with references, so none is explained"
    return f"{why}; {read}; {where}"


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
