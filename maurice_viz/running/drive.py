"""Drives that no filter of ours runs on: alone, without a library; or with another localizer's particles.

Of the latter nothing is filtered and no picture is compared: what a bag does not hold stays empty or unknown.
"""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from maurice_loaders.bags.localizer import STAND_INS, Nearest, Overview, RecordedLocalizer, RecordedUpdate
from maurice_loaders.bags.recording import BAGS
from maurice_loaders.errors import InputError, PictureError, ReadingNotes
from maurice_loaders.formats.registry import chosen
from maurice_loaders.reading.observations import SCANS, Gate
from maurice_loaders.reading.options import ReadingOptions
from maurice_loaders.reading.session import Glance, RecordedSession
from maurice_loaders.reading.transforms import FewerPictures, Placeholders
from maurice_loaders.session_log.reader import SurveyLog
from maurice_mcl.filter.estimate import heaviest_cluster, share_within, weighted_mean
from maurice_mcl.values.arrays import F64, U8
from maurice_mcl.values.library import Library
from maurice_mcl.values.map import open_arena
from maurice_mcl.values.radii import USUAL, Radii, radii_of
from maurice_mcl.values.records import (
    Belief,
    Estimate,
    StepRecord,
    effective_sample_size,
    normalize,
    uniform_log_weights,
)
from maurice_mcl.values.session import Frame, Moment

from ..layouts.drive import drive_blueprint
from ..listener import SILENT, Listener
from ..panels.drive import DrivePaths, DriveView, draw_drive, drive_paths
from ..scene import RunView, Scene
from .open import remark_skipped
from .output import NEXT_KEYS_HINT, Drawn, OutputOptions, sink_of
from .run import Playback
from .saved_steps import NO_PICTURE, nothing_seen

MOST_RUNS = 4  # recorded localizers side by side
MOST_DRAWN = 3000  # moments; of longer drives every second, third, ... is drawn
LASER_ADVICE = "The drive has scans of a laser, for which a map is enough: add --map map.yaml."
NOT_LOCALIZED = "Nothing was localized: there is no library"


def advice_for(path: Path, drive: DriveView) -> str:
    """Return how to localize on a drive that has no library."""
    if not drive.pictures:
        return "The drive has no pictures either, and the filter needs them."
    source = shlex.quote(str(path)) if len(drive.paths.true) else "DRIVE"
    return (
        f"One is made from a drive with true poses: maurice-replay library build {source} -o LIBRARY --every "
        "0.4m,45deg. Then replay another drive with --library LIBRARY."
    )


def show_alone(whole: RecordedSession, output: OutputOptions, listener: Listener) -> Path | None:
    """Draw a drive by itself; return the recording, None for a viewer. InputError without anything to draw.

    KeyboardInterrupt goes on when the recording up to that point is written.
    """
    session, paths = _with_paths(whole)
    pictures = session.observed.pictures and not isinstance(session.recording, Placeholders)
    drive = DriveView(session.info, paths, pictures)
    advice = LASER_ADVICE if session.observed.name == SCANS else advice_for(session.path, drive)
    drive = replace(drive, advice=f"**{NOT_LOCALIZED}.** {advice}")
    shown_session = _thinned(session, paths.moments, listener)
    total = paths.moments if shown_session is session else MOST_DRAWN
    target = Drawn()

    def counted() -> Iterator[Moment]:
        for number, moment in enumerate(shown_session.moments()):
            listener.progress(number, total, "draw")
            yield moment

    stopped: KeyboardInterrupt | None = None
    layout, keys = drive_blueprint(drive), f"{NEXT_KEYS_HINT}."
    with sink_of(target, output, session.info.name, layout, listener, keys=keys) as rec:
        try:
            draw_drive(rec, drive, counted())
        except KeyboardInterrupt as stop:
            stopped = stop
    remark_skipped(shown_session, listener)
    listener.remark(f"{NOT_LOCALIZED}, so only the drive itself is shown. {advice}")
    if stopped is not None:
        raise type(stopped)("the recording is complete up to that point")
    return target.file


def _with_paths(session: RecordedSession) -> tuple[RecordedSession, DrivePaths]:
    """Go through a drive once without its pictures; one without any gets gray ones."""
    paths = _paths_of(session)
    if not paths.moments:
        session = RecordedSession(Placeholders(session.recording), session.options)
        paths = _paths_of(session)
    if not paths.moments:
        nothing = "found neither pictures nor odometry nor true poses, so there is nothing to show"
        raise InputError(session.path, nothing)
    return session, paths


def _paths_of(session: RecordedSession) -> DrivePaths:
    notes = ReadingNotes(session.options.keep_going)
    return drive_paths(session.glances(notes), session.info)


def _thinned(session: RecordedSession, moments: int, listener: Listener) -> RecordedSession:
    """Leave out pictures of a long drive, unless it is given which ones make a moment."""
    options, stride = session.options, -(-moments // MOST_DRAWN)
    if stride <= 1 or session.gate != Gate():
        return session
    listener.remark(
        f"drawing one of every {stride} of {moments} moments; --reading min_distance_m=... chooses others"
    )
    return RecordedSession(FewerPictures(session.recording, stride), options)


def moments_of(log: RecordedSession | SurveyLog) -> Iterator[Moment]:
    """Yield a session's moments; of a survey its pictures that are not covered, their poses as truth."""
    if isinstance(log, RecordedSession):
        yield from log.moments()
        return
    pictures = (picture for picture in log.survey_pictures() if not picture.covered)
    for step, picture in enumerate(pictures, start=1):
        name = "" if picture.path is None else str(picture.path)
        yield Moment(Frame(step, float(step), np.zeros((0, 3)), picture.image, name), picture.pose)


def glances_of(log: RecordedSession | SurveyLog) -> Iterator[Glance]:
    """Yield what is known of the same moments without their pictures."""
    if isinstance(log, RecordedSession):
        yield from log.glances(ReadingNotes(keep_going=True))
        return
    for moment in moments_of(log):
        yield Glance(moment.frame.motions, moment.truth, ())


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
    unweighted: int = 0  # clouds so far whose weights were of no use, and count as equal
    _begin_s: float | None = field(init=False, default=None)

    @property
    def radii(self) -> Radii:
        """By which it is judged: those of the map."""
        return radii_of(map_of(self.localizer, self.overview))

    def frame(self, update: RecordedUpdate, number: int) -> Frame:
        """Return what was recorded beside an update, the `number`-th."""
        self._begin_s = update.t_s if self._begin_s is None else self._begin_s
        image, name = self._image(update), update.picture or "no picture"
        return Frame(number, update.t_s - self._begin_s, update.motions, image, name)

    def step(self, frame: Frame, update: RecordedUpdate, origin: F64) -> tuple[Moment, StepRecord]:
        """Return moment and record of an update."""
        events = (_shown(self.localizer),) if frame.step == 1 else ()
        moment = Moment(frame, update.truth, events)
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
    """Make the record of one cloud; what only the filter itself could know is left empty or NaN.

    Whom the next cloud's particles come from is not in the bag. Lines from particle to particle are drawn
    where a cloud is as large as the one before it was left, so that one of no weight is added.
    """
    poses = np.append(belief.poses, belief.poses[:1], axis=0)
    without_heirs = Belief(poses, np.append(belief.log_weights, -np.inf), belief.origin)
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
        belief=without_heirs,
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


def open_recorded(path: Path, options: ReadingOptions) -> list[AsRecorded]:
    """Open the localizers of a bag that `localizer_topic` names, or the one that is detected.

    InputError for what is no bag, and for one without particles.
    """
    name = chosen(path, options).name
    if name not in BAGS:
        raise InputError(
            path, f"found the format {name}, expected one of {', '.join(BAGS)} for --as-recorded"
        )
    rest = replace(options, odometry_offset_s=0.0, truth_offset_s=0.0)  # a bag adds these itself
    if rest.corrections:
        raise InputError(path, f"--as-recorded shows a bag as it is, expected no {rest.corrections[0]}")
    return [_opened(path, name, options, topic) for topic in _topics(path, options)]


def _topics(path: Path, options: ReadingOptions) -> list[str | None]:
    if options.localizer_topic is None:
        return [None]
    names: list[str | None] = [name.strip() for name in options.localizer_topic.split(",")]
    if not all(names) or len(set(names)) < len(names) or len(names) > MOST_RUNS:
        got = f"found --reading localizer_topic={options.localizer_topic}"
        raise InputError(path, f"{got}, expected one to {MOST_RUNS} topics, with commas between them")
    return names


def _opened(path: Path, bag: str, options: ReadingOptions, topic: str | None) -> AsRecorded:
    localizer = RecordedLocalizer(path, BAGS[bag], options, topic)
    label = localizer.cloud.name.strip("/").replace("/", "-") or "recorded"
    return AsRecorded(localizer, localizer.overview(), label, ReadingNotes(options.keep_going))


def together(recorded: Sequence[AsRecorded]) -> Iterator[Mapping[str, tuple[Moment, StepRecord]]]:
    """Yield the updates of the first localizer for which every other has one within 0.5 s."""
    first, *others = recorded
    origin = map_of(first.localizer, first.overview).origin
    nearest = [Nearest(other.localizer.updates(other.findings)) for other in others]
    number = 0
    for update in first.localizer.updates(first.findings):
        in_time = [other.at(update.t_s) for other in nearest]
        updates = [update, *(other for other in in_time if other is not None)]
        if len(updates) == len(recorded):
            number += 1
            frame = first.frame(update, number)
            pairs = zip(recorded, updates, strict=True)
            yield {localizer.label: localizer.step(frame, own, origin) for localizer, own in pairs}


def playback_of_recorded(recorded: Sequence[AsRecorded], listener: Listener = SILENT) -> Playback:
    """Prepare recorded localizers for `play`, on one map that holds them all."""
    first = recorded[0]
    overview, arena = first.overview, first.overview.arena
    if len(recorded) > 1 and not len(arena.walls):
        corners = np.array([other.overview.arena.bounds for other in recorded]).reshape(-1, 2)
        arena = open_arena(np.stack([corners.min(axis=0), corners.max(axis=0)]), 0.0)
    for localizer in recorded:
        localizer.overview = replace(localizer.overview, arena=arena)
    library = map_of(first.localizer, first.overview)
    has_pictures = first.localizer.has_pictures
    scene = Scene(first.localizer.info, library, overview.has_truth, overview.updates, has_pictures)
    views = [RunView(run.label, (), None, run.overview.most_particles, radii=run.radii) for run in recorded]

    def remarks(_: object) -> None:
        for text in first.localizer.info.notes:
            listener.remark(text)
        for localizer in recorded:
            _remark(localizer, listener)

    return Playback(together(recorded), overview.updates, views, scene, remarks)


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
