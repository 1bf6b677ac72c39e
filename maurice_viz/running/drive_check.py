"""Whether a drive's own pictures agree with the library: scored where the truth is known, before a replay.

Where they do not, the scales of the channels are widened, until a camera that misleads counts for little.
The filter itself never sees a true pose.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from maurice_loaders.libraries.measured import known_descriptors
from maurice_loaders.reading.session import RecordedSession
from maurice_mcl.config.build import adapted, build_localizer
from maurice_mcl.config.parameters import Configuration, Layer, Setting, configure
from maurice_mcl.filter.localizer import Localizer
from maurice_mcl.filter.proposal import MotionProposal
from maurice_mcl.filter.recovery import STRATEGIES
from maurice_mcl.library.drive_score import DrivePicture, DriveScore, score_drive
from maurice_mcl.library.retrieval import Retrieval, look_up
from maurice_mcl.sensor.map_places import reference_of
from maurice_mcl.sensor.model import SensorModel, SensorParameters
from maurice_mcl.values import F64, Domain, Library, Progress, stream

MOST_UPDATES = 500  # from the beginning, that pictures are chosen from: bounds time and memory
MOST_LOOKED_THROUGH = 5000  # updates, of which as many pictures, evenly spread, are looked up in a library
MOVED_ALONE = 200  # particles that show how far a filter gets without pictures
SAME_POSE = 2e-3  # meters and radians between a picture and the reference that it became
SCALE_KEYS = ("sensor.widening", "sensor.scales", "sensor.sharpness")  # setting any of them is a choice


def score_of(sensor: SensorModel, right_m: float, pictures: Sequence[DrivePicture]) -> DriveScore | None:
    """Score a drive's pictures by a sensor's channels; None for one without any, or no known pose."""
    if not sensor.weights or sensor.parameters.sharpness == 0 or not pictures:
        return None
    score = score_drive(sensor, pictures, right_m, known_descriptors())
    return score if score.pictures else None


def score_feature(library: Library, weights: Mapping[str, float], session: RecordedSession) -> DriveScore:
    """Score a drive's pictures that are not references themselves by a feature over a library."""
    sensor, right_m = _by_feature(library, weights)
    score = score_of(sensor, right_m, _not_in(library, session.known_pictures(MOST_UPDATES)))
    return DriveScore(0, np.nan) if score is None else score


def look_up_drive(
    library: Library,
    weights: Mapping[str, float],
    session: RecordedSession,
    progress: Progress | None = None,
) -> Retrieval:
    """Look a drive's pictures that are not references themselves up in a library, by a feature."""
    (sensor, right_m), known = _by_feature(library, weights), known_descriptors()
    pictures = _not_in(library, session.known_pictures(MOST_LOOKED_THROUGH))
    chosen = np.linspace(0, len(pictures) - 1, min(len(pictures), MOST_UPDATES)).round().astype(int)
    retrieval = look_up(sensor, [pictures[k] for k in chosen.tolist()], right_m, known, progress)
    if known is not None:
        known.flush()
    return retrieval


def _by_feature(library: Library, weights: Mapping[str, float]) -> tuple[SensorModel, float]:
    """Return a feature's sensor over a library, not widened, and the radius *right*."""
    reference = reference_of(library)
    configuration = configure([Layer("feature", {"sensor.weights": dict(weights)})])
    scaled, places = adapted(configuration, library, reference)
    localizer = build_localizer(library, None, scaled.parameters, reference=reference)
    ours = _unwidened(localizer.sensor.parameters, 1.0 if places is None else places.widening)
    return replace(localizer.sensor, parameters=ours), localizer.radii.right_m


def _not_in(library: Library, pictures: Sequence[DrivePicture]) -> list[DrivePicture]:
    return [picture for picture in pictures if not _is_in(library, picture.truth)]


def _is_in(library: Library, pose: F64) -> bool:
    return bool((np.abs(library.poses - pose) < SAME_POSE).all(axis=1).any())


def suited(
    configuration: Configuration,
    localizer: Localizer,
    of_library: float,
    start: F64 | None,
    pictures: Sequence[DrivePicture],
) -> tuple[Configuration, Localizer, DriveScore | None]:
    """Let a drive's pictures decide how wide a filter's scales are, in place of the library's own.

    `of_library` is the factor by which the library's own pictures widened them. Also returns the score.
    That is done only where nobody has chosen the scales, for likelihoods that have some, and for a known
    start: a search for the robot needs what a picture says about places far away, which this does not judge.
    Pictures that mislead are not used at all where the filter stays right without them.
    """
    ours = _unwidened(configuration.parameters.sensor, of_library)
    score = score_of(replace(localizer.sensor, parameters=ours), localizer.radii.right_m, pictures)
    if score is None or start is None or not (score.concludes and _may_change(configuration)):
        return configuration, localizer, score
    if score.widening > 1 and error_without_m(localizer, start, pictures) <= localizer.radii.right_m:
        score = score.muted
    if score.widening == of_library == 1:
        return configuration, localizer, score
    widened, recovery = _widened(ours, score.widening), configuration.parameters.recovery
    values: dict[str, Any] = {"sensor.widening": widened.widening, "sensor.scales": dict(widened.scales)}
    localizer = replace(localizer, sensor=replace(localizer.sensor, parameters=widened))
    if not score.tells and not localizer.sensor.sensors:  # what says nothing calls no particle elsewhere
        recovery = replace(recovery, strategy="none")
        values["recovery.strategy"] = recovery.strategy
        step = replace(localizer.recovery, strategy=STRATEGIES["none"](recovery))
        localizer = replace(localizer, recovery=step, proposal=MotionProposal())
    settings = tuple(
        Setting(setting.key, values[setting.key], "the drive's pictures")
        if setting.key in values
        else setting
        for setting in configuration.settings
    )
    parameters = replace(configuration.parameters, sensor=widened, recovery=recovery)
    return replace(configuration, parameters=parameters, settings=settings), localizer, score


def _widened(sensor: SensorParameters, factor: float) -> SensorParameters:
    """Return parameters whose scales are all so many times as wide."""
    scales = {name: scale * factor for name, scale in sensor.scales.items()}
    return replace(sensor, widening=sensor.widening * factor, scales=scales)


def _unwidened(sensor: SensorParameters, of_library: float) -> SensorParameters:
    """Return parameters as they were before a library widened them by a factor; they had none."""
    return sensor if of_library == 1 else replace(_widened(sensor, 1 / of_library), widening=1.0)


def error_without_m(localizer: Localizer, start: F64, pictures: Sequence[DrivePicture]) -> float:
    """Return the mean error in meters of a filter that goes by its movements alone; infinite without a model.

    Where it stays right, pictures whose likelihood is no good cannot better it: they pull it to references.
    """
    if localizer.motion is None:
        return np.inf
    origin, rng = localizer.library.origin, stream(Domain.COMPARE, 0)
    poses = np.tile(start - [*origin, 0.0], (MOVED_ALONE, 1)).astype(np.float32)
    off_m = list[float]()
    for picture in pictures:
        for motion in picture.motions:
            noise = rng.standard_normal(poses.shape, np.float32)
            poses = localizer.motion.move(poses, origin, motion, noise)
        off_m.append(float(np.hypot(*(poses[:, :2].mean(axis=0) + origin - picture.truth[:2]))))
    return float(np.mean(off_m))


def _may_change(configuration: Configuration) -> bool:
    """Whether a filter's likelihood has scales, and nobody has chosen them."""
    sensor, ours = configuration.parameters.sensor, ("default", "preset", "library")
    chosen = any(
        setting.key in SCALE_KEYS and not setting.origin.startswith(ours)
        for setting in configuration.settings
    )
    return (sensor.blend, sensor.likelihood) == ("calibrated", "exponential") and not chosen
