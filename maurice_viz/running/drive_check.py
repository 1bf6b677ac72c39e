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
from maurice_mcl.filter.recovery import STRATEGIES
from maurice_mcl.library.quality import DrivePicture, DriveScore, score_drive, spread_groups
from maurice_mcl.sensor.map_places import reference_of
from maurice_mcl.values import F64, Library

from ..text.library import say_drive

MOST_UPDATES = 500  # from the beginning, that pictures are chosen from: bounds time and memory
SAME_POSE = 2e-3  # meters and radians between a picture and the reference that it became
SCALE_KEYS = ("sensor.widening", "sensor.scales", "sensor.sharpness")  # setting any of them is a choice


def drive_pictures(session: RecordedSession) -> list[list[DrivePicture]]:
    """Return groups of pictures in a row, spread over a drive, whose true poses are known.

    None where odometry is made from the pictures: reading it would take as long as the drive.
    """
    pictures = [] if session.options.odometry_from_pictures else session.known_pictures(MOST_UPDATES)
    return [[pictures[k] for k in group] for group in spread_groups(len(pictures))]


def score_of(localizer: Localizer, groups: Sequence[Sequence[DrivePicture]]) -> DriveScore | None:
    """Score a drive's pictures by a filter's channels; None for a filter without any, or no known pose."""
    sensor = localizer.sensor
    if not sensor.weights or sensor.parameters.sharpness == 0 or not groups:
        return None
    score = score_drive(sensor, groups, localizer.radii.right_m, known_descriptors())
    return score if score.pictures else None


def score_feature(library: Library, weights: Mapping[str, float], session: RecordedSession) -> DriveScore:
    """Score a drive's pictures that are not references themselves by a feature over a library."""
    reference = reference_of(library)
    configuration = configure([Layer("feature", {"sensor.weights": dict(weights)})])
    parameters = adapted(configuration, library, reference)[0].parameters
    localizer = build_localizer(library, None, parameters, reference=reference)
    groups = [
        [picture for picture in group if not _is_in(library, picture.truth)]
        for group in drive_pictures(session)
    ]
    score = score_of(localizer, [group for group in groups if group])
    return DriveScore(0, np.nan) if score is None else score


def _is_in(library: Library, pose: F64) -> bool:
    return bool((np.abs(library.poses - pose) < SAME_POSE).all(axis=1).any())


def suited(
    configuration: Configuration,
    localizer: Localizer,
    start: F64 | None,
    groups: Sequence[Sequence[DrivePicture]],
) -> tuple[Configuration, Localizer, tuple[str, ...]]:
    """Widen a filter's scales where a drive's pictures mislead it; return what to say, too.

    Only where nobody has chosen them, for likelihoods that have scales, and for a known start: a search for
    the robot needs what a picture says about places far away, which this does not judge.
    """
    score = score_of(localizer, groups)
    if score is None or (score.widening == 1 and not score.is_bad):
        return configuration, localizer, ()
    sensor = localizer.sensor.parameters
    ours = ("default", "preset", "library")
    chosen = any(
        setting.key in SCALE_KEYS and not setting.origin.startswith(ours)
        for setting in configuration.settings
    )
    has_scales = (sensor.blend, sensor.likelihood) == ("calibrated", "exponential")
    changes = has_scales and not chosen and start is not None
    text = tuple(say_drive(localizer.library.name, localizer.sensor.weights, score, changed=changes))
    if not changes:
        return configuration, localizer, text
    scales = {name: scale * score.widening for name, scale in sensor.scales.items()}
    values: dict[str, Any] = {"sensor.widening": sensor.widening * score.widening, "sensor.scales": scales}
    widened = replace(sensor, widening=values["sensor.widening"], scales=scales)
    recovery = configuration.parameters.recovery
    if not score.tells and not localizer.sensor.sensors:  # what says nothing calls no particle elsewhere
        recovery = replace(recovery, strategy="none")
        values["recovery.strategy"] = recovery.strategy
    origin = "the drive's pictures"
    settings = tuple(
        Setting(setting.key, values[setting.key], origin) if setting.key in values else setting
        for setting in configuration.settings
    )
    parameters = replace(configuration.parameters, sensor=widened, recovery=recovery)
    localizer = replace(localizer, sensor=replace(localizer.sensor, parameters=widened))
    if recovery.strategy == "none":
        step = replace(localizer.recovery, strategy=STRATEGIES["none"](recovery))
        localizer = replace(localizer, recovery=step, mixture=None)
    return replace(configuration, parameters=parameters, settings=settings), localizer, text
