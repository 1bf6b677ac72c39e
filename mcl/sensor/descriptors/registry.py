"""All channels by name, ours and those of installed packages; features, which are named sets of channels.

A package adds a channel by an entry point in the group "maurice_replay.channels" (docs/sensors.md).
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from importlib.metadata import EntryPoint, entry_points
from typing import Any, Protocol

import cv2
import numpy as np

from ...errors import InputError
from ...values import F32, POSE_SENSORS, U8, called, choice, made, name_of, own_part, texts
from ..distances import DISTANCES
from .chromaticity import Chromaticity
from .color_grid import ColorGrid
from .histograms import HISTOGRAMS
from .hog import Hog
from .network import HASHED, is_network, network_of
from .tiny import Tiny

GROUP = "maurice_replay.channels"
LEAST_PX = 960  # of a picture's longer side after it is reduced: one of 1,920 is halved
NAME = re.compile("[a-z][a-z0-9_]*")  # used on the command line, in TOML and in file names


class Channel(Protocol):
    """Measures a picture as one vector that is compared with a reference's, element by element."""

    @property
    def name(self) -> str:
        """Lower-case name, used on the command line and in files."""
        ...

    @property
    def distance(self) -> str:
        """Name of its default distance, see `sensor.distances`; a user may choose another."""
        ...

    @property
    def unit(self) -> str:
        """The unit of the vector's elements in a word or two, for the titles of charts."""
        ...

    def describe(self, image: U8) -> F32:
        """Return (D,) float32, finite, of a picture (H, W, 3) RGB; D is always the same.

        Of a channel that is compared by the cosine, numbers may be below 0.
        """
        ...

    def parameters(self) -> dict[str, Any]:
        """Return everything that affects `describe`, as JSON; part of every cache key."""
        ...


OURS: tuple[Channel, ...] = (
    *HISTOGRAMS,
    Chromaticity(),
    ColorGrid(),
    Tiny(),
    Hog(),
)
OUR_NAMES = frozenset(channel.name for channel in OURS)


@dataclass(frozen=True, slots=True)
class Loaded:
    """The channels, and those that could not be loaded."""

    channels: Mapping[str, Channel]  # by name, ours first
    broken: tuple[str, ...]  # one line per entry point that was left out, with the reason


def load_channels(points: Iterable[EntryPoint]) -> Loaded:
    """Load our channels and those of entry points; a broken one is left out and does not disable the rest."""
    channels: dict[str, Channel] = {channel.name: channel for channel in OURS}
    broken: list[str] = []
    for point in points:
        try:
            channel = _load(point)
            if channel.name in channels:
                raise ValueError(f"there is a channel {channel.name!r} already")
            channels[channel.name] = channel
        except ValueError as problem:
            broken.append(f"channel of entry point {point.value} left out: {' '.join(str(problem).split())}")
    return Loaded(channels, tuple(broken))


def _load(point: EntryPoint) -> Channel:
    try:
        channel: Channel = point.load()()
        members = (channel.name, channel.distance, channel.describe, channel.parameters(), channel.unit)
        json.dumps(members[3], allow_nan=False)
    except (Exception, SystemExit) as problem:  # third-party code may raise anything
        raise ValueError(f"makes no channel ({type(problem).__name__}: {problem})") from problem
    if not isinstance(members[0], str) or not NAME.fullmatch(members[0]):
        raise ValueError(f"its name is {members[0]!r}, expected a lower-case word like tiny_image")
    if members[1] not in DISTANCES:
        raise ValueError(f"its distance is {members[1]!r}, expected one of {', '.join(DISTANCES)}")
    return channel


def reduction(width: int, height: int) -> int:
    """Return by how much a picture of a size in pixels is reduced before it is measured: 1, 2, 4, ..."""
    return 1 << max((max(width, height) // LEAST_PX).bit_length() - 1, 0)


def reduced(image: U8) -> U8:
    """Return a picture (H, W, 3) as it is measured: a large one averaged over 2 x 2 pixels, 4 x 4, ...

    Its longer side stays 960 pixels or more: nothing smaller than 1,920 is changed. What channels look for is
    as large as in pictures of small cameras then, and measuring one of 3,840 x 2,160 takes a sixteenth.

        >>> import numpy as np
        >>> reduced(np.zeros((2160, 3840, 3), np.uint8)).shape
        (540, 960, 3)
    """
    height, width = image.shape[:2]
    factor = reduction(width, height)
    if factor == 1:
        return image
    size = max(width // factor, 1), max(height // factor, 1)
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)


def describe(channel: Channel, image: U8, size: int | None = None) -> F32:
    """Measure a reduced picture with a channel, maybe third-party. ValueError for an invalid result."""
    try:
        descriptor = channel.describe(image)
    except (Exception, SystemExit) as problem:  # third-party code
        raise ValueError(f"channel {channel.name!r} raised {type(problem).__name__}: {problem}") from problem
    if not isinstance(descriptor, np.ndarray) or descriptor.dtype != np.float32 or descriptor.ndim != 1:
        kind = type(descriptor).__name__
        what = f"{descriptor.dtype} {descriptor.shape}" if isinstance(descriptor, np.ndarray) else kind
        raise ValueError(f"channel {channel.name!r} gave {what}, expected float32 of one dimension")
    if size is not None and len(descriptor) != size:
        raise ValueError(f"channel {channel.name!r} gave {len(descriptor)} numbers after {size}")
    if not _is_measured(descriptor, channel.distance):
        raise ValueError(f"channel {channel.name!r} gave a negative or no finite number")
    return descriptor


def _is_measured(descriptor: F32, distance: str) -> bool:
    """Whether all numbers are finite, and none is below 0 but where the cosine is compared."""
    return bool(np.isfinite(descriptor).all() and (distance == "cosine" or (descriptor >= 0).all()))


LOADED = load_channels(entry_points(group=GROUP))


class Channels(dict[str, Channel]):
    """Ours and those of packages by name; those of users are found by name, once a filter asks for them."""

    own: dict[str, Channel]

    def __contains__(self, name: object) -> bool:
        """Return whether there is a channel of a name, a user's as well."""
        return super().__contains__(name) or name in self.own

    def __missing__(self, name: str) -> Channel:
        """Return a user's channel. KeyError for a name that no channel has."""
        return self.own[name]

    def get(self, name: str, default: Any = None) -> Any:
        """Return a channel, a user's as well."""
        return super().get(name) or self.own.get(name, default)


CHANNELS = Channels(LOADED.channels)
CHANNELS.own = {}
BROKEN: tuple[str, ...] = LOADED.broken  # messages for people


# Channels of the user's: objects of a script, or `module:name`, which no package provides.


class OwnChannel:
    """A channel of the user's: what it raises or gives wrongly is an InputError of one line."""

    def __init__(self, part: str, channel: Any) -> None:
        """Take the channel, and the name of the part. ValueError for what is no channel."""
        self.part = part
        self.name: str = getattr(channel, "name", "")
        self.distance: str = getattr(channel, "distance", "l1")
        self.unit: str = getattr(channel, "unit", "its own unit")
        if not callable(getattr(channel, "describe", None)):
            raise ValueError(
                f"channel {part}: has no describe(image); a channel has name, distance and describe"
            )
        names = (*LOADED.channels, *POSE_SENSORS)
        if not isinstance(self.name, str) or not NAME.fullmatch(self.name) or self.name in names:
            expected = "expected a lower-case word like cells that no channel has"
            expected += "; rename the file" if is_network(part) else ""
            raise ValueError(f"channel {part}: its name is {self.name!r}, {expected}")
        if self.distance not in DISTANCES:
            known = ", ".join(DISTANCES)
            raise ValueError(f"channel {part}: its distance is {self.distance!r}, expected one of {known}")
        self._describe = channel.describe

    def describe(self, image: U8) -> F32:
        """Return (D,) float32 of a picture (H, W, 3) RGB. InputError for other numbers."""
        descriptor = np.asarray(called(f"channel {self.part}", self._describe, image), np.float32)
        if descriptor.ndim != 1 or not _is_measured(descriptor, self.distance):
            expected = "expected finite numbers of one dimension"
            expected += "" if self.distance == "cosine" else ", none below 0"
            raise InputError(None, f"channel {self.part}: found {descriptor.shape}, {expected}")
        return descriptor

    def parameters(self) -> dict[str, Any]:
        """Return what its descriptors depend on: its source, of a network its hash wherever the file is."""
        return {"part": HASHED.findall(self.part) if is_network(self.part) else self.part}


def channel_names(key: str, value: Any) -> tuple[str, ...]:
    """Take a list of the user's channels: objects, or names, `module:name`; each gets one with a hash."""
    parts = value if isinstance(value, (list, tuple)) else texts(key, value)
    return tuple(dict.fromkeys(map(_name_of_channel, parts)))


def _name_of_channel(part: Any) -> str:
    if is_network(part):
        return str(part) if HASHED.search(part) else network_of(part).part
    if isinstance(part, str):
        return part if "@" in part else name_of(own_part("channel", part))
    return name_of(part)


def _own_channel(part: str) -> OwnChannel:
    if is_network(part):
        return OwnChannel(part, network_of(part))
    return OwnChannel(part, made("channel", own_part("channel", part)))


def give_channels(parts: Iterable[str]) -> tuple[str, ...]:
    """Make the user's channels known by name, and return the names. ValueError for what is no channel."""
    channels = list(map(_own_channel, parts))
    names = tuple(channel.name for channel in channels)
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise ValueError(f"channels: found two called {twice!r}; give them names of their own")
    CHANNELS.own.update({channel.name: channel for channel in channels})
    return names


# Features: which channels, with which weights, and the measured scale of each channel's distance.
#
# Fitted by log score on drives with arena seed = seed = 1 to 8 in each of the tiers nominal, dim and hard, as
# `maurice-replay library tune` does for any library (docs/results.md).

# channel -> distance -> the distance that costs one nat of log-likelihood
SCALES: Mapping[str, Mapping[str, float]] = {
    "color": {
        "hellinger": 0.173,
        "l1": 0.791,
        "l2": 1.307,
        "chi2": 0.401,
        "thesis": 0.0198,
    },
    "edges": {"hellinger": 0.0751, "l1": 0.146, "thesis": 0.0236},
    "smoothed": {"hellinger": 0.169, "l1": 0.779, "thesis": 0.0224},
    "blurred": {"hellinger": 0.195, "l1": 0.853, "thesis": 0.00884},
    "cumulative": {"hellinger": 0.267, "l1": 3.35},
    "chromaticity": {"hellinger": 0.00300, "l1": 0.000306, "thesis": 0.00196},
    "color_grid": {"l1": 0.000915, "hellinger": 0.00708},
    "tiny": {"l1": 0.00624, "hellinger": 0.00400},
    "hog": {"l1": 0.00257, "hellinger": 0.00590},
}

# name -> channel -> weight of its calibrated distance; a single channel needs no entry here
FEATURES: Mapping[str, Mapping[str, float]] = {
    "color": {"color": 1.0},
    "edges": {"edges": 1.0},
    "blended": {"color": 0.63, "edges": 0.57},  # the thesis's two
    "best": {"chromaticity": 0.54, "blurred": 0.28, "edges": 0.22, "tiny": 0.21},  # of all sets tried
    # pose sensors, which weigh every particle at its own pose (pose_sensor.py)
    "verified": {"chromaticity": 0.54, "blurred": 0.28, "edges": 0.22, "tiny": 0.21, "keypoints": 0.1},
    "landmarks": {"landmarks": 1.0},
    "all": {"chromaticity": 0.54, "blurred": 0.28, "edges": 0.22, "tiny": 0.21, "landmarks": 1.0},
}


def weights_of(feature: str) -> dict[str, float]:
    """Return channel -> weight of a feature: a key of `FEATURES`, any one channel, or a network."""
    if is_network(feature):
        return {network_of(feature).name: 1.0}
    return dict(FEATURES.get(feature, {feature: 1.0}))


def settings_of_feature(feature: str) -> dict[str, Any]:
    """Return what a feature sets, by key of the configuration; for a network, also the channel that it is."""
    channels = {"sensor.channels": [feature]} if is_network(feature) else {}
    return {"sensor.weights": weights_of(feature)} | channels


def feature_name(key: str, value: Any) -> str:
    """Take the name of a feature, of a channel, or a network, `onnx:FILE.onnx`."""
    return str(value) if is_network(value) else choice(*FEATURES, *CHANNELS)(key, value)
