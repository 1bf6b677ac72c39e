"""What a library's own pictures say about it, and those of a drive through it, in words."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

from maurice_mcl.library.drive_score import DriveScore
from maurice_mcl.library.left_out import PlaceScore
from maurice_mcl.sensor.verification import KEYPOINTS

if TYPE_CHECKING:
    from maurice_datasets.trials.recognition import PlaceRecognition

WORSE = "this library cannot tell its places apart: the sensor is worse than knowing nothing"
ADVICE = "survey more places, or lower sensor.sharpness, and use a preset with recovery (robust)"


def scores_of(score: PlaceScore) -> str:
    """Return what a picture tells of its place, and the pictures and places that this is computed from."""
    if not score.pictures:
        return f"no two of {score.places} places see each other, so none can be left out"
    of = f"{score.pictures} pictures of {score.places} places, each place left out in turn"
    times = f"{math.exp(score.score - score.blind):.2g} times as likely as knowing nothing does"
    logs = f"log score {score.score:.2f} against {score.blind:.2f}"
    return f"a picture makes its place {times} ({logs}); {of}"


def say_places(name: str, channels: Iterable[str], score: PlaceScore | None) -> Iterator[str]:
    """Yield what the user of a library should know before its first run; nothing if there is no problem."""
    if score is None:
        return
    by = ", ".join(channels)
    if score.worse_than_nothing:
        yield f"{name}: {WORSE} ({by}: {scores_of(score)}); {ADVICE}"
    if score.stretched:
        fitted = ", ".join(f"{channel} x {factor:g}" for channel, factor in score.stretched.items())
        keep = "--set sensor.widening=1 keeps the defaults"
        yield f"{name}: scales fitted on its own pictures, as multiples of the defaults: {fitted}; {keep}"
    if score.widening != 1:
        why = "" if score.worse_than_nothing else f", as {score.places} places do not confirm them"
        keep = "--set sensor.widening=1 keeps the fitted ones"
        yield f"{name}: the scales of {by} are widened by {score.widening:g}{why}; {keep}"


def drive_score_of(score: DriveScore) -> str:
    """Return what a drive's pictures add at their true poses: "... 1.7 times as likely ... (16 pictures)"."""
    if not score.pictures:
        return "none of its pictures has a true pose in the library's free space"
    times = f"{math.exp(score.gain):.2g} times as likely as knowing the place roughly does"
    return f"a picture makes the true pose {times} ({score.pictures} pictures)"


def say_drive(
    name: str, channels: Iterable[str], score: DriveScore | None, in_place_of: float | None = None
) -> Iterator[str]:
    """Yield what the user of a library should know about a drive through it; nothing if they agree.

    `in_place_of` is the factor of the library's own pictures, where the drive's decide in their place.
    """
    if score is None:
        return
    by, keep = ", ".join(channels), "--set sensor.widening=1 keeps them"
    if score.widening == 1:
        if in_place_of is not None:
            fit = f"the scales are not widened, as the drive's pictures fit at their true poses ({by})"
            yield f"{name}: {fit}; by its own pictures alone they would be, by {in_place_of:g}"
        return
    if not score.tells:
        worth = "are worse than none" if max(score.gain, score.far_gain) < 0 else "add next to nothing"
        text = f"{name}: the drive's pictures {worth} at their true poses ({by}: {drive_score_of(score)})"
    else:
        text = (
            f"{name}: the drive's pictures tell the place, but together those of one place are too sure "
            f"({by}: {drive_score_of(score)})"
        )
    if in_place_of is None:
        yield f"{text}; survey the places that it goes through, or lower sensor.sharpness"
    elif score.tells:
        yield f"{text}; the scales are widened by {score.widening:g}; {keep}"
    else:
        yield f"{text}; the camera is not used (the scales are widened by {score.widening:g}); {keep}"


def say_recognition(recognition: PlaceRecognition) -> Iterator[str]:
    """Yield what the user should know of a drive's pictures: what hurts, and what verification gains."""
    if not recognition.right:
        yield f"found: none of {recognition.pictures} pictures has a reference near its true pose"
        return
    names = recognition.hurting or ((recognition.worst,) if recognition.worst else ())
    verifying = tuple(name for name in recognition.without if name == KEYPOINTS and name not in names)
    for name in names + verifying:  # which have no row of their own
        yield _without(name, recognition)


def _without(name: str, recognition: PlaceRecognition) -> str:
    """Say how often the right reference is found first without a channel, or without verification."""
    gain, first = recognition.without[name], recognition.ways[0].recall[1].value
    is_chance = gain.low <= 0 <= gain.high
    many = name == KEYPOINTS
    verb = "hurt" if gain.value > 0 else "help"
    effect = f"may {verb}" if is_chance else f"{verb}{'' if many else 's'}"
    effect = effect if gain.value else "make no difference here"
    share = f"without {'them' if many else 'it'} {first + gain.value:.0%} of the pictures"
    points = f"{gain.text(100, 0, '+')} points{', which may be chance' if is_chance and gain.value else ''}"
    return f"{name} {effect}: {share} find a right reference first instead of {first:.0%} ({points})"
