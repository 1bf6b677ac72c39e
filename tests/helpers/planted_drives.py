"""Short drives of a robot with a camera or a laser, in each of which one thing is wrong: quick to make."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from maurice_loaders.files.ros_maps import write_ros_map
from maurice_loaders.session_log.writer import SessionWriter
from maurice_mcl.sensor.laser.rays import cast
from maurice_mcl.values.arrays import F64, U8
from maurice_mcl.values.geometry import compose
from maurice_mcl.values.laser import FREE, OCCUPIED, UNKNOWN, LaserScan, OccupancyMap
from maurice_mcl.values.map import Arena, Region
from maurice_mcl.values.session import SessionInfo

UPDATES, AT = 28, 10  # of a drive; the one at which most things begin
WIDTH_M, DEPTH_M, SPACING_M, HEADINGS = 4.0, 3.0, 0.5, 8
START = np.array([2.0, 0.6, 0.0])
MOTION = np.array([0.15, 0.0, 0.15])  # a circle of a meter
CORNERS = np.array([[0, 0], [WIDTH_M, 0], [WIDTH_M, DEPTH_M], [0, DEPTH_M]])
ROOM = Arena(
    (0.0, 0.0, WIDTH_M, DEPTH_M),
    np.hstack([CORNERS, np.roll(CORNERS, -1, axis=0)]),
    floors=(Region("wood", CORNERS),),
)


def view(pose: F64, again_m: float = 2 * (WIDTH_M + DEPTH_M)) -> U8:
    """Return what a camera (30, 40, 3) sees of the room's walls, whose colors repeat along them."""
    angles = pose[2] + np.linspace(0.5, -0.5, 40)
    toward = np.stack([np.cos(angles), np.sin(angles)])
    side, here = (
        np.array([[WIDTH_M], [DEPTH_M]]),
        np.clip(pose[:2, None], 0.05, [[WIDTH_M - 0.05], [DEPTH_M - 0.05]]),
    )
    away_m = (np.where(toward > 0, side - here, -here) / toward).min(axis=0)
    x, y = here + away_m * toward
    on = [y < 1e-9, x > WIDTH_M - 1e-9, y > DEPTH_M - 1e-9]
    along_m = np.select(on, [x, WIDTH_M + y, 2 * WIDTH_M + DEPTH_M - x], 2 * (WIDTH_M + DEPTH_M) - y)
    turns = 2 * np.pi * along_m / again_m
    stripes = np.sign(np.sin(7 * turns))
    colors = [130 + 90 * np.sin(turns), 120 + 60 * stripes * np.cos(2 * turns), 110 + 80 * np.cos(turns + 1)]
    height = np.abs(np.arange(30) - 14.5)[:, None] * away_m
    return np.where(height[..., None] < 18, np.stack(colors, axis=-1), 70.0).astype(np.uint8)


def view_of_twins(pose: F64) -> U8:
    """See a room that looks the same from the other side, turned by half a turn about its middle."""
    return view(pose, WIDTH_M + DEPTH_M)


@dataclass(frozen=True, eq=False)
class Step:
    """What the log holds of one update."""

    number: int  # from 1
    t_s: float
    motion: F64  # (3,) as odometry tells
    pose: F64  # (3,) true
    image: U8 | None = None
    scan: LaserScan | None = None
    events: tuple[str, ...] = ()


Steps = list[Step]


def everywhere(pose: F64) -> bool:
    return True


Change = Callable[[Steps], Steps]


@dataclass(frozen=True, eq=False)
class Drive:
    """A drive, what is wrong in it, and the filter that is to run over it."""

    moved: Change = list  # how the robot moves, and what odometry tells of it
    sensed: Change = list  # what the camera or the laser gives
    start: F64 | None = field(default_factory=START.copy)  # as told; None: anywhere
    settings: Mapping[str, Any] = field(default_factory=dict)
    particles: int = 300
    seed: int = 0
    surveyed: Callable[[F64], bool] = everywhere  # whether the library has a picture from a pose (3,)
    view: Callable[[F64], U8] = view  # of the camera
    map: Callable[[OccupancyMap], OccupancyMap] = lambda grid: grid  # of the laser

    @property
    def has_usual_library(self) -> bool:
        """Whether its library is that of a healthy drive."""
        return (self.surveyed, self.view) == (everywhere, view)

    @property
    def filter(self) -> dict[str, Any]:
        """Arguments of `replay`."""
        return {"particles": self.particles, "seed": self.seed, "settings": dict(self.settings)}


# How the robot moves, and what its odometry tells.


def at(steps: range, **changes: Callable[[Any], Any]) -> Change:
    """Change fields of some updates."""

    def changed(drive: Steps) -> Steps:
        fields = ({name: change(getattr(one, name)) for name, change in changes.items()} for one in drive)
        return [
            replace(one, **new) if one.number in steps else one
            for one, new in zip(drive, fields, strict=True)
        ]

    return changed


def moving(steps: range, times: Sequence[float]) -> Change:
    """Move at some updates so many `times` as far ahead, aside and around as odometry tells."""

    def changed(drive: Steps) -> Steps:
        pose, moved = START, Steps()
        for one in drive:
            pose = compose(pose, MOTION * (times if one.number in steps else 1.0))
            moved.append(replace(one, pose=pose))
        return moved

    return changed


def carried(event: str = "") -> Change:
    """Carry the robot to another place."""

    def changed(drive: Steps) -> Steps:
        pose, moved = AWAY, drive[: AT - 1]
        for one in drive[AT - 1 :]:
            told = (event,) if event and one.number == AT else ()
            moved, pose = [*moved, replace(one, pose=pose, events=told)], compose(pose, MOTION)
        return moved

    return changed


AWAY = np.array([0.6, 2.4, 2.0])
ONCE, EVER, SINCE = range(AT, AT + 1), range(UPDATES + 1), range(AT, UPDATES + 1)

# What the camera gives.


def covered(image: U8) -> U8:
    """Hide most of a view."""
    image = image.copy()
    image[3:, 2:36] = (150, 40, 120)
    return image


def frozen(drive: Steps) -> Steps:
    still = drive[AT - 2].image
    return [replace(one, image=still) if AT <= one.number < AT + 14 else one for one in drive]


# odometry that reads too much, and a filter that allows it: the sensor must keep the robot on its way
READS = at(EVER, motion=lambda motion: motion * 1.6)
LOOSE: Mapping[str, Any] = {
    "motion": {
        "model": "odometry",
        "turn_from_turn": 0.6,
        "turn_from_way": 0.6,
        "way_from_way": 0.6,
        "way_from_turn": 0.6,
    }
}
FLAT = {"sensor.sharpness": 0.25, "sensor.widening": 1.0, "resampling.scheme": "multinomial"}
SHARP = {"sensor.sharpness": 1e4, "sensor.widening": 1.0}
COLOR = {"sensor.weights": {"color": 1.0}}

MOVES: Mapping[str, Drive] = {  # of a camera and of a laser
    "healthy": Drive(),
    "searching": Drive(start=None, particles=2000),
    "gap in the log": Drive(lambda drive: drive[: AT - 1] + drive[AT + 8 :]),
    "odometry jumps": Drive(at(ONCE, motion=lambda motion: np.add(motion, (1.6, 0, 0))), seed=3),
    "carried": Drive(carried()),
    "kidnapped": Drive(carried("kidnapped")),
    "wheels slip": Drive(moving(range(AT, AT + 8), (0.0, 0.0, 0.2))),
    "wrong start": Drive(start=AWAY),
}
CAMERA: Mapping[str, Drive] = {
    **MOVES,
    "repeated picture": Drive(READS, frozen, settings=LOOSE),
    "off the map": Drive(at(SINCE, motion=lambda motion: np.add(motion, (8, 0, 0)))),
    "tilted": Drive(
        lambda drive: at(ONCE, events=lambda told: ("tilted 22 deg out of the plane",))(
            moving(range(AT, AT + 10), (0.2, 1, 1))(drive)
        )
    ),
    "weights vanish": Drive(start=None, settings=SHARP, particles=80),
    "no reference": Drive(READS, settings=LOOSE, surveyed=lambda pose: bool(pose[0] + pose[1] < 3.6)),
    "dark": Drive(READS, at(SINCE, image=lambda image: (image * 0.1).astype(np.uint8)), settings=LOOSE),
    "view covered": Drive(READS, at(SINCE, image=covered), settings=LOOSE, seed=1),
    "colors swapped": Drive(
        READS, at(EVER, image=lambda image: image[..., ::-1]), settings={**LOOSE, **COLOR}
    ),
    "twin places": Drive(start=None, view=view_of_twins),
    "chance": Drive(start=None, settings=FLAT, particles=60, seed=18),
}

# What the laser gives.

CELL_M, BEAMS, REACH_M = 0.05, 90, 6.0
BOXES = ((0.3, 2.2, 0.8, 2.7), (3.2, 0.3, 3.7, 0.5), (3.4, 2.0, 3.6, 2.9), (1.9, 1.5, 2.1, 1.7))


def room_map() -> OccupancyMap:
    cells = np.full((round(DEPTH_M / CELL_M) + 4, round(WIDTH_M / CELL_M) + 4), OCCUPIED, np.uint8)
    cells[2:-2, 2:-2] = FREE
    for box in BOXES:
        x, y, to_x, to_y = (round(side / CELL_M) + 2 for side in box)
        cells[y:to_y, x:to_x] = OCCUPIED
    return OccupancyMap(cells, CELL_M, np.full(2, -2 * CELL_M))


def scan_at(grid: OccupancyMap, pose: F64) -> LaserScan:
    step = 2 * np.pi / BEAMS
    angles = -np.pi + step * np.arange(BEAMS)
    return LaserScan(cast(grid, pose, angles, REACH_M)[0], -np.pi, step, 0.05, REACH_M)


def near(scan: LaserScan) -> LaserScan:
    """Put people around the laser."""
    hidden = np.arange(BEAMS) % 10 < 7
    return replace(scan, ranges_m=np.where(hidden, np.minimum(scan.ranges_m, 0.6), scan.ranges_m))


def through(scan: LaserScan) -> LaserScan:
    """Look through walls of glass."""
    return replace(
        scan, ranges_m=np.where(np.arange(BEAMS) % 3 > 0, scan.ranges_m + np.float32(1.5), scan.ranges_m)
    )


def turned(scan: LaserScan) -> LaserScan:
    return replace(scan, start_rad=scan.start_rad + np.pi / 2)


def other(grid: OccupancyMap) -> OccupancyMap:
    return replace(grid, cells=np.ascontiguousarray(np.roll(grid.cells[::-1], (17, 31), (0, 1))))


def part(grid: OccupancyMap) -> OccupancyMap:
    cells = grid.cells.copy()
    cells[30:] = UNKNOWN
    return replace(grid, cells=cells)


def halves(grid: OccupancyMap) -> OccupancyMap:
    return replace(grid, cells=np.ascontiguousarray(np.concatenate([grid.cells, grid.cells], axis=1)))


# few beams and particles: a run that is lost then does not hang on the last bit of a number
FEW: Mapping[str, Any] = {**LOOSE, "sensor.laser.max_beams": 10}
PROB = {"sensor.laser.model": "likelihood_field_prob"}
LASER: Mapping[str, Drive] = {
    **{name: MOVES[name] for name in ("healthy", "odometry jumps", "carried", "wrong start")},
    "wheels slip": Drive(moving(range(AT, AT + 6), (1, 0, -4)), settings=PROB),
    "people": Drive(READS, at(SINCE, scan=near), settings=FEW, particles=60, seed=3),
    "glass": Drive(READS, at(EVER, scan=through), settings=FEW, particles=60, seed=2),
    "laser turned": Drive(READS, at(EVER, scan=turned), settings=FEW, particles=60, seed=3),
    "wrong map": Drive(READS, map=other, settings=FEW, particles=60, seed=3),
    "part of a map": Drive(READS, map=part, settings=FEW, particles=60, seed=2),
    "twin places": Drive(start=None, map=halves, particles=4000, settings=PROB, seed=1),
    "few particles": Drive(start=None, particles=20, settings=PROB),
    "flat": Drive(READS, settings=FEW, particles=60, seed=3),
    "range cut": Drive(READS, settings={**LOOSE, "sensor.laser.laser_max_range": 0.4}),
}

# As files.


def _driven(drive: Drive, sense: Callable[[F64], Mapping[str, Any]]) -> Steps:
    steps = moving(range(0), ())([Step(k, 2.0 * k, 1.04 * MOTION, START) for k in range(1, UPDATES + 1)])
    return drive.sensed([replace(one, **sense(one.pose)) for one in drive.moved(steps)])


def _write(path: Path, info: SessionInfo, drive: Steps, *, truth: bool) -> Path:
    with SessionWriter(path, info) as log:
        for one in drive:
            log.odometry(one.t_s - 1, one.motion)
            for text in one.events:
                log.event(one.t_s - 0.5, text)
            if truth:
                log.truth(one.t_s, one.pose)
            if one.image is not None:
                log.image(one.t_s, one.image)
            if one.scan is not None:
                log.scan(one.t_s, one.scan)
    return path


def write_survey(folder: Path, drive: Drive) -> Path:
    """Write what the library of a drive is made from."""
    survey = folder / "survey.log"
    xs, ys = (np.arange(SPACING_M / 2, side, SPACING_M) for side in (WIDTH_M, DEPTH_M))
    poses = [np.array([x, y, k * 2 * np.pi / HEADINGS]) for y in ys for x in xs for k in range(HEADINGS)]
    with SessionWriter(survey, SessionInfo("room", "m", arena=ROOM), "survey") as log:
        log.image(0.0, np.full((30, 40, 3), 18, np.uint8), covered=True)
        for t, pose in enumerate(filter(drive.surveyed, poses), start=1):
            log.image(float(t), drive.view(pose), pose=pose)
    return survey


def write_camera(folder: Path, drive: Drive, library: Path, *, truth: bool = True) -> Path:
    """Write a drive into a folder, whose header names a library."""
    info = SessionInfo("planted drive", "m", start=drive.start, survey=library, arena=ROOM)
    steps = _driven(drive, lambda pose: {"image": drive.view(pose)})
    return _write(folder / "drive.log", info, steps, truth=truth)


def write_laser(folder: Path, drive: Drive, *, truth: bool = True) -> tuple[Path, Path]:
    """Write a drive and its map into a folder; return both."""
    grid = room_map()
    write_ros_map(drive.map(grid), folder / "map.yaml")
    steps = _driven(drive, lambda pose: {"scan": scan_at(grid, pose)})
    info = SessionInfo("planted drive", "m", start=drive.start)
    return _write(folder / "drive.log", info, steps, truth=truth), folder / "map.yaml"
