"""TUM RGB-D folders (`rgb.txt`, `groundtruth.txt`), and trajectories in TUM's format by themselves.

Format: https://cvg.cit.tum.de/data/datasets/rgbd-dataset/file_formats: `timestamp tx ty tz qx qy qz qw`.
"""

from __future__ import annotations

from pathlib import Path

from maurice_mcl.values import SessionInfo

from ..errors import InputError
from ..reading.options import Reading
from ..reading.recording import OdometryPose, TruthPose
from ..reading.time_alignment import unit_in
from ._poses import COMMENTS, Layout, PictureList, TimedFolder, first_file, layout_of, pose_file
from ._tables import NAMES, begin_lines, is_number, names_columns, words_of
from .registry import pose_format

PICTURES = "rgb.txt"
PAIRED = ("associated.txt", "associations.txt", "associate.txt")  # time and picture twice: color and depth
TRUTH, ODOMETRY = ("groundtruth.txt", "groundtruth"), ("odometry.txt", "odom.txt")
COLOR = ("rgb", "color", "image")  # how the folders of pictures that are no depth are called


def open_tum(path: Path, options: Reading) -> TimedFolder:
    """Open a folder with rgb.txt or associated.txt. Raises InputError if both are missing."""
    listed = _listed(path)
    if listed is None:
        raise InputError(path, f"found no {PICTURES} in it, expected a TUM RGB-D folder")
    return TimedFolder(
        path,
        SessionInfo(path.resolve().name),
        PictureList(listed, path, _color_column(listed), options.time_unit, options.pictures_outside),
        pose_file(first_file(path, ODOMETRY), OdometryPose, options),
        pose_file(first_file(path, TRUTH), TruthPose, options),
    ).check()


def open_trajectory(path: Path, options: Reading) -> TimedFolder:
    """Open a trajectory by itself; its poses are the truth."""
    names = _names(path)
    layout = (layout_of(names) if names else None) or Layout()
    truth = pose_file(path, TruthPose, options, layout, unit_in(names[0]) if names else None)
    return TimedFolder(path, SessionInfo(path.stem), None, None, truth).check()


def looks_tum(path: Path) -> bool:
    """Recognize a TUM RGB-D folder by its rgb.txt or associated.txt."""
    return _listed(path) is not None


def looks_like_trajectory(path: Path) -> bool:
    """Recognize a trajectory by its first rows: eight numbers each, or more where columns are named.

    Seven are taken for poses that lack one, so that the error says so; NaN stands for a pose that failed.
    """
    if not path.is_file():
        return False
    names = _names(path)
    if names and not _is_poses(names):
        return False
    lines = [line for line in begin_lines(path) if line.strip() and not line.startswith(COMMENTS)]
    poses = [words_of(line) for line in lines if not names_columns(line)][:5]
    if names and layout_of(names):
        return bool(poses) and all(is_number(words[0]) for words in poses)
    return bool(poses) and all(
        len(words) in (7, 8) and all(is_number(word) or word.lower() == "nan" for word in words)
        for words in poses
    )


def _listed(path: Path) -> Path | None:
    if first_file(path, (PICTURES,)) is not None:
        return path / PICTURES
    paired = first_file(path, PAIRED)
    return paired if paired is not None and _color_column(paired) is not None else None


def _color_column(listed: Path) -> int | None:
    if listed.name == PICTURES:
        return None
    lines = [line for line in begin_lines(listed) if not line.startswith("#")]
    words = words_of(lines[0])[:4] if lines else []
    named = [at for at, word in enumerate(words) if at % 2 and not is_number(word)]
    return next((at for at in named if words[at].lower().startswith(COLOR)), named[0] if named else None)


def _names(path: Path) -> list[str]:
    first = next(iter(begin_lines(path)), "").lstrip("#%").strip()
    return words_of(first) if first and names_columns(first) and len(words_of(first)) > 7 else []


def _is_poses(names: list[str]) -> bool:
    others = [name for name in names if name.lower() in NAMES["image"] or name.lower().startswith("odom")]
    return not others and ("time" in names[0].lower() or names[0].lower() in NAMES["time"])


FORMATS = (
    pose_format("tum", "a TUM RGB-D folder: rgb.txt, groundtruth.txt, pictures", looks_tum, open_tum),
    pose_format(
        "tum-trajectory", "poses alone: t x y z qx qy qz qw a line", looks_like_trajectory, open_trajectory
    ),
)
