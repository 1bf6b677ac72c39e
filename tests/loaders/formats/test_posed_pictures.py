"""7-Scenes, ScanNet, COLMAP and nerfstudio: one walk of a camera, as each has it, is one drive."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from helpers.dialect_files import image, write
from helpers.recordings import read, truths
from maurice_loaders.errors import InputError, ReadingNotes
from maurice_loaders.formats.registry import guess, open_recording
from maurice_loaders.reading.options import Reading
from maurice_loaders.reading.recording import Picture, TruthPose
from maurice_mcl.values import F64

WALK = np.array(
    [[0.1 * k, 0.02 * k * k, 0.1 * k] for k in range(12)]
)  # x, y and heading; eleven, so that 10 is after 9


def camera(pose: F64, world: F64) -> F64:
    """The matrix (4, 4) of a level camera (x right, y down, z forward) in a world that is turned."""
    x, y, heading = pose
    cos, sin = math.cos(heading), math.sin(heading)
    matrix = np.eye(4)
    matrix[:3, :3] = np.array([[sin, 0, cos], [-cos, 0, sin], [0, -1, 0]])
    matrix[:3, 3] = x, y, 0.3
    return world @ matrix


def world(roll: float) -> F64:
    turned = np.eye(4)
    cos, sin = math.cos(roll), math.sin(roll)
    turned[:3, :3] = [[1, 0, 0], [0, cos, -sin], [0, sin, cos]]
    return turned


def quaternion(turned: F64) -> F64:
    w = math.sqrt(max(1 + np.trace(turned), 0)) / 2
    x, y, z = (turned[2, 1] - turned[1, 2]), (turned[0, 2] - turned[2, 0]), (turned[1, 0] - turned[0, 1])
    return np.array([w, x / (4 * w), y / (4 * w), z / (4 * w)])


def seven_scenes(folder: Path, matrices: list[F64]) -> Path:
    for k, matrix in enumerate(matrices):
        image(folder / f"frame-{k:06d}.color.png")
        write(folder / f"frame-{k:06d}.pose.txt", "\n".join("\t ".join(map(str, row)) for row in matrix))
    return folder


def scannet(folder: Path, matrices: list[F64]) -> Path:
    for k, matrix in enumerate(matrices):
        image(folder / "color" / f"{k}.png")
        write(folder / "pose" / f"{k}.txt", "\n".join(" ".join(map(str, row)) for row in matrix))
    return folder


def colmap(folder: Path, matrices: list[F64]) -> Path:
    lines = ["# Image list with two lines of data per image:"]
    for k, matrix in reversed(list(enumerate(matrices))):
        image(folder / "images" / f"a {k}.png")
        back = matrix[:3, :3].T
        values = [*quaternion(back), *(-back @ matrix[:3, 3])]
        lines += [
            f"{k + 1} {' '.join(map(str, values))} 1 a {k}.png",
            "1.5 2.5 -1 3.5 4.5 7 5.5 6.5 8 7.5 8.5 9",
        ]
    write(folder / "sparse" / "0" / "images.txt", *lines)
    return folder


def nerfstudio(folder: Path, matrices: list[F64]) -> Path:
    frames = []
    for k, matrix in enumerate(matrices):
        image(folder / "images" / f"{k:04d}.png")
        turned = matrix @ np.diag([1.0, -1.0, -1.0, 1.0])
        frames.append({"file_path": f"./images/{k:04d}", "transform_matrix": turned.tolist()})
    write(folder / "transforms.json", json.dumps({"fl_x": 100.0, "w": 200, "frames": frames}))
    return folder


WRITERS = {"seven-scenes": seven_scenes, "scannet": scannet, "colmap": colmap, "transforms": nerfstudio}


@pytest.mark.parametrize("roll", [0.0, 0.5, math.pi / 2])
@pytest.mark.parametrize("kind", WRITERS)
def test_one_walk_of_a_camera_is_one_drive(kind: str, roll: float, tmp_path: Path) -> None:
    folder = WRITERS[kind](tmp_path / "walk", [camera(pose, world(roll)) for pose in WALK])
    assert guess(folder).name == {"scannet": "seven-scenes"}.get(kind, kind)
    found = truths(folder)
    moved, walked = (np.diff(poses[:, :2], axis=0) for poses in (found, WALK))
    np.testing.assert_allclose(np.hypot(*moved.T), np.hypot(*walked.T), atol=1e-6)
    np.testing.assert_allclose(np.diff(np.unwrap(found[:, 2])), np.diff(WALK[:, 2]), atol=1e-6)
    along = np.arctan2(*walked[3][::-1]) - WALK[3, 2]  # from where it looks to where it goes
    np.testing.assert_allclose(np.arctan2(*moved[3][::-1]) - found[3, 2], along, atol=1e-6)
    records, warnings = read(folder)
    pictures = [record for record in records if isinstance(record, Picture)]
    assert len(pictures) == len(WALK)
    assert pictures[10].read().shape[2] == 3
    assert "10" in pictures[10].name
    assert any("no times" in text for text in warnings)
    assert any("no scale" in text for text in warnings) == (kind == "colmap")


def test_a_pose_that_failed_leaves_its_picture(tmp_path: Path) -> None:
    folder = scannet(tmp_path, [camera(pose, np.eye(4)) for pose in WALK])
    write(folder / "pose" / "3.txt", "\n".join(["-inf -inf -inf -inf"] * 4))
    write(folder / "pose" / "4.txt", "1 2 3")
    notes = ReadingNotes(keep_going=True)
    records = list(open_recording(folder).records(notes))
    assert sum(isinstance(record, TruthPose) for record in records) == len(WALK) - 2
    assert sum(isinstance(record, Picture) for record in records) == len(WALK)
    assert "3.txt:1: found value '-inf'" in str(notes.problems[0])
    assert "4.txt: found 3 values, expected a matrix of 4 x 4" in str(notes.problems[1])


def test_pictures_outside_of_the_folder_are_refused(tmp_path: Path) -> None:
    image(tmp_path / "secret.png")
    matrix = camera(WALK[0], np.eye(4)).tolist()
    frames = {"frames": [{"file_path": "../secret.png", "transform_matrix": matrix}]}
    folder = write(tmp_path / "walk" / "transforms.json", json.dumps(frames)).parent
    with pytest.raises(InputError, match="is outside of the folder"):
        [record.read() for record in read(folder)[0] if isinstance(record, Picture)]


@pytest.mark.parametrize(
    ("content", "told"),
    [
        ("{", "cannot be read as nerfstudio's"),
        ("{}", "expected an object with frames"),
        ('{"frames": [3]}', "cannot be read as nerfstudio's"),
        ('{"frames": [{"file_path": 3}]}', "found file_path 3, expected a text"),
        ('{"frames": [{"file_path": "a", "transform_matrix": 3}]}', "a: found a row of transform_matrix 3"),
        (
            '{"frames": [{"file_path": "a", "transform_matrix": [[1, 0, 0, 0]]}]}',
            "expected a matrix of 4 x 4",
        ),
        ('{"w": "a", "fl_x": 3, "frames": []}', "cannot be read as nerfstudio's"),
        ('{"frames": ' + "[" * 3000, "cannot be read as nerfstudio's"),
    ],
)
def test_transforms_that_make_no_sense_are_one_line(content: str, told: str, tmp_path: Path) -> None:
    file = write(tmp_path / "transforms.json", content)
    with pytest.raises(InputError, match=told) as refused:
        read(file)
    assert "\n" not in str(refused.value)


def test_colmaps_binary_model_says_how_it_becomes_text(tmp_path: Path) -> None:
    write(tmp_path / "sparse" / "0" / "images.bin", b"\0")
    with pytest.raises(InputError, match="colmap model_converter --output_type TXT"):
        open_recording(tmp_path)


def test_a_plane_that_was_asked_for_is_taken(tmp_path: Path) -> None:
    folder = seven_scenes(tmp_path, [camera(pose, np.eye(4)) for pose in WALK])
    np.testing.assert_allclose(truths(folder, Reading(plane="xy"))[:, :2], WALK[:, :2], atol=1e-6)
