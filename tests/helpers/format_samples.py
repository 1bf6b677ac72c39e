"""The same small drive in every format that can be read, written on the spot."""

from __future__ import annotations

import importlib.util
import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import ModuleType

import cv2
import numpy as np
import pytest

from maurice_loaders.session_log.writer import SessionWriter
from maurice_mcl.values.arrays import U8
from maurice_mcl.values.session import SessionInfo

BEGIN_S = 1_700_000_000
SMALL = 4  # updates


def picture(number: int) -> U8:
    """A picture (12, 16, 3) RGB, another one for every number; no value is a CMUcam's marker."""
    return np.random.default_rng(number).integers(16, 240, (12, 16, 3), dtype=np.uint8)


def save(file: Path, number: int) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(file), picture(number)[..., ::-1])


def pose_row(number: int) -> str:
    half = 0.005 * number
    return f"{0.05 * number} 1.0 0.0 0.0 0.0 {np.sin(half)} {np.cos(half)}"


def write_native(folder: Path, updates: int, truth: bool) -> Path:
    with SessionWriter(folder / "session.log", SessionInfo("drive")) as log:
        for k in range(updates):
            log.odometry(k, (0.05, 0.0, 0.01))
            if truth:
                log.truth(k, (0.05 * k, 1.0, 0.01 * k))
            log.image(k, picture(k))
    return folder / "session.log"


def write_tum(
    folder: Path, updates: int, truth: bool, *, pictures: str = "rgb", odometry: str = "odometry"
) -> Path:
    lines = [f"{BEGIN_S + 0.1 * k:.4f} {pictures}/{k:06d}.png" for k in range(updates)]
    (folder / f"{pictures}.txt").write_text("# made\n" + "\n".join(lines))
    poses = "\n".join(f"{BEGIN_S + 0.1 * k:.4f} {pose_row(k)}" for k in range(updates))
    (folder / f"{odometry}.txt").write_text(poses)
    if truth:
        (folder / "groundtruth.txt").write_text(poses)
    for k in range(min(updates, SMALL)):
        save(folder / pictures / f"{k:06d}.png", k)
    return folder


def write_trajectory(folder: Path, updates: int, truth: bool) -> Path:
    lines = [f"{BEGIN_S + 0.1 * k:.4f} {pose_row(k)}" for k in range(updates)]
    (folder / "poses.txt").write_text("\n".join(lines))
    return folder / "poses.txt"


def write_euroc(folder: Path, updates: int, truth: bool) -> Path:
    stamps = [(BEGIN_S * 10 + k) * 10**8 for k in range(updates)]
    rows = {"cam0": "\n".join(f"{t},{t}.png" for t in stamps)}
    rows["odom0"] = "\n".join(f"{t},{','.join(pose_row(k).split())}" for k, t in enumerate(stamps))
    header = {"cam0": "#timestamp [ns],filename", "odom0": "timestamp [ns],x [m],y [m],z [m],x,y,z,w"}
    if truth:
        rows["groundtruth0"], header["groundtruth0"] = rows["odom0"], header["odom0"]
    for name, text in rows.items():
        (folder / "mav0" / name).mkdir(parents=True)
        (folder / "mav0" / name / "data.csv").write_text(f"{header[name]}\n{text}\n")
    for k in range(min(updates, SMALL)):
        save(folder / "mav0" / "cam0" / "data" / f"{stamps[k]}.png", k)
    return folder


def write_kitti(folder: Path, updates: int, truth: bool) -> Path:
    sequence = folder / "sequences" / "07"
    for k in range(min(updates, SMALL)):
        save(sequence / "image_2" / f"{k:06d}.png", k)
    (sequence / "times.txt").write_text("\n".join(f"{0.1 * k:e}" for k in range(updates)))
    if truth:
        (folder / "poses").mkdir()
        (folder / "poses" / "07.txt").write_text(kitti_rows(updates))
    return sequence


def kitti_rows(updates: int) -> str:
    return "\n".join(f"1 0 0 0 0 1 0 0 0 0 1 {0.05 * k}" for k in range(updates))


def level_camera(number: int) -> list[list[float]]:
    """The matrix (4, 4) of a camera that looks along x, in a world with z up."""
    return [[0, 0, 1, 0.05 * number], [-1, 0, 0, 1.0], [0, -1, 0, 0.3], [0, 0, 0, 1]]


def write_seven_scenes(folder: Path, updates: int, truth: bool) -> Path:
    for k in range(updates):
        text = "\n".join("\t ".join(f"{value:.6f}" for value in row) for row in level_camera(k))
        (folder / f"frame-{k:06d}.pose.txt").write_text(text)
    for k in range(min(updates, SMALL)):
        save(folder / f"frame-{k:06d}.color.png", k)
    return folder


def write_colmap(folder: Path, updates: int, truth: bool) -> Path:
    rows = [f"{k + 1} 0.5 0.5 -0.5 0.5 1.0 0.3 {-0.05 * k} 1 {k:06d}.png\n1 2 -1" for k in range(updates)]
    (folder / "sparse").mkdir()
    (folder / "sparse" / "images.txt").write_text("\n".join(["# images", *rows]))
    for k in range(min(updates, SMALL)):
        save(folder / "images" / f"{k:06d}.png", k)
    return folder


def write_transforms(folder: Path, updates: int, truth: bool) -> Path:
    axes = np.diag([1.0, -1.0, -1.0, 1.0])
    frames = [
        {"file_path": f"images/{k:06d}.png", "transform_matrix": (level_camera(k) @ axes).tolist()}
        for k in range(updates)
    ]
    (folder / "transforms.json").write_text(json.dumps({"frames": frames}))
    for k in range(min(updates, SMALL)):
        save(folder / "images" / f"{k:06d}.png", k)
    return folder


def write_kitti_poses(folder: Path, updates: int, truth: bool) -> Path:
    (folder / "07.txt").write_text(kitti_rows(updates))
    return folder / "07.txt"


def write_carmen(folder: Path, updates: int, truth: bool) -> Path:
    lines = ["# message formats defined: PARAM ODOM TRUEPOS", "PARAM robot_width 0.4 host 0"]
    for k in range(updates):
        t_s, pose = f"{0.1 * k:.2f}", f"{0.05 * k} 0 {0.01 * (k % 9)}"
        lines.append(f"ODOM {pose} 0.5 0 0 {t_s} host {t_s}")
        lines += [f"TRUEPOS {pose} {pose} {t_s} host {t_s}"] if truth else []
    (folder / "drive.log").write_text("\n".join(lines) + "\n")
    return folder / "drive.log"


def write_table(folder: Path, updates: int, truth: bool) -> Path:
    columns = "t_ms,image,odom_x_mm,odom_y_mm,odom_yaw_deg" + (",x_m,y_m,heading_deg" if truth else "")
    rows = [
        f"{100 * k},{k}.png,{50 * k},0,{k % 9}" + (f",{0.05 * k},1,{k % 9}" if truth else "")
        for k in range(updates)
    ]
    (folder / "drive.csv").write_text("\n".join([columns, *rows]))
    for k in range(min(updates, SMALL)):
        save(folder / f"{k}.png", k)
    return folder


def write_pictures(folder: Path, updates: int, truth: bool) -> Path:
    for k in range(updates):
        save(folder / f"view{k}.png", k)
    return folder


def write_video(folder: Path, updates: int, truth: bool) -> Path:
    file = folder / "drive.avi"
    video = cv2.VideoWriter(str(file), cv2.VideoWriter.fourcc(*"MJPG"), 10, (64, 48))
    for k in range(updates):
        video.write(cv2.resize(picture(k), (64, 48)))
    video.release()
    return file


def write_dump(folder: Path, updates: int, truth: bool) -> Path:
    frames = [
        b"\x01\x10\x0c" + b"".join(b"\x02" + row.tobytes() for row in picture(k)) + b"\x03"
        for k in range(updates)
    ]
    (folder / "frames.dump").write_bytes(b"ACK\r" + b":ACK\r".join(frames))
    return folder / "frames.dump"


def write_tub(folder: Path, updates: int, truth: bool, *, step_ms: int = 100) -> Path:
    head = [["cam/image_array", "user/angle"], ["image_array", "float"], {}, {"created_at": 1.0}]
    last = {"paths": ["catalog_0.catalog"], "current_index": updates, "deleted_indexes": [updates]}
    (folder / "manifest.json").write_text("".join(json.dumps(one) + "\n" for one in [*head, last]))
    rows = [
        {
            "_index": k,
            "_timestamp_ms": BEGIN_S * 1000 + step_ms * k,
            "cam/image_array": f"{k}_cam_image_array_.jpg",
            "user/angle": 0.1,
        }
        for k in range(updates + 1)  # the last one is deleted
    ]
    (folder / "catalog_0.catalog").write_text("".join(json.dumps(one) + "\n" for one in rows))
    for k in range(min(updates, SMALL)):
        save(folder / "images" / f"{k}_cam_image_array_.jpg", k)
    return folder


def bags() -> ModuleType | None:
    """What the tests of bags write them with; None where the extra is not installed."""
    if importlib.util.find_spec("rosbags") is None:
        return None
    from helpers import bags as making

    return making


def write_bag(kind: str, folder: Path, updates: int, truth: bool) -> Path:
    making = bags()
    if making is None:
        pytest.skip("the extra ros is not installed")
    said = making.drive(making.Ros(1 if kind == "rosbag1" else 2), updates)
    said = [one for one in said if truth or one.topic != "/ground_truth"]
    if kind == "rosbag1":
        return Path(making.write_ros1(folder / "drive.bag", said))
    storage = "mcap" if kind == "mcap" else "sqlite3"
    made = making.write_ros2(folder / "made", said, storage=storage)
    return Path(made) if kind == "rosbag2" else next(made.glob("*.mcap"))


@dataclass(frozen=True)
class Sample:
    """How a format is written, and what it can hold."""

    write: Callable[[Path, int, bool], Path]
    pictures: bool = True
    readings: bool = False  # whose rows become updates without pictures
    truth: bool = True  # can be had, and can be left out
    long: int = 1500  # updates of a recording that shows whether anything grows
    growth: int = 300_000  # bytes that a long one may take more than one a fifth as long


SAMPLES = {
    "session-log": Sample(write_native, long=300),
    "rosbag1": Sample(
        partial(write_bag, "rosbag1"), long=500, growth=2_500_000
    ),  # a chunk of 1 MB is held, packed and not
    "rosbag2": Sample(partial(write_bag, "rosbag2"), long=500, growth=2_500_000),
    "mcap": Sample(partial(write_bag, "mcap"), long=500, growth=2_500_000),
    "tum": Sample(write_tum),
    "tum-trajectory": Sample(write_trajectory, pictures=False, truth=False),
    "openloris": Sample(partial(write_tum, pictures="color", odometry="odom")),
    "euroc": Sample(write_euroc),
    "kitti": Sample(write_kitti),
    "seven-scenes": Sample(write_seven_scenes, truth=False, long=200),
    "colmap": Sample(write_colmap, truth=False, long=200),
    "transforms": Sample(write_transforms, truth=False, long=200),
    "kitti-poses": Sample(write_kitti_poses, pictures=False, truth=False),
    "carmen": Sample(write_carmen, pictures=False),
    "cmucam": Sample(write_dump, truth=False),
    "donkeycar": Sample(write_tub, truth=False),
    "video": Sample(write_video, truth=False, long=200),
    "table": Sample(write_table),
    "pictures": Sample(write_pictures, truth=False, long=200),
}


def sample(name: str, folder: Path, updates: int = SMALL, *, truth: bool = True) -> Path:
    folder.mkdir(exist_ok=True)
    return SAMPLES[name].write(folder, updates, truth)
