"""What a library's own pictures say about it, in words: whether its places can be told apart."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from maurice_mcl.library.drive_score import DriveScore
from maurice_mcl.library.left_out import PlaceScore

WORSE = "this library cannot tell its places apart: the sensor is worse than knowing nothing"
ADVICE = "survey more places, or lower sensor.sharpness, and use a preset with recovery (robust)"


def scores_of(score: PlaceScore) -> str:
    """Return both log scores, and the pictures and places that they are computed from."""
    if not score.pictures:
        return f"no two of {score.places} places see each other, so none can be left out"
    of = f"{score.pictures} pictures of {score.places} places, each place left out in turn"
    return f"log score {score.score:.2f} per picture, {score.blind:.2f} for knowing nothing; {of}"


def say_places(name: str, channels: Iterable[str], score: PlaceScore | None) -> Iterator[str]:
    """Yield what the user of a library should know before its first run; nothing if there is no problem."""
    if score is None:
        return
    by = ", ".join(channels)
    if score.worse_than_nothing:
        yield f"{name}: {WORSE} ({by}: {scores_of(score)}); {ADVICE}"
    if score.stretched:
        fitted = ", ".join(f"{channel} {factor:g} times ours" for channel, factor in score.stretched.items())
        keep = "--set sensor.widening=1 keeps ours"
        yield f"{name}: scales fitted on the library's own pictures, each place left out: {fitted}; {keep}"
    if score.widening != 1:
        why = "" if score.worse_than_nothing else f", as {score.places} places do not confirm them"
        keep = "--set sensor.widening=1 keeps the fitted ones"
        yield f"{name}: the scales of {by} are widened by {score.widening:g}{why}; {keep}"


def drive_score_of(score: DriveScore) -> str:
    """Return what a drive's pictures add at their true poses: "+0.52 nats per picture (16 pictures)"."""
    if not score.pictures:
        return "none of its pictures has a true pose in the library's free space"
    return f"{score.gain:+.2f} nats per picture over knowing the place roughly ({score.pictures} pictures)"


def say_drive(
    name: str, channels: Iterable[str], score: DriveScore, *, changed: bool = False
) -> Iterator[str]:
    """Yield what the user of a library should know about a drive through it; nothing if they agree."""
    if not score.is_bad:
        return
    worth = "are worse than none" if score.gain < 0 else "add next to nothing"
    text = f"{name}: the drive's pictures {worth} at their true poses ({', '.join(channels)}: "
    text += drive_score_of(score) + ")"
    if not changed:
        yield f"{text}; survey the places that it goes through, or lower sensor.sharpness"
        return
    keep = "--set sensor.widening=1 keeps them"
    how = "" if score.tells else ", so that the camera counts for little"
    yield f"{text}; the scales are widened by {score.widening:g}{how}; {keep}"
