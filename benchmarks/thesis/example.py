"""The pictures of a drive compared with its library by the thesis's filter, a feature at a time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property

import numpy as np

from maurice_datasets.render.image_sensor import Sensor
from maurice_datasets.trials.drives import Drive
from maurice_datasets.worlds.world import inside
from maurice_loaders.errors import InputError
from maurice_mcl.fitting.sensor import true_entry
from maurice_mcl.sensor.descriptors.registry import CHANNELS
from maurice_mcl.sensor.distances import contributions
from maurice_mcl.values.arrays import F32, F64, I32, U8, Bool
from maurice_mcl.values.library import Library
from maurice_mcl.values.session import Moment
from maurice_viz.drawing.contact_sheet import read_picture

THESIS = "thesis"  # the preset, and its distance
SEED = 0  # of added noise
MORE_LIGHT = 1.3  # for figures about a shift of light: the brightest of the plan "brightness"


@dataclass(frozen=True)
class DrivePictures:
    """All pictures of a drive that were taken at a known place, each with the truth's reference."""

    drive: Drive
    gain: float = 1.0  # of light: 1 is that of the drive
    _qualities: dict[str, F32] = field(default_factory=dict)
    _in_light: dict[float, DrivePictures] = field(default_factory=dict)

    def in_light(self, gain: float) -> DrivePictures:
        """Return the same pictures as they would be with `gain` times the light."""
        if gain not in self._in_light:
            self._in_light[gain] = DrivePictures(self.drive, gain)
        return self if gain == self.gain else self._in_light[gain]

    @cached_property
    def known(self) -> tuple[tuple[Moment, int], ...]:
        """Every moment with a truth in free space, and the reference nearest to it."""
        library, nearest = self.drive.bench.library, self.drive.bench.nearest
        pairs = (
            (moment, -1 if moment.truth is None else true_entry(nearest, library, moment.truth))
            for moment in self.drive.session.moments()
        )
        return tuple((moment, entry) for moment, entry in pairs if entry >= 0)

    @property
    def library(self) -> Library:
        """The references."""
        return self.drive.bench.library

    @cached_property
    def entries(self) -> I32:
        """The truth's reference of every picture (T,)."""
        return np.array([entry for _, entry in self.known], np.int32)

    @cached_property
    def images(self) -> list[U8]:
        """The pictures."""
        return [in_other_light(moment.frame.image, self.gain) for moment, _ in self.known]

    @property
    def usual(self) -> PicturePair:
        """The pair that stands for all: that in the middle of the drive, whatever it shows."""
        return PicturePair(self, len(self.known) // 2)

    @property
    def shifted(self) -> PicturePair:
        """The same pair, the picture taken in more light."""
        return self.in_light(MORE_LIGHT).usual

    @cached_property
    def brighter(self) -> F64:
        """How much brighter every picture is than the truth's reference (T,): gray levels, on the mean."""
        levels = [float(reference_picture(self.library, entry).mean()) for entry in self.entries]
        return np.array([float(image.mean()) for image in self.images]) - levels

    def quality(self, feature: str) -> F32:
        """Return the quality of every reference for every picture (T, L), by the thesis's distance."""
        if feature not in self._qualities:
            self._qualities[feature] = self.quality_of(feature, self.images)
        return self._qualities[feature]

    def quality_of(self, feature: str, images: Sequence[U8]) -> F32:
        """Return the quality of every reference for other pictures (T, L)."""
        sensor = self.drive.bench.localizer({"preset": THESIS, "feature": feature}).sensor
        return np.stack([sensor.compare(sensor.measure(image)).quality for image in images])

    def ranks(self, feature: str) -> F64:
        """Return the rank of the truth's reference among all, for every picture (T,); 1 is the best."""
        return ranks_of(self.quality(feature), self.entries)


def ranks_of(quality: F32, entries: I32) -> F64:
    """Return the rank of one entry each (T,) by quality (T, L): 1 and how many are better."""
    own = np.take_along_axis(quality, entries[:, None].astype(np.intp), axis=1)
    return np.asarray(1 + (quality > own).sum(axis=1), np.float64)


@dataclass(frozen=True)
class PicturePair:
    """A picture of a drive and the truth's reference."""

    pictures: DrivePictures
    number: int  # of the picture among those at known places

    @property
    def sample(self) -> U8:
        """The picture that the robot took."""
        return self.pictures.images[self.number]

    @property
    def step(self) -> int:
        """The number of its update."""
        return self.pictures.known[self.number][0].frame.step

    @property
    def truth(self) -> F64:
        """Where it was taken (3,)."""
        truth = self.pictures.known[self.number][0].truth
        assert truth is not None  # as `known` has none without
        return truth

    @property
    def entry(self) -> int:
        """The number of the reference that is nearest to the truth."""
        return int(self.pictures.entries[self.number])

    @property
    def pose(self) -> F64:
        """Where the reference was taken (3,)."""
        return np.asarray(self.pictures.library.poses[self.entry], np.float64)

    @property
    def reference(self) -> U8:
        """The reference's picture."""
        return reference_picture(self.pictures.library, self.entry)

    def described(self, channel: str) -> tuple[F32, F32]:
        """Return what a channel measures in the picture and in its reference, (D,) each."""
        index = self.pictures.library.index[channel]
        return CHANNELS[channel].describe(self.sample), index.references[self.entry]

    def differences(self, channel: str) -> F32:
        """Return what every bin adds to the thesis's sum (D,): its distance is their mean."""
        return contributions(THESIS, *self.described(channel), self.pictures.library.index[channel])


def reference_picture(library: Library, entry: int) -> U8:
    """Return the picture (H, W, 3) of a reference of a simulated survey, which keeps them all."""
    path = library.pictures[entry]
    found = None if path is None else read_picture(path)
    if found is None:
        raise InputError(path, f"holds no picture of entry {entry}, expected a survey with its pictures")
    return found


def rooms_of(library: Library) -> list[tuple[str, Bool]]:
    """Return each room and which references (L,) are in it; all of them where the map has no rooms."""
    places = library.poses[:, :2]
    flags = [(room.name, inside(room.polygon, places)) for room in library.arena.rooms]
    return flags or [("references", np.ones(len(places), bool))]


def in_other_light(image: U8, gain: float) -> U8:
    """Return a picture as the simulated camera would take it with `gain` times the light."""
    if gain == 1:
        return image
    sensor = Sensor()
    black = np.array(sensor.black)
    signal = (image - black) * gain**sensor.gamma
    return np.asarray(np.clip(np.rint(signal + black), sensor.lowest, sensor.highest), np.uint8)


def with_noise(image: U8, sd: float) -> U8:
    """Return a picture with Gaussian noise of so many gray levels added to each value."""
    if not sd:
        return image
    return np.asarray(np.clip(np.rint(image + sd * _noise(image.shape)), 0, 255), np.uint8)


@cache
def _noise(shape: tuple[int, ...]) -> F64:
    """Return the same noise of sd 1 for every picture of a shape: drawing it would take most of the time."""
    return np.random.default_rng(SEED).standard_normal(shape)
