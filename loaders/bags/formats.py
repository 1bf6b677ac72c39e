"""The formats of ROS and Foxglove: ROS 1 and ROS 2 bags, and MCAP."""

from __future__ import annotations

from pathlib import Path

from ..formats.registry import Format
from ..reading import ReadingOptions
from ..recording import Recording
from .mcap import is_mcap, open_mcap
from .recording import BagRecording
from .ros1 import open_ros1
from .ros2 import COMPRESSED, is_bag_folder, open_ros2
from .source import OpenBag, starts_with

ROS1_MAGIC = b"#ROSBAG V"  # of any version
SQLITE_MAGIC = b"SQLite format 3\0"
BAGS: dict[str, OpenBag] = {"rosbag1": open_ros1, "rosbag2": open_ros2, "mcap": open_mcap}


def _opening(name: str) -> Format:
    def open_one(path: Path, options: ReadingOptions) -> Recording:
        return BagRecording(path, BAGS[name], options)

    return Format(name, WHAT[name], LOOKS[name], open_one, "ros", shifts=True)


def looks_like_rosbag1(path: Path) -> bool:
    """Return whether a file begins as ROS 1 bags do, or is named like one."""
    return starts_with(path, ROS1_MAGIC) or (path.suffix == ".bag" and path.is_file())


def looks_like_rosbag2(path: Path) -> bool:
    """Return whether a folder is a ROS 2 bag, or a file is its database."""
    if path.is_dir():
        return is_bag_folder(path)
    return path.name.endswith((".db3", *COMPRESSED)) or starts_with(path, SQLITE_MAGIC)


def looks_like_mcap(path: Path) -> bool:
    """Return whether a file begins as MCAP does, or is named like it."""
    return is_mcap(path) or (path.suffix == ".mcap" and path.is_file())


WHAT = {
    "rosbag1": "ROS 1 bag: .bag, chunks plain, bz2 or lz4",
    "rosbag2": "ROS 2 bag: a folder with metadata.yaml, or one .db3",
    "mcap": "MCAP with ROS 2, ROS 1, JSON or protobuf messages, as ROS 2 and Foxglove write it",
}
LOOKS = {"rosbag1": looks_like_rosbag1, "rosbag2": looks_like_rosbag2, "mcap": looks_like_mcap}
FORMATS = tuple(_opening(name) for name in BAGS)
