"""What a library's own pictures say about it, in words: whether its places can be told apart."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from maurice_mcl.library.drive_score import DriveScore
from maurice_mcl.library.left_out import PlaceScore

WORSE = "this library cannot tell its places apart: the sensor is worse than knowing nothing"
ADVICE = "survey more places, or lower sensor.sharpness, and use a preset with recovery (robust)"


def scores_of(found: PlaceScore) -> str:
    """Return both log scores, and the pictures and places that they are computed from."""
    if not found.pictures:
        return f"no two of {found.places} places see each other, so none can be left out"
    of = f"{found.pictures} pictures of {found.places} places, each place left out in turn"
    return f"log score {found.score:.2f} per picture, {found.blind:.2f} for knowing nothing; {of}"


def places_said(name: str, channels: Iterable[str], found: PlaceScore | None) -> Iterator[str]:
    """Yield what the user of a library should know before its first run; nothing if there is no problem."""
    if found is None:
        return
    by = ", ".join(channels)
    if found.worse_than_nothing:
        yield f"{name}: {WORSE} ({by}: {scores_of(found)}); {ADVICE}"
    if found.stretched:
        fitted = ", ".join(f"{channel} {factor:g} times ours" for channel, factor in found.stretched.items())
        keep = "--set sensor.widening=1 keeps ours"
        yield f"{name}: scales fitted on the library's own pictures, each place left out: {fitted}; {keep}"
    if found.widening != 1:
        why = "" if found.worse_than_nothing else f", as {found.places} places do not confirm them"
        keep = "--set sensor.widening=1 keeps the fitted ones"
        yield f"{name}: the scales of {by} are widened by {found.widening:g}{why}; {keep}"


def drive_score_of(found: DriveScore) -> str:
    """Return what a drive's pictures add at their true poses: "+0.52 nats per picture (16 pictures)"."""
    if not found.pictures:
        return "none of its pictures has a true pose in the library's free space"
    return f"{found.gain:+.2f} nats per picture over knowing the place roughly ({found.pictures} pictures)"


def drive_said(
    name: str, channels: Iterable[str], found: DriveScore, *, changed: bool = False
) -> Iterator[str]:
    """Yield what the user of a library should know about a drive through it; nothing if they agree."""
    if not found.is_bad:
        return
    worth = "are worse than none" if found.gain < 0 else "add next to nothing"
    text = f"{name}: the drive's pictures {worth} at their true poses ({', '.join(channels)}: "
    text += drive_score_of(found) + ")"
    if not changed:
        yield f"{text}; survey the places that it goes through, or lower sensor.sharpness"
        return
    keep = "--set sensor.widening=1 keeps them"
    how = "" if found.tells else ", so that the camera counts for little"
    yield f"{text}; the scales are widened by {found.widening:g}{how}; {keep}"
