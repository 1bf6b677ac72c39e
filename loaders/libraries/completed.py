"""A library with all that filters compare by: channels of the users' own, and landmarks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import chain

from maurice_mcl.config.parameters import Configuration
from maurice_mcl.sensor.descriptors.registry import give_channels
from maurice_mcl.values import Library, NamedProgress, SessionInfo

from ..errors import InputError

LANDMARKS = "landmarks"  # as a key of `sensor.weights`


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
    """Return the library of each filter: with landmarks and the user's channels, where it compares by them.

    `info` is of the session, whose camera counts where the library knows none. InputError for channels of
    one name that are not the same.
    """
    library = with_channels(configurations, library, progress)
    asks = [LANDMARKS in configuration.parameters.sensor.weights for configuration in configurations]
    if not any(asks):
        return [library] * len(asks)
    from .landmarks import with_landmarks

    cameras = () if info is None else info.cameras
    camera = library.camera or (cameras[0] if cameras else None)
    marked = with_landmarks(library, camera=camera, progress=progress, warn=warn)
    return [marked if asked else library for asked in asks]
