"""A library with all that filters compare by: channels of the users' own, landmarks, and keypoints."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import chain

from maurice_mcl.config.parameters import Configuration
from maurice_mcl.sensor.descriptors.registry import give_channels
from maurice_mcl.values import Library, NamedProgress, SessionInfo

from ..errors import InputError

FOUND_IN_PICTURES = ("landmarks", "keypoints")  # keys of `sensor.weights`


def with_channels(
    configurations: Sequence[Configuration], library: Library, progress: NamedProgress | None = None
) -> Library:
    """Return a library that is measured by the users' own channels that filters compare by. InputError."""
    sensors = [configuration.parameters.sensor for configuration in configurations]
    parts = dict.fromkeys(part for sensor in sensors for part in sensor.channels)
    if not parts:
        return library
    from .own_channels import with_own_channels

    try:
        give_channels(parts)
    except ValueError as problem:
        raise InputError(None, str(problem)) from None
    return with_own_channels(library, dict.fromkeys(chain(*(sensor.weights for sensor in sensors))), progress)


def completed(
    configurations: Sequence[Configuration],
    library: Library,
    info: SessionInfo | None = None,
    progress: NamedProgress | None = None,
    warn: Callable[[str], None] | None = None,
) -> list[Library]:
    """Return the library of each filter: with the channels, landmarks and keypoints that it compares by.

    `info` is of the session, whose camera counts where the library knows none. InputError for channels of
    one name that are not the same.
    """
    library = with_channels(configurations, library, progress)
    weights_of_runs = [configuration.parameters.sensor.weights for configuration in configurations]
    cameras = () if info is None else info.cameras
    camera = library.camera or (cameras[0] if cameras else None)
    whole = library
    if any("landmarks" in weights for weights in weights_of_runs):
        from .landmarks import with_landmarks

        whole = with_landmarks(whole, camera=camera, progress=progress, warn=warn)
    if any("keypoints" in weights for weights in weights_of_runs):
        from .keypoints import with_keypoints

        whole = with_keypoints(whole, progress=progress, warn=warn)
    libraries = {frozenset(library.sensors): library, frozenset(whole.sensors): whole}
    each = list[Library]()
    for weights in weights_of_runs:
        names = frozenset(name for name in whole.sensors if name in library.sensors or name in weights)
        if names not in libraries:
            libraries[names] = replace(library, sensors={name: whole.sensors[name] for name in names})
        each.append(libraries[names])
    return each
