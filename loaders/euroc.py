"""EuRoC / ASL folders: one folder a sensor, each with a `data.csv` whose first line names the columns.

Layout: https://projects.asl.ethz.ch/datasets/doku.php?id=kmavvisualinertialdatasets.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from maurice_mcl.session import SessionInfo

from .errors import LogError
from .formats import Format, OpenOptions
from .picture_lists import PictureList
from .pose_files import Layout, PoseFile
from .recording import OdometryPose, TruthPose
from .text_rows import begin_lines
from .timed_folder import TimedFolder

TRUTHS = ("state_groundtruth_estimate0", "groundtruth", "gt", "vicon", "mocap", "leica")  # best first
ODOMETRY = ("odom",)
DEPTH, TABLE = 2, "data.csv"


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
    def layout(self) -> Layout | None:
        """Tell where position and quaternion stand; None where they are not there."""
        position = [_ending(self.columns, axis) for axis in "xyz"]
        after = (position[2] or 0) + 1
        rest = self.columns[after:]
        quaternion = [_ending(rest, axis) for axis in "wxyz"]
        if None in position or None in quaternion:
            return None
        x, y, z = (at for at in position if at is not None)
        w, qx, qy, qz = (after + at for at in quaternion if at is not None)
        return Layout(",", (x, y, z), (w, qx, qy, qz), header=0 if self._commented else 1)

    @property
    def _commented(self) -> bool:
        return begin_lines(self.file)[0].startswith("#")


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
    return TimedFolder(
        path,
        SessionInfo(path.resolve().name),
        None if camera is None else _pictures(camera, unit),
        None if odometry is None else _pose_file(odometry, OdometryPose, unit, options.odometry_offset_s),
        None if truth is None else _pose_file(truth, TruthPose, unit, options.truth_offset_s),
        _remarks(cameras, camera, sensors, {truth, odometry}),
    ).check()


def looks_euroc(path: Path) -> bool:
    """Tell an EuRoC folder by a data.csv with times below it."""
    return bool(_sensors(path)) if path.is_dir() else False


def _sensors(path: Path) -> list[_Sensor]:
    """Find what is in a folder, or in its `mav0`, by the first lines of the tables."""
    found = []
    patterns = ["/".join(["*"] * depth + [TABLE]) for depth in range(1, DEPTH + 1)]
    for file in sorted(file for pattern in patterns for file in path.glob(pattern)):
        lines = begin_lines(file)
        if lines and "time" in lines[0].lower() and "," in lines[0]:
            names = [name.strip().lstrip("#").strip() for name in lines[0].split(",")]
            columns = tuple(name.partition("[")[0].strip().lower() for name in names)
            unit = names[0].partition("[")[2].rstrip("]") or None
            found.append(_Sensor(file, columns, unit if unit in ("s", "ms", "us", "ns") else None))
    return found


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
    return PictureList(camera.file, camera.file.parent / "data", ",", 1, unit or camera.unit)


def _pose_file(
    sensor: _Sensor, kind: type[OdometryPose] | type[TruthPose], unit: str | None, offset_s: float
) -> PoseFile:
    return PoseFile(sensor.file, kind, sensor.layout or Layout(), unit or sensor.unit, offset_s)


def _ending(columns: Sequence[str], axis: str) -> int | None:
    """Find the first column of an axis: `x`, `p_RS_R_x`, `q_x`."""
    for at, name in enumerate(columns):
        if name == axis or name.endswith((f"_{axis}", f".{axis}", f"q{axis}", f"p{axis}")):
            return at
    return None


def _remarks(
    cameras: Sequence[_Sensor],
    camera: _Sensor | None,
    sensors: Sequence[_Sensor],
    used: set[_Sensor | None],
) -> tuple[str, ...]:
    """Say which camera is used, and which poses are not."""
    others = [one.name for one in cameras if one is not camera]
    said = []
    if others and camera is not None:
        said.append(f"camera {camera.name} is used, {', '.join(others)} is not; see --camera")
    poses = [one.name for one in sensors if one.layout and not one.has_pictures and one not in used]
    if poses:
        said.append(f"poses of {', '.join(poses)} are not used")
    return tuple(said)


FORMATS = (
    Format("euroc", "an EuRoC / ASL folder: a data.csv for each sensor, pictures", looks_euroc, open_euroc),
)
