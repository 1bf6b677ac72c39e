"""The ways in which each kind of cause is planted. Each takes a world, a seed and a random generator."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from maurice_datasets.render.conditions import LightChange
from maurice_datasets.robot.motion import Chassis
from maurice_datasets.robot.planner import free_pose, raster
from maurice_datasets.trials.drives import RenderedSession
from maurice_datasets.worlds.world import clearance
from maurice_mcl.reasons.causes import (
    AMBIGUITY,
    DATA,
    KIDNAPPED,
    LEFT_MAP,
    LIBRARY_GAP,
    LIGHTING,
    MOTION,
    NUMERIC,
    PROPOSAL,
    RESAMPLING,
    SENSOR,
    VIEW,
)
from maurice_mcl.sensor.descriptors.registry import weights_of
from maurice_mcl.values.arrays import F64, U8
from maurice_mcl.values.library import Library

from .drives import (
    Picture,
    anywhere,
    drive,
    frozen,
    gap,
    odometry_changed,
    pictures_changed,
    plain_drive,
    started_at,
)
from .places import FEATURE, Ground, part_of, twin_of

HEALTHY = "healthy"
FILTER: Mapping[str, Any] = {"sensor.weights": weights_of(FEATURE), "particles": 1000}
SEARCHING: Mapping[str, Any] = {**FILTER, "particles": 3000}  # enough to find itself without a known start
STARTS, STAYS = 60, 16  # wrong starts tried; updates for which their way shall stay on the map
CAUTIOUS: Mapping[str, Any] = {  # a motion model so wide that the pictures must keep the robot on its way
    **Chassis().motion_header(),
    "turn_sd_rad": float(np.radians(20)),
    "straight_sd_m": 0.1,
    "drift": {"": {"bias_rad_per_m": 0.0, "sd_rad_per_m": float(np.radians(20))}},
}
SEEING: Mapping[str, Any] = {**FILTER, "motion": CAUTIOUS}
COLOR: Mapping[str, Any] = {**SEEING, "sensor.weights": {"color": 1.0}}  # one that light and colors mislead
FAR_M = 1.5  # a wrong start is at least so far away
GAP_M = 1.6  # around the middle of a gap in the library
SINCE = (12, 18)  # updates between which a cause begins
LOOKS = 12  # updates after a cause within which a run must be lost
LASTING = 40  # the same for a cause that lasts


@dataclass(frozen=True, slots=True, eq=False)
class Planting:
    """A drive with a cause in it, and the filter that is to run over it."""

    way: str  # in a few words
    since: int  # first update at which it can do harm
    session: RenderedSession
    library: Library
    settings: Mapping[str, Any] = field(default_factory=lambda: dict(FILTER))
    late: int = LOOKS  # updates after `since` within which a loss is due to it
    usual: Mapping[str, Any] = field(default_factory=lambda: dict(FILTER))  # a filter that is fine without it


Way = Callable[[Ground, int, np.random.Generator], Planting]


def _since(rng: np.random.Generator) -> int:
    return int(rng.integers(*SINCE))


# Nothing planted that does harm.


def tracked(ground: Ground, seed: int, rng: np.random.Generator) -> Planting:
    """Nothing happens, and the start is known."""
    return Planting("start known", 1, plain_drive(ground, seed), ground.library)


def found(ground: Ground, seed: int, rng: np.random.Generator) -> Planting:
    """Nothing happens, and the start is not known."""
    return Planting("start not known", 1, anywhere(plain_drive(ground, seed)), ground.library, SEARCHING)


def a_little_dimmer(ground: Ground, seed: int, rng: np.random.Generator) -> Planting:
    """The light dims so little that it does no harm."""
    at = _since(rng)
    dim = (LightChange("dim", at, amount=0.85),)
    return Planting("the light dims a little", at, drive(ground, seed, lights=dim), ground.library)


def one_piece_moved(ground: Ground, seed: int, rng: np.random.Generator) -> Planting:
    """One piece of furniture was moved after the survey."""
    return Planting("one piece of furniture moved", 1, drive(ground, seed, moved=1), ground.library)


def short_gap(ground: Ground, seed: int, rng: np.random.Generator) -> Planting:
    """One update is missing."""
    at = _since(rng)
    return Planting("one picture missing", at, gap(plain_drive(ground, seed), at, 1), ground.library)


# What the camera sees.


def swapped_colors(ground: Ground, seed: int, rng: np.random.Generator) -> Planting:
    """The camera gives blue as red."""
    return _seen_so(ground, seed, rng, "the camera gives blue as red", lambda image: image[..., ::-1])


def colors_turned(ground: Ground, seed: int, rng: np.random.Generator) -> Planting:
    """The camera gives red as green, green as blue and blue as red."""
    return _seen_so(ground, seed, rng, "the camera's colors are turned", lambda image: image[..., [2, 0, 1]])


def one_color_dead(ground: Ground, seed: int, rng: np.random.Generator) -> Planting:
    """One color of the camera is dead."""
    dead = int(rng.integers(3))
    way = f"color {['red', 'green', 'blue'][dead]} is dead"
    return _seen_so(ground, seed, rng, way, lambda image: _without(image, dead))


def _seen_so(ground: Ground, seed: int, rng: np.random.Generator, way: str, change: Picture) -> Planting:
    """Change all pictures, of drives with a known start and of others."""
    session = pictures_changed(plain_drive(ground, seed), change)
    if rng.random() < 0.5:
        return Planting(way, 1, session, ground.library, COLOR, LASTING, COLOR)
    return Planting(way, 1, anywhere(session), ground.library, SEARCHING)


def _without(image: U8, color: int) -> U8:
    left = image.copy()
    left[..., color] = 0
    return left


def mixed_up_channel(ground: Ground, seed: int, rng: np.random.Generator) -> Planting:
    """One channel of the library holds what it measured elsewhere, and has the most weight."""
    name = str(rng.choice(list(weights_of(FEATURE))))
    index = dict(ground.library.index)
    order = rng.permutation(ground.library.size)
    index[name] = replace(index[name], references=index[name].references[order])
    weights = {**weights_of(FEATURE), name: 3.0}
    settings = {**SEEING, "sensor.weights": weights}
    library = replace(ground.library, index=index)
    session, way = plain_drive(ground, seed), f"channel {name} mixed up"
    return Planting(way, 1, session, library, settings, LASTING, SEEING)


def dimmed(ground: Ground, seed: int, rng: np.random.Generator) -> Planting:
    """The light falls at one update and stays low."""
    at, share = _since(rng), float(rng.uniform(0.03, 0.10))
    dim = (LightChange("dim", at, amount=share),)
    way = f"the light falls to {share:.0%}"
    return Planting(way, at, drive(ground, seed, lights=dim), ground.library, COLOR, LASTING, COLOR)


def lamps_off(ground: Ground, seed: int, rng: np.random.Generator) -> Planting:
    """All lamps go off; windows remain, where there are any."""
    at = _since(rng)
    lamps = [source for source in ground.world.sources if source.endswith("lamp")]
    off = tuple(LightChange("off", at, source=lamp) for lamp in lamps)
    return Planting(
        "all lamps go off", at, drive(ground, seed, lights=off), ground.library, COLOR, LASTING, COLOR
    )


def something_ahead(ground: Ground, seed: int, rng: np.random.Generator) -> Planting:
    """A bag or a box rides along in front of the camera and hides most of what it saw."""
    at, color = _since(rng), rng.integers(20, 200, 3)
    left, grain = float(rng.uniform(0, 0.2)), rng.normal(0, 8, (144, 176, 1))

    def covered(image: U8) -> U8:
        rows, columns = image.shape[:2]
        now = image.astype(np.float64)
        first, last = int(left * columns), int((left + 0.8) * columns)
        now[rows // 12 :, first:last] = (color + grain[:rows, :columns])[rows // 12 :, first:last]
        return np.asarray(np.clip(now, 0, 255), np.uint8)

    session = pictures_changed(plain_drive(ground, seed), covered, at)
    return Planting("something hides most of the view", at, session, ground.library, COLOR, LASTING, COLOR)


# How the robot moves, and what its odometry tells.


def carried_away(ground: Ground, seed: int, rng: np.random.Generator) -> Planting:
    """The robot is carried to another place."""
    at = _since(rng)
    session = drive(ground, seed, task="kidnapped", kidnap_at=at - 1)
    return Planting("carried away", at, RenderedSession(session.info, session.all_moments), ground.library)


def spinning_wheels(ground: Ground, seed: int, rng: np.random.Generator) -> Planting:
    """The wheels spin for some updates."""
    at = _since(rng)
    session = drive(ground, seed, slip_at=range(at, at + 6))
    return Planting("the wheels spin", at, session, ground.library, late=18)


def skidded(ground: Ground, seed: int, rng: np.random.Generator) -> Planting:
    """The robot is turned around, unseen by its odometry."""
    at, turn = _since(rng), float(rng.choice([-1, 1]) * np.radians(rng.uniform(60, 140)))

    def unseen(motions: F64) -> F64:
        motions[0, 2] -= turn  # the robot turned by so much more than its wheels say
        return motions

    session = odometry_changed(plain_drive(ground, seed), unseen, range(at, at + 1))
    return Planting("skids around", at, session, ground.library)


def encoder_stuck(ground: Ground, seed: int, rng: np.random.Generator) -> Planting:
    """Turns are read much too large for some updates."""
    at = _since(rng)

    def more(motions: F64) -> F64:
        motions[:, 2] *= 2.5
        return motions

    session = odometry_changed(plain_drive(ground, seed), more, range(at, at + 8))
    return Planting("turns are read 2.5 times too large", at, session, ground.library)


def off_the_map(ground: Ground, seed: int, rng: np.random.Generator) -> Planting:
    """Movements are read so long that they lead off the map, for some updates."""
    at, count = _since(rng), int(rng.integers(7, 11))
    way_m = float(rng.uniform(8, 20)) + max(ground.library.arena.size_m)

    def far(motions: F64) -> F64:
        motions[-1, 0] += way_m
        return motions

    session = odometry_changed(plain_drive(ground, seed), far, range(at, at + count))
    return Planting("movements far too long", at, session, ground.library, SEEING, LOOKS, SEEING)


def begun_outside(ground: Ground, seed: int, rng: np.random.Generator) -> Planting:
    """The header names a start off the map."""
    drive, angle = plain_drive(ground, seed), float(rng.uniform(-np.pi, np.pi))
    out_m = float(np.hypot(*ground.library.arena.size_m)) + 2
    start = _start(drive) + np.array([out_m * np.cos(angle), out_m * np.sin(angle), 0.0])
    return Planting("the start is off the map", 1, started_at(drive, start), ground.library)


def _start(drive: RenderedSession) -> F64:
    if drive.info.start is None:
        raise ValueError("expected a drive with a known start")
    return drive.info.start


# The library.


def region_left_out(ground: Ground, seed: int, rng: np.random.Generator) -> Planting:
    """The survey leaves out what is around a place that the drive comes to."""
    drive, at = plain_drive(ground, seed), _since(rng)
    truths = np.array([moment.truth for moment in drive.all_moments])
    places, middle = ground.library.poses[:, :2], truths[at + 3, :2]
    kept = np.linalg.norm(places - middle, axis=1) > GAP_M
    inside = np.linalg.norm(truths[:, :2] - middle, axis=1) < GAP_M
    since = int(np.argmax(inside)) + 1
    return Planting(
        "a region is not surveyed", since, drive, part_of(ground.library, kept), SEEING, LASTING, SEEING
    )


# The filter.


def looking_alike(ground: Ground, seed: int, rng: np.random.Generator) -> Planting:
    """The map has two halves that look the same; the start is not known."""
    session = anywhere(plain_drive(ground, seed))
    return Planting("two halves look the same", 1, session, twin_of(ground.library), SEARCHING)


def wrong_start(ground: Ground, seed: int, rng: np.random.Generator) -> Planting:
    """The header names a start far from the true one."""
    drive, map_ = plain_drive(ground, seed), raster(ground.world.arena)
    if map_ is None:
        raise ValueError("expected a world with room to drive in")
    truths = np.array([moment.truth for moment in drive.all_moments[:STAYS]])
    starts = [free_pose(map_, rng, _start(drive), FAR_M) for _ in range(STARTS)]
    start = max(starts, key=lambda one: _stays(ground, _start(drive), one, truths))
    return Planting("the start is wrong", 1, started_at(drive, start), ground.library)


def _stays(ground: Ground, start: F64, wrong: F64, truths: F64) -> int:
    """Return for how many updates the way that was driven stays on the map from a wrong start."""
    turn = wrong[2] - start[2]
    cos, sin = np.cos(turn), np.sin(turn)
    ways = (truths[:, :2] - start[:2]) @ np.array([[cos, sin], [-sin, cos]]) + wrong[:2]
    free = clearance(ground.world.arena, ways) > 0.05
    x_min, y_min, x_max, y_max = ground.world.arena.bounds
    free &= (ways > (x_min, y_min)).all(axis=1) & (ways < (x_max, y_max)).all(axis=1)
    return len(free) if free.all() else int(np.argmin(free))


def too_few(ground: Ground, seed: int, rng: np.random.Generator) -> Planting:
    """Far too few particles for a start that is not known."""
    settings = {**FILTER, "particles": int(rng.integers(6, 16))}
    session = anywhere(plain_drive(ground, seed))
    return Planting("too few particles everywhere", 1, session, ground.library, settings)


def dropped_by_chance(ground: Ground, seed: int, rng: np.random.Generator) -> Planting:
    """Few particles, a flat likelihood and multinomial resampling: the good ones may go by bad luck."""
    settings = {
        **FILTER,
        "particles": int(rng.integers(60, 160)),
        "sensor.sharpness": 0.25,
        "sensor.widening": 1.0,
        "resampling.scheme": "multinomial",
    }
    session = anywhere(plain_drive(ground, seed))
    return Planting("few particles, resampled by chance", 1, session, ground.library, settings)


def absurdly_sharp(ground: Ground, seed: int, rng: np.random.Generator) -> Planting:
    """A likelihood so sharp that all weights but one are zero."""
    settings = {
        **SEARCHING,
        "sensor.sharpness": 10_000.0,
        "sensor.widening": 1.0,
        "particles": int(rng.integers(50, 150)),
    }
    session = anywhere(plain_drive(ground, seed))
    return Planting("a likelihood far too sharp", 1, session, ground.library, settings)


def not_a_number(ground: Ground, seed: int, rng: np.random.Generator) -> Planting:
    """One channel of the library holds what is not a number."""
    name = str(rng.choice(list(weights_of(FEATURE))))
    index = dict(ground.library.index)
    index[name] = replace(index[name], references=np.full_like(index[name].references, np.nan))
    library = replace(ground.library, index=index)
    return Planting(f"channel {name} is not a number", 1, plain_drive(ground, seed), library, late=LASTING)


# The recording.


def log_with_a_gap(ground: Ground, seed: int, rng: np.random.Generator) -> Planting:
    """The log lacks some updates, pictures and odometry alike."""
    at, count = _since(rng), int(rng.integers(6, 11))
    return Planting("the log has a gap", at, gap(plain_drive(ground, seed), at, count), ground.library)


def stuck_camera(ground: Ground, seed: int, rng: np.random.Generator) -> Planting:
    """The camera gives the same picture again and again."""
    at, count = _since(rng), int(rng.integers(10, 16))
    session = frozen(plain_drive(ground, seed), at, count)
    return Planting("the camera repeats one picture", at, session, ground.library, SEEING, 16, SEEING)


WAYS: Mapping[str, tuple[Way, ...]] = {
    HEALTHY: (tracked, found, tracked, a_little_dimmer, one_piece_moved, found, short_gap),
    SENSOR: (swapped_colors, mixed_up_channel, colors_turned, one_color_dead),
    AMBIGUITY: (looking_alike,),
    PROPOSAL: (wrong_start, too_few),
    RESAMPLING: (dropped_by_chance,),
    MOTION: (spinning_wheels, skidded, encoder_stuck),
    LIBRARY_GAP: (region_left_out,),
    LIGHTING: (dimmed, lamps_off),
    VIEW: (something_ahead,),
    KIDNAPPED: (carried_away,),
    LEFT_MAP: (off_the_map, begun_outside),
    NUMERIC: (absurdly_sharp, not_a_number),
    DATA: (log_with_a_gap, stuck_camera),
}
