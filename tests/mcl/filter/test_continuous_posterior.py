"""The whole filter against an exact answer in continuous space: 72 x 54 in, 4 x 3 places, 8 headings.

The belief is followed on a grid of 1.5 in and 4.5 degrees, whose borders lie on those of the library's cells,
and the grid is itself checked against plain samples without resampling. Compared are the masses of the 96
regions that have an entry each nearest. Motion model, tables and filter are the real ones.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import convolve1d
from scipy.signal import fftconvolve
from scipy.special import ndtr

from maurice_mcl.config.build import build_localizer
from maurice_mcl.config.parameters import FilterParameters, ReferenceParameters, ResamplingParameters
from maurice_mcl.sensor.descriptors.registry import CHANNELS
from maurice_mcl.sensor.model import SensorParameters
from maurice_mcl.values.geometry import INCH_M
from maurice_mcl.values.library import ChannelIndex, Library
from maurice_mcl.values.map import Arena
from maurice_mcl.values.session import Frame, SessionInfo

COLUMNS, ROWS, HEADINGS, PITCH = 4, 3, 8, 18.0  # inches throughout, but for poses
WIDTH, DEPTH = COLUMNS * PITCH, ROWS * PITCH
TURN_SD, WAY_SD = np.radians(8.0), 2.0
DRIVE = [(np.radians(turn), way) for turn, way in ((30, 6), (-50, 8), (90, 5), (20, 8), (-70, 6), (45, 7))]
CELL, TURN = 1.5, np.radians(4.5)
NX, NY, NH = int(WIDTH / CELL), int(DEPTH / CELL), 80
SAMPLES, CHUNK = 20_000_000, 1_000_000
MOTION = {
    "model": "maurice",
    "turn_gain": 1.0,
    "turn_bias_rad": 0.0,
    "turn_sd_rad": float(TURN_SD),
    "straight_bias_m": 0.0,
    "straight_sd_m": WAY_SD * INCH_M,
    "drift": {},
}


def _library():
    x, y = np.meshgrid((np.arange(COLUMNS) + 0.5) * PITCH, (np.arange(ROWS) + 0.5) * PITCH)
    xy = np.column_stack([x.ravel(), y.ravel()]) * INCH_M
    headings = np.arange(HEADINGS) * np.pi / 4 - np.pi
    poses = np.column_stack([np.repeat(xy, HEADINGS, axis=0), np.tile(headings, len(xy))])
    pictures = [_picture(share) for share in _shares(poses)]
    references = np.stack([CHANNELS["color"].describe(picture) for picture in pictures])
    index = ChannelIndex(references, np.zeros(84, np.float32), references.max(axis=0))
    arena = Arena((0.0, 0.0, WIDTH * INCH_M, DEPTH * INCH_M), np.zeros((0, 4)))
    return Library("small", poses, (None,) * len(poses), {"color": index}, arena)


def _shares(poses):
    """How bright the picture is that one sees from each pose (N, 3)."""
    x, y, heading = poses.T
    return 0.5 + 0.25 * np.cos(2 * x + heading) + 0.22 * np.sin(3 * y - 2 * heading)


def _picture(share):
    pixels = np.where(np.arange(48 * 40) < share * 48 * 40, 100, 200).astype(np.uint8)
    return np.repeat(pixels.reshape(48, 40, 1), 3, axis=2)


class _Drive:
    """What a localizer needs of a session."""

    info = SessionInfo("drive", motion=MOTION)


@pytest.fixture(scope="module")
def localizer():
    parameters = FilterParameters(
        sensor=SensorParameters({"color": 1.0}, 1.0, distances={"color": "l1"}, scales={"color": 5.0}),
        references=ReferenceParameters("nearest"),
        resampling=ResamplingParameters("systematic", "effective", below=0.6),
    )
    return build_localizer(_library(), _Drive(), parameters)


@pytest.fixture(scope="module")
def frames():
    rng, found = np.random.default_rng(5), []
    for step, (turn, way) in enumerate(DRIVE, start=1):
        motions = np.array([[0.0, 0.0, turn], [way * INCH_M, 0.0, 0.0]])
        found.append(Frame(step, float(step), motions, _picture(rng.uniform(0.2, 0.8)), ""))
    return found


@pytest.fixture(scope="module")
def likelihoods(localizer, frames):
    sensor = localizer.sensor
    compared = [sensor.compare(sensor.measure(frame.image)) for frame in frames]
    return np.exp([c.log_likelihood.astype(float) for c in compared])


def _turned(belief, turn):
    """Turn the belief (NY, NX, NH): what is even in a cell, turned by a normal angle, cell by cell."""
    reach = 40
    edges = np.arange(-reach - 1, reach + 2) * TURN

    def integral(angle):
        """Of the normal distribution function, of which a box smoothed by it is the second difference."""
        z = (angle - turn) / TURN_SD
        return (angle - turn) * ndtr(z) + TURN_SD * np.exp(-(z**2) / 2) / np.sqrt(2 * np.pi)

    kernel = np.diff(integral(edges), 2) / TURN
    wrapped = np.zeros(NH)
    np.add.at(wrapped, np.arange(-reach, reach + 1) % NH, kernel)
    assert wrapped.sum() == pytest.approx(1, abs=1e-9)
    return convolve1d(belief, np.roll(wrapped, NH // 2), axis=2, mode="wrap", origin=0)


def _moved(belief, way, rng):
    """Drive on: for each heading a kernel over cells, by many evenly spread starts and ways."""
    count, reach = 40_000, 14
    start = (np.arange(count)[:, None] * np.array([0.8191725134, 0.6710436067, 0.5497004779]) + 0.5) % 1
    length = way + WAY_SD * np.sort(rng.standard_normal(count))[rng.permutation(count)]
    moved = np.empty_like(belief)
    for k in range(NH):
        heading = (k + start[:, 2]) * TURN - np.pi
        column = np.floor(start[:, 0] + length * np.cos(heading) / CELL).astype(int) + reach
        row = np.floor(start[:, 1] + length * np.sin(heading) / CELL).astype(int) + reach
        side = 2 * reach + 1
        kernel = np.bincount(row * side + column, minlength=side * side).reshape(side, side) / count
        moved[..., k] = fftconvolve(belief[..., k], kernel, mode="full")[reach:-reach, reach:-reach]
    return np.maximum(moved, 0)


def _by_entry(columns, rows, turns, per_place, per_heading):
    """Give the entry of cells counted from the corner and from -180 degrees, so many of them an entry."""
    place = (rows // per_place) * COLUMNS + columns // per_place
    return place * HEADINGS + ((2 * turns + per_heading) // (2 * per_heading)) % HEADINGS


@pytest.fixture(scope="module")
def exact(likelihoods):
    """Give the masses (96,) after the last update, followed on the grid."""
    rng = np.random.default_rng(1)
    rows, columns, turns = np.indices((NY, NX, NH))
    # half cells, as the borders between headings lie amid 45 degrees: 80 / 8 cells each, shifted by five
    entry = _by_entry(columns, rows, turns, int(PITCH / CELL), NH // HEADINGS)
    belief = np.full((NY, NX, NH), 1 / (NX * NY * NH))
    for (turn, way), likelihood in zip(DRIVE, likelihoods, strict=True):
        belief = _moved(_turned(belief, turn), way, rng) * likelihood[entry]
        belief /= belief.sum()
    return np.bincount(entry.ravel(), belief.ravel(), 96)


def _sampled(likelihoods):
    """Give the same by plain weighted samples, without resampling, and their effective number."""
    masses, squares = np.zeros(96), 0.0
    rng = np.random.default_rng(2)
    for _ in range(SAMPLES // CHUNK):
        x, y, heading = rng.random((3, CHUNK), np.float32) * np.array(
            [[WIDTH], [DEPTH], [2 * np.pi]], np.float32
        )
        weight = np.ones(CHUNK, np.float32)
        for (turn, way), likelihood in zip(DRIVE, likelihoods.astype(np.float32), strict=True):
            heading = heading + (
                np.float32(turn) + np.float32(TURN_SD) * rng.standard_normal(len(x), np.float32)
            )
            length = np.float32(way) + np.float32(WAY_SD) * rng.standard_normal(len(x), np.float32)
            # headings here are counted from -180 degrees
            x, y = x - length * np.cos(heading), y - length * np.sin(heading)
            inside = (x > 0) & (x < WIDTH) & (y > 0) & (y < DEPTH)
            x, y, heading, weight = x[inside], y[inside], heading[inside], weight[inside]
            turns = np.floor(heading * np.float32(8 / np.pi)).astype(np.int32)
            entry = _by_entry((x / PITCH).astype(np.int32), (y / PITCH).astype(np.int32), turns, 1, 2)
            weight = weight * likelihood[entry]
        masses += np.bincount(entry, weight, 96)
        squares += float(np.square(weight).sum())
    return masses / masses.sum(), masses.sum() ** 2 / squares


def _apart(one, other):
    """Total variation of two distributions."""
    return 0.5 * np.abs(one - other).sum()


@pytest.mark.slow
def test_the_grid_is_a_fair_answer(exact, likelihoods):
    assert 20 < np.exp(-(exact * np.log(exact)).sum()) < 90
    assert (likelihoods.max(axis=1) / likelihoods.min(axis=1)).min() > 2
    sampled, effective = _sampled(likelihoods)
    assert effective > 1_000_000
    assert _apart(exact, sampled) <= 0.005


def _filtered(localizer, frames, n, seed):
    localizer = replace(localizer, particles=n, seed=seed)
    state = localizer.initialize(None)
    for frame in frames:
        state, record = localizer.step(state, frame)
    inside = record.sighting.entries >= 0
    return np.bincount(record.sighting.entries[inside], record.weighted.weights[inside], 96)


@pytest.mark.slow
def test_the_filter_nears_the_grid_with_the_root_of_the_number_of_particles(exact, localizer, frames):
    apart = {
        n: np.mean([_apart(exact, _filtered(localizer, frames, n, seed)) for seed in range(runs)])
        for n, runs in ((1000, 60), (4000, 40), (16_000, 20))
    }
    assert apart[16_000] <= 0.06
    assert apart[4000] / apart[1000] == pytest.approx(0.5, rel=0.15)
    assert apart[16_000] / apart[4000] == pytest.approx(0.5, rel=0.15)
