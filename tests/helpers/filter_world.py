"""A small two-room world for the tests of the filter: a library, pictures and a drive with its truth."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from maurice_mcl.sensor.descriptors.registry import CHANNELS
from maurice_mcl.values.geometry import compose
from maurice_mcl.values.library import ChannelIndex, Library
from maurice_mcl.values.map import Arena, Region
from maurice_mcl.values.session import Frame, Moment, SessionInfo

WIDTH_M, DEPTH_M, PITCH_M, DOOR_M = 4.0, 3.0, 0.5, 2.0
MAURICE = {"model": "maurice", "drift": {"": {"sd_rad_per_m": 0.02}, "carpet": {"bias_rad_per_m": -0.05}}}


def _arena(at_m: tuple[float, float]) -> Arena:
    x, y = at_m
    wall = np.array([[x + 2.0, y, x + 2.0, y + DOOR_M]])
    floor = np.array([[2.0, 0.0], [4.0, 0.0], [4.0, 3.0], [2.0, 3.0]]) + at_m
    box = np.array([[0.6, 0.6], [0.9, 0.6], [0.9, 0.9], [0.6, 0.9]]) + at_m
    bounds = (x, y, x + WIDTH_M, y + DEPTH_M)
    return Arena(bounds, wall, (Region("box", box),), (Region("carpet", floor),))


def _poses(at_m: tuple[float, float]) -> np.ndarray:
    columns, rows = np.meshgrid(np.arange(0.25, WIDTH_M, PITCH_M), np.arange(0.25, DEPTH_M, PITCH_M))
    places = np.column_stack([columns.ravel(), rows.ravel()]) + at_m
    headings = np.arange(8) * np.pi / 4 - np.pi
    return np.column_stack([np.repeat(places, 8, axis=0), np.tile(headings, len(places))])


def _index(rng: np.random.Generator, entries: int, name: str) -> ChannelIndex:
    size = len(CHANNELS[name].describe(np.zeros((24, 32, 3), np.uint8)))
    references = rng.gamma(0.6, 6.0, (entries, size)).astype(np.float32)
    return ChannelIndex(references, np.full(size, 0.5, np.float32), references.max(axis=0))


@dataclass(frozen=True)
class FilterDrive:
    """A session in memory."""

    info: SessionInfo
    all_moments: tuple[Moment, ...]

    def moments(self) -> Iterator[Moment]:
        yield from self.all_moments


@dataclass(frozen=True)
class World:
    """A library and a drive through the same arena, its corner at `at_m`."""

    library: Library
    drive: FilterDrive
    start: np.ndarray


def make_world(at_m: tuple[float, float] = (0.0, 0.0), updates: int = 8, motion: object = None) -> World:
    """Build the world; everything but where it lies is the same on every call."""
    rng = np.random.default_rng(4)
    arena, poses = _arena(at_m), _poses(at_m)
    index = {name: _index(rng, len(poses), name) for name in CHANNELS}
    library = Library("two rooms", poses, (None,) * len(poses), index, arena)
    start = np.array([1.2 + at_m[0], 1.6 + at_m[1], 0.3])
    rng = np.random.default_rng(4)  # of its own: the same drive however many channels there are
    truth, moments = start, []
    for step in range(1, updates + 1):
        motions = np.array([[0.0, 0.0, rng.uniform(-0.8, 0.8)], [rng.uniform(0.1, 0.25), 0.0, 0.0]])
        for movement in motions:
            truth = compose(truth, movement)
        image = rng.integers(0, 256, (24, 32, 3), dtype=np.uint8)
        frame = Frame(step, float(step), motions, image, f"{step}.jpg")
        moments.append(Moment(frame, truth, ("door",) if step == 3 else ()))
    info = SessionInfo("drive", motion=MAURICE if motion is None else motion, start=start, arena=arena)
    return World(library, FilterDrive(info, tuple(moments)), start)
