"""Another localizer's run, as a bag holds it: nothing is filtered, and what is not there stays unknown."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from hashlib import sha256
from pathlib import Path

import numpy as np

from maurice_loaders.bags.localizer import STAND_INS, Nearest, Overview, RecordedLocalizer, RecordedUpdate
from maurice_loaders.bags.recording import BAGS
from maurice_loaders.config_files import configuration_of, to_toml
from maurice_loaders.errors import InputError, PictureError, ReadingNotes
from maurice_loaders.formats.registry import chosen
from maurice_loaders.libraries.store import open_library
from maurice_loaders.reading.options import Reading
from maurice_loaders.reading.recording import PLACEHOLDER
from maurice_loaders.runs.manifest import RunManifest, library_hash, source_of, versions_now
from maurice_mcl.filter.estimate import heaviest_cluster, share_within, weighted_mean
from maurice_mcl.values.arrays import F64, U8
from maurice_mcl.values.library import USUAL, Library, Radii, radii_of
from maurice_mcl.values.map import open_arena
from maurice_mcl.values.records import (
    Belief,
    Estimate,
    StepRecord,
    effective_sample_size,
    normalize,
    uniform_log_weights,
)
from maurice_mcl.values.session import Frame, Moment, SessionInfo

from ..errors import SILENT, Listener
from ..scene import RunView, Scene
from .run import Playback
from .saved_steps import NO_PICTURE, nothing_seen, without_heirs
from .saving import ToSave

MOST_RUNS = 4  # recorded localizers side by side
AFTER_RESAMPLING = (
    "shown as recorded: AMCL and Beluga publish their particles after resampling, so the weights are nearly "
    "equal and say little of how well each particle matched"
)


WITHOUT_CLOUD = (
    "shown as recorded: poses without particles, so ellipses of two standard deviations are drawn along the "
    f"path, and {STAND_INS} points of the same mean and covariance stand for the cloud"
)


def map_of(localizer: RecordedLocalizer, overview: Overview) -> Library:
    """Make a library without entries, of which only the map can be drawn."""
    return Library(localizer.info.name, np.zeros((0, 3)), (), {}, overview.arena)


@dataclass(slots=True)
class AsRecorded:
    """The updates of one recorded localizer."""

    localizer: RecordedLocalizer
    overview: Overview
    label: str
    findings: ReadingNotes
    place: Path | None = None  # a map beside the bag
    unweighted: int = 0  # clouds so far whose weights were of no use, and count as equal
    _begin_s: float | None = field(init=False, default=None)

    @property
    def radii(self) -> Radii:
        """By which it is judged: those of the map."""
        return radii_of(map_of(self.localizer, self.overview))

    def frame(self, update: RecordedUpdate, number: int) -> Frame:
        """Return what was recorded beside an update, the `number`-th."""
        self._begin_s = update.t_s if self._begin_s is None else self._begin_s
        image, name = self._image(update), update.picture or PLACEHOLDER
        return Frame(number, update.t_s - self._begin_s, update.motions, image, name, scan=update.scan)

    def step(self, frame: Frame, update: RecordedUpdate, origin: F64) -> tuple[Moment, StepRecord]:
        """Return moment and record of an update."""
        shown = (_shown(self.localizer),) if frame.step == 1 else ()
        moment = Moment(frame, update.truth, (*shown, *update.events))
        return moment, record_of(frame, update, self._belief(update, origin), self.radii)

    def _image(self, update: RecordedUpdate) -> U8:
        if update.read is None:
            return NO_PICTURE
        try:
            return update.read()
        except PictureError as problem:
            self.findings.problem(InputError(self.localizer.path, f"{update.picture}: {problem}"))
            return NO_PICTURE

    def _belief(self, update: RecordedUpdate, origin: F64) -> Belief:
        local = update.poses.copy()
        local[:, :2] -= origin
        log_weights = _log_weights(update.weights)
        if log_weights is None:
            self.unweighted += update.weights is not None
            log_weights = uniform_log_weights(len(local))
        return Belief(local.astype(np.float32), log_weights, origin)


def _shown(localizer: RecordedLocalizer) -> str:
    return AFTER_RESAMPLING if localizer.has_cloud else WITHOUT_CLOUD


def record_of(frame: Frame, update: RecordedUpdate, belief: Belief, radii: Radii = USUAL) -> StepRecord:
    """Make the record of one cloud; what only the filter itself could know is left empty or NaN."""
    return StepRecord(
        frame=frame,
        predicted=belief,  # as it was before the sensor is not in the bag
        sighting=nothing_seen(belief.size),
        weighted=belief,
        estimate=estimate_of(update, belief, radii),
        mean_estimate=weighted_mean(belief, radii),
        effective_sample_size=effective_sample_size(belief.log_weights),
        log_evidence=float("nan"),
        calibrated_evidence=float("nan"),
        channel_evidence=np.zeros(0),
        parents=None,
        injected=None,
        belief=without_heirs(belief),
        events=(),
        took_s={},
    )


def estimate_of(update: RecordedUpdate, belief: Belief, radii: Radii) -> Estimate:
    """Return the localizer's own pose with its own spread, or the heaviest cluster where it said none."""
    if update.pose is None:
        return heaviest_cluster(belief, radii)
    pose = update.pose
    x, y, heading = (float(value) for value in pose.sd)
    mass = share_within(belief, pose.pose, radii.cluster_m)
    confidence = share_within(belief, pose.pose, radii.confidence_m)
    return Estimate(pose.pose, (x, y), heading, mass, confidence, converged=mass, radii=radii)


def _log_weights(weights: F64 | None) -> F64 | None:
    """Return normalized log-weights (N,), or None where the weights make no sense."""
    if weights is None or not (np.isfinite(weights).all() and (weights >= 0).all() and weights.sum() > 0):
        return None
    with np.errstate(divide="ignore"):
        return normalize(np.log(weights))[0]


def open_recorded(path: Path, options: Reading, place: Path | None = None) -> list[AsRecorded]:
    """Open the localizers of a bag that `localizer_topic` names, or the one that is detected.

    `place` is a map or library for a bag without `/map`. InputError for what is no bag, and for one without
    particles.
    """
    name = chosen(path, options).name
    if name not in BAGS:
        raise InputError(
            path, f"found the format {name}, expected one of {', '.join(BAGS)} for --as-recorded"
        )
    rest = replace(options, odometry_offset_s=0.0, truth_offset_s=0.0)  # a bag adds these itself
    if rest.corrections:
        raise InputError(path, f"--as-recorded shows a bag as it is, expected no {rest.corrections[0]}")
    return [_opened(path, name, options, topic, place) for topic in _topics(path, options)]


def _topics(path: Path, options: Reading) -> list[str | None]:
    if options.localizer_topic is None:
        return [None]
    names: list[str | None] = [name.strip() for name in options.localizer_topic.split(",")]
    if not all(names) or len(set(names)) < len(names) or len(names) > MOST_RUNS:
        got = f"found --reading localizer_topic={options.localizer_topic}"
        raise InputError(path, f"{got}, expected one to {MOST_RUNS} topics, with commas between them")
    return names


def _opened(path: Path, bag: str, options: Reading, topic: str | None, place: Path | None) -> AsRecorded:
    arena = None if place is None else open_library(place).arena
    localizer = RecordedLocalizer(path, BAGS[bag], options, topic, arena)
    label = localizer.cloud.name.strip("/").replace("/", "-") or "recorded"
    return AsRecorded(localizer, localizer.overview(), label, ReadingNotes(options.keep_going), place)


def together(recorded: Sequence[AsRecorded]) -> Iterator[Mapping[str, tuple[Moment, StepRecord]]]:
    """Yield the updates of the first localizer for which every other has one within 0.5 s."""
    first = recorded[0]
    origin = map_of(first.localizer, first.overview).origin
    for frame, updates in _framed(recorded):
        pairs = zip(recorded, updates, strict=True)
        yield {localizer.label: localizer.step(frame, own, origin) for localizer, own in pairs}


def _framed(recorded: Sequence[AsRecorded]) -> Iterator[tuple[Frame, list[RecordedUpdate]]]:
    first, *others = recorded
    nearest = [Nearest(other.localizer.updates(other.findings)) for other in others]
    number = 0
    for update in first.localizer.updates(first.findings):
        in_time = [other.at(update.t_s) for other in nearest]
        updates = [update, *(other for other in in_time if other is not None)]
        if len(updates) == len(recorded):
            number += 1
            yield first.frame(update, number), updates


@dataclass(frozen=True, slots=True)
class RecordedFrames:
    """What was recorded beside the updates of localizers, as a session."""

    recorded: Sequence[AsRecorded]

    @property
    def info(self) -> SessionInfo:
        """What is known before the first update."""
        return self.recorded[0].localizer.info

    @property
    def begin_s(self) -> float:
        """The time of the first update on the bag's own clock."""
        return next((updates[0].t_s for _, updates in _framed(self.recorded)), 0.0)

    def moments(self) -> Iterator[Moment]:
        """Yield them from the first, with pictures and scans."""
        for frame, updates in _framed(self.recorded):
            yield Moment(frame, updates[0].truth, updates[0].events)


def scene_of_recorded(recorded: Sequence[AsRecorded]) -> Scene:
    """Return the scene of recorded localizers, which get one map that holds them all."""
    first = recorded[0]
    overview, arena = first.overview, first.overview.arena
    if len(recorded) > 1 and not len(arena.walls):
        corners = np.array([other.overview.arena.bounds for other in recorded]).reshape(-1, 2)
        arena = open_arena(np.stack([corners.min(axis=0), corners.max(axis=0)]), 0.0)
    for localizer in recorded:
        localizer.overview = replace(localizer.overview, arena=arena)
    library, has_pictures = map_of(first.localizer, first.overview), first.localizer.has_pictures
    return Scene(first.localizer.info, library, overview.has_truth, overview.updates, has_pictures)


def playback_of_recorded(recorded: Sequence[AsRecorded], listener: Listener = SILENT) -> Playback:
    """Prepare recorded localizers for `play`, on one map that holds them all."""
    first, scene = recorded[0], scene_of_recorded(recorded)
    views = [RunView(run.label, (), None, run.overview.most_particles, radii=run.radii) for run in recorded]

    def remarks(_: object) -> None:
        for text in first.localizer.info.notes:
            listener.remark(text)
        for localizer in recorded:
            _remark(localizer, listener)

    return Playback(together(recorded), scene.updates, views, scene, remarks)


def _remark(recorded: AsRecorded, listener: Listener) -> None:
    """Report what the scores stand for, and what was skipped."""
    pose = recorded.localizer.pose
    where = f"the pose of {pose.name}" if pose else "the heaviest cluster of the cloud"
    listener.remark(f"{recorded.localizer.cloud.name} {_shown(recorded.localizer)}; the estimate is {where}")
    if recorded.unweighted:
        listener.warning(f"the weights of {recorded.unweighted} clouds add up to nothing and count as equal")
    for warning in recorded.findings.warnings:
        listener.warning(warning)
    if recorded.findings.count:
        listener.warning(
            f"skipped {recorded.findings.count} broken messages, the first: {recorded.findings.problems[0]}"
        )


def recorded_to_save(recorded: Sequence[AsRecorded], reading: Reading) -> list[ToSave]:
    """Return what is to be written of recorded localizers; the settings that they ran with are not known."""
    scene = scene_of_recorded(recorded)
    path, library = recorded[0].localizer.path, scene.library
    form = chosen(path, reading)

    def to_save(run: AsRecorded) -> ToSave:
        text = to_toml(configuration_of(None, None, {}, {"particles": run.overview.most_particles}))

        def manifest(folder: Path) -> RunManifest:
            bag = source_of(path, folder, form.beside(path))
            return RunManifest(
                label=run.label,
                seed=0,
                start=None,
                channels=(),
                origin_m=tuple(library.origin.tolist()),
                name=scene.info.name,
                display_units=scene.info.display_units,
                pictures=scene.updates,
                has_truth=scene.has_truth,
                keep_going=reading.keep_going,
                session=bag,
                library=bag if recorded[0].place is None else source_of(recorded[0].place, folder),
                library_content=library_hash(library, ()),
                configuration_sha256=sha256(text.encode()).hexdigest(),
                versions=versions_now(),
                radii=run.radii,
                reading=replace(reading, format=form.name),
                recorded=True,
            )

        return ToSave(run.label, manifest, text, library.arena)

    return [to_save(run) for run in recorded]
