"""Landmarks of a library: found once in its pictures, and kept in the user's cache."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from maurice_mcl.sensor.landmarks.sensor import Landmarks
from maurice_mcl.values import U8, Camera, Library, NamedProgress

from ..errors import PictureError
from ..files.pictures import decode_picture, picture_file
from ..files.writing import cache_root
from .files import hashes_of
from .remembered import read_arrays, remembered, write_arrays

VERSION = 5  # of what landmarks are made of: another one makes them again
LANDMARKS = "landmarks"

Warn = Callable[[str], None]


def with_landmarks(
    library: Library,
    *,
    camera: Camera | None = None,
    progress: NamedProgress | None = None,
    warn: Warn | None = None,
) -> Library:
    """Return a library with landmarks, if its pictures allow any; else the same, and `warn` is told why.

    `camera` replaces what the library knows of its camera; what neither knows is fitted. They are kept in
    the user's cache: finding those of 624 references takes 5 to 6 s of CPU the first time.

        >>> from maurice_loaders import open_library, with_landmarks
        >>> library = with_landmarks(open_library("survey.log", channels=["color"]))
        >>> list(library.sensors)  # two references are too few
        []
    """
    if LANDMARKS in library.sensors:
        return library
    known = camera or library.camera
    cache = cache_root() / LANDMARKS / f"{_key(library, known)}.npz"
    landmarks = _from_cache(cache)
    if landmarks is None:
        # SciPy's sparse matrices: what is kept does not wait for them
        from maurice_mcl.sensor.landmarks.building import NoLandmarks, build_landmarks

        built = build_landmarks(library, known, partial(picture_of, library), progress)
        if isinstance(built, NoLandmarks):
            if warn:
                warn(f"the library {library.name!r} has no landmarks: {built.reason}")
            return library
        landmarks = built
        write_arrays(cache, landmarks.to_arrays())
    if warn and landmarks.map.fit.focal_assumed:
        view_deg = np.degrees(landmarks.map.fit.camera.view_rad)
        unknown = (
            f"the library {library.name!r} states no field of view of its camera, and its pictures fit none"
        )
        advice = "state it with --reading camera_fov_deg when it is built, or in the survey log's header"
        warn(f"{unknown}: landmarks assume {view_deg:.0f} degrees; {advice}")
    landmarks = replace(landmarks, obstacles=library.arena.obstacles)
    return replace(library, sensors={**library.sensors, LANDMARKS: landmarks})


def _key(library: Library, camera: Camera | None) -> str:
    """Name a library's landmarks by what they are made of: poses, pictures, camera."""
    return key_of(library, VERSION, None if camera is None else asdict(camera))


def key_of(library: Library, *about: Any) -> str:
    """Name what is made of a library's poses and pictures, and of values (as JSON)."""
    files = [str(path) for path in library.pictures if path is not None]
    also = [*about, cv2.__version__, len(library.pictures)]
    digest = hashlib.sha256(json.dumps(also, sort_keys=True).encode())
    digest.update(np.ascontiguousarray(library.poses).tobytes())
    digest.update(remembered("pictures", files, lambda: hashes_of(files)).encode())
    return digest.hexdigest()[:32]


def picture_of(library: Library, entry: int) -> U8 | None:
    """Return the picture of an entry, or None where it is not kept, is gone or cannot be read."""
    path = library.pictures[entry]
    if path is None:
        return None
    try:
        return decode_picture(picture_file(path))
    except PictureError:
        return None


def _from_cache(kept: Path) -> Landmarks | None:
    arrays = read_arrays(kept)
    try:
        return None if arrays is None else Landmarks.from_arrays(arrays)
    except Exception:  # damaged in any way: it is only a cache
        return None
