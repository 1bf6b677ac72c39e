"""What holds for every format of recordings, on a small drive that is written in each of them."""

from __future__ import annotations

import gc
import importlib.util
import json
import random
import shutil
import sys
import tracemalloc
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import ModuleType

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from maurice_loaders.errors import LogError
from maurice_loaders.findings import Findings
from maurice_loaders.formats import OpenOptions, formats, guess, open_recording, open_session
from maurice_loaders.recording import Motion, Note, OdometryPose, Picture, Record, TruthPose
from maurice_loaders.session_writer import SessionWriter
from maurice_mcl.session import SessionInfo
from maurice_mcl.typing import U8
from maurice_viz.cli import app

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


def bags() -> ModuleType | None:
    """What the tests of bags write them with; None where the extra is not installed."""
    if importlib.util.find_spec("rosbags") is None:
        return None
    file = Path(__file__).parents[1] / "bags" / "bag_making.py"
    spec = importlib.util.spec_from_file_location("bag_making_for_formats", file)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


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
    "kitti-poses": Sample(write_kitti_poses, pictures=False, truth=False),
    "carmen": Sample(write_carmen, pictures=False),
    "cmucam": Sample(write_dump, truth=False),
    "video": Sample(write_video, truth=False, long=200),
    "table": Sample(write_table),
    "pictures": Sample(write_pictures, truth=False, long=200),
}
every = pytest.mark.parametrize("name", SAMPLES)


def sample(name: str, folder: Path, updates: int = SMALL, *, truth: bool = True) -> Path:
    folder.mkdir(exist_ok=True)
    return SAMPLES[name].write(folder, updates, truth)


def records(path: Path) -> list[Record]:
    return list(open_recording(path).records(Findings(keep_going=False)))


def content(record: Record) -> object:
    """What two readings must agree in."""
    if isinstance(record, Picture):
        return record.t_s, record.name, record.read().tobytes()
    if isinstance(record, Note):
        return record
    values = record.motion if isinstance(record, Motion) else record.pose
    return type(record), record.t_s, values.tolist()


def use(path: Path, options: OpenOptions | None = None) -> int:
    """Do all that a replay does with a session, and count its updates."""
    session = open_session(path, options)
    session.overview()
    return sum(1 for _ in session.moments())


def test_every_format_has_a_sample() -> None:
    assert set(SAMPLES) == set(formats())


@every
def test_is_recognized_by_content_and_by_name_when_told(name: str, tmp_path: Path) -> None:
    path = sample(name, tmp_path / "made")
    assert guess(path).name == name
    assert open_recording(path, OpenOptions(format=name)).path == path
    if path.is_file() and name not in ("rosbag2", "mcap"):  # a wrong ending does not matter
        other = path.with_name("drive.xyz")
        shutil.copy(path, other)
        assert guess(other).name == name


@every
def test_can_be_read_again_from_its_beginning(name: str, tmp_path: Path) -> None:
    recording = open_recording(sample(name, tmp_path / "made"))
    first = recording.records(Findings(keep_going=False))
    next(first)  # a reading that was begun and left does no harm
    readings = [[content(r) for r in recording.records(Findings(keep_going=False))] for _ in range(2)]
    assert readings[0] == readings[1]
    assert readings[0]


@every
def test_times_do_not_fall_and_units_are_plausible(name: str, tmp_path: Path) -> None:
    found = records(sample(name, tmp_path / "made"))
    times = [record.t_s for record in found]
    assert times == sorted(times)
    assert 0.2 <= times[-1] - times[0] <= 10
    poses = np.array([r.pose for r in found if isinstance(r, OdometryPose | TruthPose)]).reshape(-1, 3)
    motions = np.array([r.motion for r in found if isinstance(r, Motion)]).reshape(-1, 3)
    assert (np.abs(poses) <= [5, 5, np.pi]).all()
    assert (np.abs(motions) <= [0.1, 0.1, 0.1]).all()


@every
def test_all_pictures_become_updates(name: str, tmp_path: Path) -> None:
    session = open_session(sample(name, tmp_path / "made"))
    moments = list(session.moments())
    assert len(moments) == (SMALL if SAMPLES[name].pictures else 0)
    assert session.overview() == (
        len(moments),
        any(m.truth is not None for m in moments) or not SAMPLES[name].pictures,
    )
    assert session.count_pictures() == len(moments)
    assert [m.frame.step for m in moments] == list(range(1, len(moments) + 1))
    assert all(m.frame.image.dtype == np.uint8 and m.frame.image.shape[2] == 3 for m in moments)
    assert session.problem_count == 0


@pytest.mark.parametrize("name", [name for name, one in SAMPLES.items() if one.truth and one.pictures])
def test_motion_and_truth_are_there_and_truth_is_none_when_absent(name: str, tmp_path: Path) -> None:
    known = list(open_session(sample(name, tmp_path / "with", truth=True)).moments())
    assert all(m.truth is not None for m in known)
    unknown = open_session(sample(name, tmp_path / "without", truth=False))
    assert [m.truth for m in unknown.moments()] == [None] * SMALL
    assert not unknown.overview()[1]
    if name != "kitti":  # which has no odometry
        moved = sum(float(m.frame.motions[:, 0].sum()) for m in known[1:])
        assert moved == pytest.approx(0.05 * (SMALL - 1), rel=1.1)


@every
def test_memory_does_not_grow_with_the_recording(name: str, tmp_path: Path) -> None:
    one = SAMPLES[name]
    peaks = []
    for updates in (one.long // 5, one.long):
        recording = open_recording(sample(name, tmp_path / str(updates), updates))
        for _ in recording.records(Findings(keep_going=False)):
            pass  # what is imported and kept on first use is not the recording's
        gc.collect()
        tracemalloc.start()
        count = sum(1 for _ in recording.records(Findings(keep_going=False)))
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        assert count >= updates
    assert peaks[1] < peaks[0] + one.growth


def damaged(data: bytes, chance: random.Random, trial: int) -> bytes:
    if trial % 3 == 0:
        return data[: chance.randrange(len(data))]
    changed = bytearray(data)
    for _ in range(chance.choice([1, 4, 40])):
        changed[chance.randrange(len(data))] ^= 1 << chance.randrange(8)
    return bytes(changed)


@every
def test_damage_is_one_line(name: str, tmp_path: Path) -> None:
    path = sample(name, tmp_path / "made")
    files = [path] if path.is_file() else sorted(one for one in path.rglob("*") if one.is_file())
    chance = random.Random(name)
    for file in files[:6]:
        data = file.read_bytes()
        for trial in range(12):
            file.write_bytes(damaged(data, chance, trial))
            for keep_going in (False, True):
                with suppress(LogError):  # which is one line; anything else fails
                    use(path, OpenOptions(keep_going=keep_going, format=name if trial % 2 else None))
        file.write_bytes(data)


@every
def test_an_empty_file_is_refused(name: str, tmp_path: Path) -> None:
    path = sample(name, tmp_path / "made")
    if not path.is_file():
        shutil.rmtree(path)
        path.mkdir()
    else:
        path.write_bytes(b"")
    for options in (OpenOptions(), OpenOptions(format=name)):
        with pytest.raises(LogError):
            use(path, options)


@every
def test_a_folder_or_a_file_of_another_kind_is_refused(name: str, tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    (tmp_path / "noise").write_bytes(random.Random(1).randbytes(3000))
    for path in (tmp_path / "folder", tmp_path / "noise", tmp_path / "nowhere"):
        with pytest.raises(LogError):
            use(path, OpenOptions(format=name))


@every
def test_the_command_line_tells_in_one_line_and_status_1(name: str, tmp_path: Path) -> None:
    path = sample(name, tmp_path / "made")
    shown = CliRunner().invoke(app, ["inspect", str(path), "--json"])
    assert shown.exit_code == 0, shown.output
    found = json.loads(shown.stdout)
    assert found["format"] == name
    assert found["records"]["image"] == (SMALL if SAMPLES[name].pictures else 0)
    noise = tmp_path / "noise"
    noise.write_bytes(random.Random(2).randbytes(3000))
    refused = CliRunner().invoke(app, ["inspect", str(noise), "--format", name])
    assert refused.exit_code == 1
    assert refused.stdout == ""
    assert refused.stderr.count("\n") == 1
