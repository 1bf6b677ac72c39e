"""Whether the print of a floor lies right, and how it is read: what is told when its folder is opened."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from maurice_loaders import InputError, open_library
from maurice_loaders.formats.odometry_folder import read_print
from maurice_mcl.arrays import U8
from maurice_mcl.geometry import compose

SIDES = (("left", 0.011), ("right", -0.011))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A drive of 2 m over a fine print of 0.6 m x 0.5 m, which is beside it."""
    made, rng = tmp_path_factory.mktemp("floor"), np.random.default_rng(5)
    light = cv2.GaussianBlur(rng.standard_normal((60, 50)), (0, 0), 1.5) > 0
    cv2.imwrite(str(made / "map.png"), light.astype(np.uint8) * 255)
    poses = [np.array([0.2, 0.2, 0.3])]
    for _ in range(220):
        ahead = compose(poses[-1], np.array([0.12, 0.0, 0.0]))
        inside = 0.05 < ahead[0] < 0.55 and 0.05 < ahead[1] < 0.45
        turn = rng.normal(0, 0.05) if inside else 0.25
        poses.append(compose(poses[-1], np.array([0.009 if inside else 0.0, 0.0, turn])))
    path = np.array(poses)
    cos, sin = np.cos(path[:, 2]), np.sin(path[:, 2])
    for name, y in SIDES:
        x_m, y_m = path[:, 0] + 0.072 * cos - y * sin, path[:, 1] + 0.072 * sin + y * cos
        cells = (x_m * 100).astype(int).clip(0, 59), (y_m * 100).astype(int).clip(0, 49)
        np.savetxt(
            made / f"sensor_{name}.txt", np.where(light[cells], 700, 120) + rng.normal(0, 30, len(path))
        )
    np.savetxt(made / "gt.txt", path)
    np.savetxt(made / "odom_pose.txt", path[:, :2])
    np.savetxt(
        made / "odom_quaternion.txt", np.column_stack([np.sin(path[:, 2] / 2), np.cos(path[:, 2] / 2)])
    )
    return made


def _copied(folder: Path, to: Path, spoil: Callable[[U8], U8]) -> Path:
    for file in folder.iterdir():
        (to / file.name).write_bytes(file.read_bytes())
    image = cv2.imread(str(folder / "map.png"), cv2.IMREAD_GRAYSCALE)
    cv2.imwrite(str(to / "map.png"), np.ascontiguousarray(spoil(np.asarray(image, np.uint8))))
    return to


def _told(folder: Path) -> str:
    told: list[str] = []
    open_library(folder, warn=told.append)
    return told[0]


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda image: image, ""),
        (np.flipud, "turned by 180 deg counter-clockwise, then mirrored left to right"),
        (np.rot90, "turned by 270 deg counter-clockwise"),
        (
            lambda image: image.repeat(2, 0).repeat(2, 1),
            "as 0.5 cm a pixel: resized to 50 x 60 pixels of 1 cm",
        ),
        (lambda image: cv2.resize(image, (25, 30), interpolation=cv2.INTER_AREA), "as 2 cm a pixel"),
    ],
    ids=["right", "mirrored", "turned", "fine", "coarse"],
)
def test_a_print_that_lies_wrong_is_told(
    folder: Path, tmp_path: Path, spoil: Callable[[U8], U8], said: str
) -> None:
    told = _told(_copied(folder, tmp_path, spoil))
    assert ("map.png lies wrong" in told) == bool(said)
    assert said in told
    assert "exchanged" not in told


def test_left_and_right_exchanged_are_told(folder: Path, tmp_path: Path) -> None:
    _copied(folder, tmp_path, lambda image: image)
    for (name, _), (other, _) in zip(SIDES, SIDES[::-1], strict=True):
        (tmp_path / f"sensor_{name}.txt").write_bytes((folder / f"sensor_{other}.txt").read_bytes())
    assert _told(tmp_path).startswith("sensor_left.txt and sensor_right.txt lie on the other side")


def test_without_truth_its_size_is_told(folder: Path, tmp_path: Path) -> None:
    _copied(folder, tmp_path, lambda image: image)
    (tmp_path / "gt.txt").unlink()
    told = _told(tmp_path)
    assert "it is taken as 0.6 m along x and 0.5 m along y, 1 cm a pixel" in told
    assert told.count("levels fitted to") == 1


@pytest.mark.parametrize("lightest", [1, 200, 255, 65535, 1.0], ids=str)
def test_the_lightest_shade_of_a_print_is_white(tmp_path: Path, lightest: float) -> None:
    kind = np.float32 if isinstance(lightest, float) else np.uint16 if lightest > 255 else np.uint8
    image = (np.array([[0.0, 1.0], [1.0, 0.0], [0.0, 0.0]]) * lightest).astype(kind)
    done, coded = cv2.imencode(".tiff" if kind is np.float32 else ".png", image)
    assert done
    (tmp_path / "map.png").write_bytes(coded.tobytes())
    assert np.array_equal(read_print(tmp_path / "map.png"), [[0, 1, 0], [1, 0, 0]])


def test_a_black_print_is_refused(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "map.png"), np.zeros((4, 4), np.uint8))
    with pytest.raises(InputError, match="all black"):
        read_print(tmp_path / "map.png")
