"""Keypoints of a library's pictures, which verify references: found once, kept in the user's cache."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from maurice_mcl.sensor.ahead import on_all_cores
from maurice_mcl.sensor.descriptors.registry import reduced
from maurice_mcl.sensor.landmarks.features import Keypoints, keypoints_of
from maurice_mcl.sensor.verification import KEYPOINTS, KeypointMatches
from maurice_mcl.values import U8, Library, NamedProgress

from ..files.writing import cache_root
from .landmarks import Warn, key_of, picture_of
from .remembered import read_arrays, write_arrays

VERSION = 1  # of how keypoints are found: another one finds them again
NO_PICTURE: U8 = np.zeros((8, 8, 3), np.uint8)  # in place of one that is gone: it has no keypoints


def with_keypoints(
    library: Library, *, progress: NamedProgress | None = None, warn: Warn | None = None
) -> Library:
    """Return a library with the keypoints of its pictures, for features that verify references.

    `warn` is told of a library whose pictures have none, or are gone. They are kept in the user's cache:
    finding those of 624 references takes 3 s of CPU the first time.

        >>> from maurice_loaders import open_library, with_keypoints
        >>> library = with_keypoints(open_library("survey.log", channels=["color"]))
        >>> list(library.sensors)
        ['keypoints']
    """
    if KEYPOINTS in library.sensors or library.is_map:
        return library
    cache = cache_root() / KEYPOINTS / f"{key_of(library, VERSION)}.npz"
    arrays = read_arrays(cache)
    try:
        matches = None if arrays is None else KeypointMatches.from_arrays(arrays)
    except (KeyError, ValueError):  # damaged: it is only a cache
        matches = None
    if matches is None:
        matches = _found(library, progress or (lambda done, total, what: None))
        write_arrays(cache, matches.to_arrays())
    if warn is not None and not len(matches.pixels):
        warn(f"the library {library.name!r} has no pictures with keypoints: no reference is verified")
    return replace(library, sensors={**library.sensors, KEYPOINTS: matches})


def _found(library: Library, progress: NamedProgress) -> KeypointMatches:
    def look(entry: int) -> Keypoints:
        image = picture_of(library, entry)
        return keypoints_of(NO_PICTURE if image is None else reduced(image))

    keypoints = []
    for count, points in enumerate(on_all_cores(look, range(library.size)), 1):
        keypoints.append(points)
        progress(count, library.size, KEYPOINTS)
    return KeypointMatches.of(library.poses, keypoints)
