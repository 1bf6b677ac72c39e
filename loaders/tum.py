"""TUM RGB-D folders (`rgb.txt`, `groundtruth.txt`), and trajectories in TUM's format by themselves.

Format: https://cvg.cit.tum.de/data/datasets/rgbd-dataset/file_formats: `timestamp tx ty tz qx qy qz qw`.
"""

from __future__ import annotations

from pathlib import Path

from maurice_mcl.session import SessionInfo

from .errors import LogError
from .formats import Format, OpenOptions
from .picture_lists import PictureList
from .pose_files import PoseFile, pose_file
from .recording import OdometryPose, TruthPose
from .text_rows import begin_lines
from .timed_folder import TimedFolder

PICTURES, TRUTH, ODOMETRY = "rgb.txt", "groundtruth.txt", ("odometry.txt", "odom.txt")


def open_tum(path: Path, options: OpenOptions) -> TimedFolder:
    """Open a folder with rgb.txt. LogError where that is missing."""
    if not (path / PICTURES).is_file():
        raise LogError(path, f"found no {PICTURES} in it, expected a TUM RGB-D folder")
    odometry = next((path / name for name in ODOMETRY if (path / name).is_file()), None)
    unit = options.time_unit
    return TimedFolder(
        path,
        SessionInfo(path.resolve().name),
        PictureList(path / PICTURES, path, unit=unit),
        pose_file(odometry, OdometryPose, unit, options.odometry_offset_s),
        pose_file(path / TRUTH, TruthPose, unit, options.truth_offset_s),
    ).check()


def open_trajectory(path: Path, options: OpenOptions) -> TimedFolder:
    """Open a trajectory by itself; its poses are the truth."""
    truth = PoseFile(path, TruthPose, unit=options.time_unit, offset_s=options.truth_offset_s)
    return TimedFolder(path, SessionInfo(path.stem), None, None, truth).check()


def looks_tum(path: Path) -> bool:
    """Tell a TUM RGB-D folder by its rgb.txt."""
    return (path / PICTURES).is_file()


def looks_like_trajectory(path: Path) -> bool:
    """Tell a trajectory by its first rows: eight numbers each, and nothing else."""
    if not path.is_file():
        return False
    found = [line.split() for line in begin_lines(path) if line.strip() and not line.startswith("#")][:5]
    return bool(found) and all(len(words) == 8 and all(map(_is_number, words)) for words in found)


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


FORMATS = (
    Format("tum", "a TUM RGB-D folder: rgb.txt, groundtruth.txt, pictures", looks_tum, open_tum),
    Format(
        "tum-trajectory", "poses alone: t x y z qx qy qz qw a line", looks_like_trajectory, open_trajectory
    ),
)
