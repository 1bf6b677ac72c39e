"""EuRoC / ASL folders: one folder per sensor, each with a `data.csv` whose first line names the columns.

Layout: https://projects.asl.ethz.ch/datasets/doku.php?id=kmavvisualinertialdatasets.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from maurice_mcl.values import F64, Camera, SessionInfo

from ..errors import InputError
from ..files.text import PICTURES
from ..reading.options import Reading
from ..reading.recording import OdometryPose, TruthPose, camera_named
from ..reading.time_alignment import unit_in
from ._poses import Layout, PictureList, PoseFile, TimedFolder, layout_of, pose_file
from ._tables import begin_lines, begin_of, words_of
from .registry import pose_format

# What an EuRoC camera's `sensor.yaml` says: size, angle of view, and where the camera looks on the body.

_LISTS = re.compile(r"^\s*(T_BS|data|resolution|intrinsics)\s*:\s*(?:\[([^\]]*)\])?", re.MULTILINE)
MOST_BYTES = 2**16  # a description has one or two thousand


def camera_of(file: Path, name: str, poses: PoseFile | None) -> Camera:
    """Return the camera that a file describes, with its yaw if the poses of the body are known.

    The YAML has `resolution: [w, h]`, `intrinsics: [fu, fv, cu, cv]` in pixels, and `T_BS` (4, 4), from the
    camera's frame (z along its optical axis) to the body's.
    """
    lists = _lists(begin_of(file, MOST_BYTES).decode(errors="replace"))
    size, inner, turned = (lists.get(key, []) for key in ("resolution", "intrinsics", "T_BS"))
    width, height = (int(v) for v in size) if len(size) == 2 and min(size) >= 1 else (None, None)
    wide = width is not None and len(inner) == 4 and inner[0] > 0
    fov = 2 * math.atan2(width / 2, inner[0]) if wide and width else None
    yaw = yaw_on_body(np.array(turned).reshape(4, 4), poses) if len(turned) == 16 and poses else 0.0
    return Camera(name, width, height, fov, yaw)


def yaw_on_body(camera_to_body: F64, poses: PoseFile) -> float:
    """Return where a camera looks, counter-clockwise from the forward axis of the poses."""
    forward, up = poses.body
    looks = camera_to_body[:3, 2]
    return math.atan2(float(looks @ np.cross(up, forward)), float(looks @ forward))


def _lists(text: str) -> dict[str, list[float]]:
    """Find the lists of numbers by their names; the first `data` after T_BS is its."""
    lists: dict[str, list[float]] = {}
    inside = ""
    for name, values in _LISTS.findall(text):
        if name == "T_BS":
            inside = name
        key = inside if name == "data" else name
        try:
            numbers = [float(word) for word in values.replace("\n", " ").split(",") if word.strip()]
        except ValueError:
            continue
        if numbers and np.isfinite(numbers).all() and key:
            lists.setdefault(key, numbers)
    return lists


TRUTHS = ("state_groundtruth_estimate0", "groundtruth", "gt", "vicon", "mocap", "leica")  # best first
ODOMETRY = ("odom",)
DEPTH, TABLE, DESCRIBED = 2, "data.csv", "sensor.yaml"
ASIDE_RAD = math.radians(10)  # a camera that looks further off is worth a word
USUAL = ("timestamp", "p_x", "p_y", "p_z", "q_w", "q_x", "q_y", "q_z")  # of poses without a header


@dataclass(frozen=True, slots=True)
class _Sensor:
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
        """Recognize a tracker's positions, which come without a quaternion (EuRoC's leica0)."""
        return (
            self.layout is None
            and [name[-2:] for name in self.columns[1:4]] == ["_x", "_y", "_z"]
            and (self.name.startswith(TRUTHS))
        )

    @property
    def layout(self) -> Layout | None:
        return layout_of(self.columns)


def open_euroc(path: Path, options: Reading) -> TimedFolder:
    """Open a folder; `options.camera` chooses a camera's. InputError if there is neither camera nor pose."""
    sensors = _sensors(path)
    cameras = [sensor for sensor in sensors if sensor.has_pictures]
    if not sensors:
        raise InputError(path, f"found no {TABLE} below it, expected an EuRoC / ASL folder")
    name = camera_named(path, [sensor.name for sensor in cameras], options.camera)
    camera = next((sensor for sensor in cameras if sensor.name == name), None)
    poses = [sensor for sensor in sensors if not sensor.has_pictures and sensor.layout]
    truth = _named(poses, TRUTHS)
    odometry = _named(poses, ODOMETRY)
    went, true = _poses(odometry, OdometryPose, options), _poses(truth, TruthPose, options)
    described = (
        None if camera is None else camera_of(camera.file.with_name(DESCRIBED), camera.name, true or went)
    )
    return TimedFolder(
        path,
        SessionInfo(path.resolve().name, cameras=() if described is None else (described,)),
        None if camera is None else _pictures(camera, options),
        went,
        true,
        (*_about(described, true or went), *_remarks(cameras, camera, sensors, {truth, odometry})),
    ).check()


def looks_euroc(path: Path) -> bool:
    """Recognize an EuRoC folder by a data.csv with times below it."""
    return bool(_sensors(path)) if path.is_dir() else False


def _sensors(path: Path) -> list[_Sensor]:
    """Find what is in a folder, or in its `mav0`, by the first lines of the tables."""
    sensors = []
    patterns = ["/".join(["*"] * depth + [TABLE]) for depth in range(1, DEPTH + 1)]
    for file in sorted(file for pattern in patterns for file in path.glob(pattern)):
        names = _columns(file)
        if names:
            columns = tuple(name.partition("[")[0].strip().lower() for name in names)
            sensors.append(_Sensor(file, columns, unit_in(names[0])))
    return sensors


def _columns(file: Path) -> list[str]:
    first = next(iter(begin_lines(file)), "")
    words = words_of(first) if first else [""]
    if "time" in words[0].lower():
        return [name.lstrip("#").strip() for name in words] if len(words) > 1 else []
    if not words[0].isdecimal() or len(words) < 2:
        return []
    if words[1].lower().endswith(PICTURES):
        return ["timestamp", "filename"]
    return list(USUAL) if len(words) >= len(USUAL) and file.parent.name.startswith(TRUTHS) else []


def _named(sensors: Sequence[_Sensor], words: Sequence[str]) -> _Sensor | None:
    for word in words:
        for sensor in sensors:
            if word in sensor.name.lower():
                return sensor
    return None


def _pictures(camera: _Sensor, options: Reading) -> PictureList:
    unit = options.time_unit or camera.unit
    return PictureList(camera.file, camera.file.parent / "data", 1, unit, options.pictures_outside)


def _poses(
    sensor: _Sensor | None, kind: type[OdometryPose] | type[TruthPose], options: Reading
) -> PoseFile | None:
    if sensor is None:
        return None
    return pose_file(sensor.file, kind, options, sensor.layout or Layout(), sensor.unit)


def _about(camera: Camera | None, poses: PoseFile | None) -> list[str]:
    remarks = []
    if poses is not None and poses.body[0][2]:
        remarks.append(f"{poses.file}: on this body x or y is up, so that headings are those of its z axis")
    if camera is not None and abs(camera.yaw_rad) > ASIDE_RAD:
        degrees = math.degrees(camera.yaw_rad)
        where = f"camera {camera.name} looks {degrees:+.0f} degrees off the forward axis of the poses"
        remarks.append(f"{where} ({DESCRIBED}); with another robot's library see `library build --yaw`")
    return remarks


def _remarks(
    cameras: Sequence[_Sensor], camera: _Sensor | None, sensors: Sequence[_Sensor], used: set[_Sensor | None]
) -> tuple[str, ...]:
    others = [sensor.name for sensor in cameras if sensor is not camera]
    remarks = []
    if others and camera is not None:
        remarks.append(
            f"camera {camera.name} is used, {', '.join(others)} is not; --reading camera=... chooses"
        )
    poses = [
        sensor.name for sensor in sensors if sensor.layout and not sensor.has_pictures and sensor not in used
    ]
    if poses:
        remarks.append(f"poses of {', '.join(poses)} are not used")
    places = [sensor.name for sensor in sensors if sensor.has_places]
    if places:
        remarks.append(f"{', '.join(places)} holds positions without orientation, which make no poses")
    return tuple(remarks)


FORMATS = (
    pose_format(
        "euroc", "an EuRoC / ASL folder: a data.csv for each sensor, pictures", looks_euroc, open_euroc
    ),
)
