"""EuRoC / ASL folders: one folder a sensor, each with a `data.csv` whose first line names the columns.

Layout: https://projects.asl.ethz.ch/datasets/doku.php?id=kmavvisualinertialdatasets.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from maurice_mcl.session import Camera, SessionInfo

from .errors import LogError
from .euroc_camera import camera_of
from .formats import Format, OpenOptions
from .picture_files import PICTURES
from .picture_lists import PictureList
from .pose_files import Layout, PoseFile, layout_of
from .recording import OdometryPose, TruthPose
from .text_rows import begin_lines, words_of
from .time_bases import unit_in
from .timed_folder import TimedFolder

TRUTHS = ("state_groundtruth_estimate0", "groundtruth", "gt", "vicon", "mocap", "leica")  # best first
ODOMETRY = ("odom",)
DEPTH, TABLE, DESCRIBED = 2, "data.csv", "sensor.yaml"
ASIDE_RAD = math.radians(10)  # a camera that looks further off is worth a word
USUAL = ("timestamp", "p_x", "p_y", "p_z", "q_w", "q_x", "q_y", "q_z")  # of poses without a header


@dataclass(frozen=True, slots=True)
class _Sensor:
    """A data.csv by what its columns are."""

    file: Path
    columns: tuple[str, ...]  # without units
    unit: str | None  # of the times, as the header has it

    @property
    def name(self) -> str:
        return self.file.parent.name

    @property
    def has_pictures(self) -> bool:
        return len(self.columns) >= 2 and "filename" in self.columns[1]

    @property
    def has_places(self) -> bool:
        """Tell a tracker's positions, which come without a quaternion (EuRoC's leica0)."""
        return (
            self.layout is None
            and [name[-2:] for name in self.columns[1:4]] == ["_x", "_y", "_z"]
            and (self.name.startswith(TRUTHS))
        )

    @property
    def layout(self) -> Layout | None:
        """Tell where position and quaternion stand; None where they are not there."""
        return layout_of(self.columns)


def open_euroc(path: Path, options: OpenOptions) -> TimedFolder:
    """Open a folder; `options.camera` chooses a camera's. LogError where there is neither camera nor pose."""
    sensors = _sensors(path)
    cameras = [one for one in sensors if one.has_pictures]
    if not sensors:
        raise LogError(path, f"found no {TABLE} below it, expected an EuRoC / ASL folder")
    camera = _camera(path, cameras, options.camera)
    poses = [one for one in sensors if not one.has_pictures and one.layout]
    truth = _named(poses, TRUTHS)
    odometry = _named(poses, ODOMETRY)
    unit = options.time_unit
    went = None if odometry is None else _pose_file(odometry, OdometryPose, unit, options.odometry_offset_s)
    true = None if truth is None else _pose_file(truth, TruthPose, unit, options.truth_offset_s)
    described = (
        None if camera is None else camera_of(camera.file.with_name(DESCRIBED), camera.name, true or went)
    )
    return TimedFolder(
        path,
        SessionInfo(path.resolve().name, cameras=() if described is None else (described,)),
        None if camera is None else _pictures(camera, unit),
        went,
        true,
        (*_about(described, true or went), *_remarks(cameras, camera, sensors, {truth, odometry})),
    ).check()


def looks_euroc(path: Path) -> bool:
    """Tell an EuRoC folder by a data.csv with times below it."""
    return bool(_sensors(path)) if path.is_dir() else False


def _sensors(path: Path) -> list[_Sensor]:
    """Find what is in a folder, or in its `mav0`, by the first lines of the tables."""
    found = []
    patterns = ["/".join(["*"] * depth + [TABLE]) for depth in range(1, DEPTH + 1)]
    for file in sorted(file for pattern in patterns for file in path.glob(pattern)):
        names = _columns(file)
        if names:
            columns = tuple(name.partition("[")[0].strip().lower() for name in names)
            found.append(_Sensor(file, columns, unit_in(names[0])))
    return found


def _columns(file: Path) -> list[str]:
    """Give the names of a table's columns, the usual ones where it has no header; none for other tables."""
    first = next(iter(begin_lines(file)), "")
    words = words_of(first) if first else [""]
    if "time" in words[0].lower():
        return [name.lstrip("#").strip() for name in words] if len(words) > 1 else []
    if not words[0].isdecimal() or len(words) < 2:
        return []
    if words[1].lower().endswith(PICTURES):
        return ["timestamp", "filename"]
    return list(USUAL) if len(words) >= len(USUAL) and file.parent.name.startswith(TRUTHS) else []


def _camera(path: Path, cameras: Sequence[_Sensor], wanted: str | None) -> _Sensor | None:
    if wanted is None:
        return cameras[0] if cameras else None
    for one in cameras:
        if one.name == wanted:
            return one
    names = ", ".join(one.name for one in cameras) or "no camera"
    raise LogError(path, f"found {names}, expected {wanted!r} among them")


def _named(sensors: Sequence[_Sensor], words: Sequence[str]) -> _Sensor | None:
    for word in words:
        for one in sensors:
            if word in one.name.lower():
                return one
    return None


def _pictures(camera: _Sensor, unit: str | None) -> PictureList:
    return PictureList(camera.file, camera.file.parent / "data", 1, unit or camera.unit)


def _pose_file(
    sensor: _Sensor, kind: type[OdometryPose] | type[TruthPose], unit: str | None, offset_s: float
) -> PoseFile:
    return PoseFile(sensor.file, kind, sensor.layout or Layout(), unit or sensor.unit, offset_s)


def _about(camera: Camera | None, poses: PoseFile | None) -> list[str]:
    """Say which way is forward on a body whose z is not up, and of a camera that looks elsewhere."""
    said = []
    if poses is not None and poses.body[0][2]:
        said.append(f"{poses.file}: on this body x or y is up, so that headings are those of its z axis")
    if camera is not None and abs(camera.yaw_rad) > ASIDE_RAD:
        degrees = math.degrees(camera.yaw_rad)
        where = f"camera {camera.name} looks {degrees:+.0f} degrees off the forward axis of the poses"
        said.append(f"{where} ({DESCRIBED}); with another robot's library see `library build --yaw`")
    return said


def _remarks(
    cameras: Sequence[_Sensor],
    camera: _Sensor | None,
    sensors: Sequence[_Sensor],
    used: set[_Sensor | None],
) -> tuple[str, ...]:
    """Say which camera is used, which poses are not, and what holds no poses."""
    others = [one.name for one in cameras if one is not camera]
    said = []
    if others and camera is not None:
        said.append(f"camera {camera.name} is used, {', '.join(others)} is not; see --camera")
    poses = [one.name for one in sensors if one.layout and not one.has_pictures and one not in used]
    if poses:
        said.append(f"poses of {', '.join(poses)} are not used")
    places = [one.name for one in sensors if one.has_places]
    if places:
        said.append(f"{', '.join(places)} holds positions without orientation, which make no poses")
    return tuple(said)


FORMATS = (
    Format(
        "euroc",
        "an EuRoC / ASL folder: a data.csv for each sensor, pictures",
        looks_euroc,
        open_euroc,
        shifts=True,
    ),
)
