"""OpenLORIS-Scene folders: `color.txt`, `odom.txt`, `groundtruth.txt`, `sensors.yaml`, `trans_matrix.yaml`.

Layout: https://lifelong-robotic-vision.github.io/dataset/scene. The YAML files are OpenCV's.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import cv2

from maurice_mcl.values import Camera, SessionInfo

from ..errors import InputError
from ..reading.options import Reading
from ..reading.recording import OdometryPose, TruthPose, camera_named
from ._poses import PictureList, TimedFolder, first_file, pose_file
from ._tables import begin_lines
from .registry import pose_format

NAMES = ("color", "fisheye1", "fisheye2", "infra1", "infra2")
PICTURES = (*(f"{name}.txt" for name in NAMES), "d400_color.txt", "t265_fisheye1.txt", "t265_fisheye2.txt")
TRUTH = ("groundtruth.txt", "groundtruth")
OTHERS = ("odom.txt", "groundtruth.txt", "sensors.yaml", "trans_matrix.yaml")
SENSORS = {
    "color": "d400_color_optical_frame",
    "fisheye1": "t265_fisheye1_optical_frame",
    "fisheye2": "t265_fisheye2_optical_frame",
}


def open_openloris(path: Path, options: Reading) -> TimedFolder:
    """Open a folder; `options.camera` chooses among color, fisheye1 and so on. InputError if it is none."""
    listed = [path / name for name in PICTURES if (path / name).is_file()]
    if not listed:
        raise InputError(path, f"found no {PICTURES[0]} in it, expected an OpenLORIS folder")
    camera = camera_named(path, [file.stem for file in listed], options.camera)
    chosen = path / f"{camera}.txt"
    return TimedFolder(
        path,
        SessionInfo(path.resolve().name, cameras=_cameras(path, chosen.stem)),
        PictureList(chosen, path, unit=options.time_unit, outside=options.pictures_outside),
        pose_file(path / "odom.txt", OdometryPose, options),
        pose_file(first_file(path, TRUTH), TruthPose, options),
    ).check()


def looks_openloris(path: Path) -> bool:
    """Recognize an OpenLORIS folder by a list of pictures with something else of it beside."""
    listed = [path / name for name in PICTURES if (path / name).is_file()]
    return bool(listed and begin_lines(listed[0])) and any((path / name).is_file() for name in OTHERS)


def _cameras(path: Path, name: str) -> tuple[Camera, ...]:
    sensor = SENSORS.get(name.removeprefix("d400_").removeprefix("t265_"), name)
    try:
        described = _described(path / "sensors.yaml", name, sensor)
        return (replace(described, yaw_rad=_yaw(path / "trans_matrix.yaml", sensor)),)
    except (cv2.error, AttributeError, IndexError, ValueError, SystemError):
        return (Camera(name),)


def _described(file: Path, name: str, sensor: str) -> Camera:
    storage = cv2.FileStorage(str(file), cv2.FILE_STORAGE_READ) if file.is_file() else None
    node = None if storage is None else storage.getNode(sensor)
    if node is None or node.empty():
        return Camera(name)
    width, height = (int(node.getNode(key).real()) for key in ("width", "height"))
    focal_px = float(node.getNode("intrinsics").mat().ravel()[0])
    pinhole = node.getNode("model").string() == "pinhole" and focal_px > 0
    return Camera(name, width, height, 2 * math.atan2(width / 2, focal_px) if pinhole else None)


def _yaw(file: Path, sensor: str) -> float:
    storage = cv2.FileStorage(str(file), cv2.FILE_STORAGE_READ) if file.is_file() else None
    pairs = None if storage is None else storage.getNode("trans_matrix")
    for at in range(0 if pairs is None else pairs.size()):
        pair = pairs.at(at) if pairs is not None else None
        if pair is None:
            continue
        frames = tuple(pair.getNode(f"{which}_frame").string() for which in ("parent", "child"))
        if frames == ("base_link", sensor):
            matrix = pair.getNode("matrix").mat()
            return math.atan2(float(matrix[1, 2]), float(matrix[0, 2]))
    return 0.0


WHAT = "an OpenLORIS-Scene folder: color.txt, odom.txt, pictures"
FORMATS = (pose_format("openloris", WHAT, looks_openloris, open_openloris),)
