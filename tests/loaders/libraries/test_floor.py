"""A robot without a camera on a printed floor: its library, its folder of rows, and that it finds itself."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

import maurice_viz as mv
from maurice_loaders import InputError, open_library, open_session
from maurice_loaders.libraries.floor import read_probes
from maurice_mcl.config.build import make_localizer
from maurice_mcl.filter.localizer import run
from maurice_mcl.geometry import compose
from maurice_mcl.sensor.reflectance import Reflectance
from maurice_viz.app.library import build_floor_library
from maurice_viz.app.saved import open_saved

PROBES = "[probes.left]\nx_m = 0.072\ny_m = 0.011\n[probes.right]\nx_m = 0.072\ny_m = -0.011\n"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A drive of 2 m over a print of 0.6 m x 0.5 m, as aligned rows; the print's first axis is x."""
    made, rng = tmp_path_factory.mktemp("floor") / "drive", np.random.default_rng(5)
    made.mkdir()
    light = cv2.GaussianBlur(rng.standard_normal((60, 50)), (0, 0), 2.5) > 0
    cv2.imwrite(str(made.parent / "map.png"), light.astype(np.uint8) * 255)
    poses = [np.array([0.2, 0.2, 0.3])]
    for _ in range(220):
        ahead = compose(poses[-1], np.array([0.12, 0.0, 0.0]))
        inside = 0.05 < ahead[0] < 0.55 and 0.05 < ahead[1] < 0.45
        turn = rng.normal(0, 0.05) if inside else 0.25
        poses.append(compose(poses[-1], np.array([0.009 if inside else 0.0, 0.0, turn])))
    path = np.array(poses)
    for name, y, black, white in (("left", 0.011, 120, 700), ("right", -0.011, 160, 820)):
        x_m = path[:, 0] + 0.072 * np.cos(path[:, 2]) - y * np.sin(path[:, 2])
        y_m = path[:, 1] + 0.072 * np.sin(path[:, 2]) + y * np.cos(path[:, 2])
        cells = (x_m * 100).astype(int).clip(0, 59), (y_m * 100).astype(int).clip(0, 49)
        values = np.where(light[cells], white, black) + rng.normal(0, 30, len(path))
        np.savetxt(made / f"sensor_{name}.txt", values.clip(0, 1023).round(), fmt="%d")
    np.savetxt(made / "gt.txt", path)
    np.savetxt(made / "odom_pose.txt", path[:, :2])
    np.savetxt(
        made / "odom_quaternion.txt", np.column_stack([np.sin(path[:, 2] / 2), np.cos(path[:, 2] / 2)])
    )
    return made


def test_a_robot_without_a_camera_finds_itself_from_anywhere(folder: Path) -> None:
    library, session = open_library(folder), open_session(folder)
    assert not library.index
    localizer = make_localizer(library, particles=6000)
    assert localizer.sensor.weights == {}
    errors = [
        float(np.hypot(*(record.estimate.pose - moment.truth)[:2]))
        for moment, record in run(localizer, session)
        if moment.truth is not None
    ]
    assert np.median(errors[-40:]) < 0.03
    assert errors[0] > 0.1


def test_its_library_is_kept_in_a_folder_and_damage_is_told(folder: Path, tmp_path: Path) -> None:
    print_of_it = cv2.imread(str(folder.parent / "map.png"), cv2.IMREAD_GRAYSCALE)
    cv2.imwrite(str(tmp_path / "floor.png"), np.flipud(print_of_it.T))
    (tmp_path / "floor.yaml").write_text(
        "image: floor.png\nresolution: 0.01\norigin: [0, 0, 0]\nmode: floor\n"
    )
    (tmp_path / "probes.toml").write_text(PROBES)
    how = {"floor": tmp_path / "floor.yaml", "probes": tmp_path / "probes.toml"}
    build_floor_library(folder, tmp_path / "library", **how)
    kept, direct = open_library(tmp_path / "library"), open_library(folder)
    one, other = kept.sensors["reflectance"], direct.sensors["reflectance"]
    assert isinstance(one, Reflectance)
    assert isinstance(other, Reflectance)
    assert np.array_equal(one.floor.values, other.floor.values)
    assert one.probes == other.probes
    assert kept.poses == pytest.approx(direct.poses)
    with pytest.raises(InputError, match="no reading 'left' in the drive"):
        build_floor_library(None, tmp_path / "none", **how)
    file = tmp_path / "library" / "sensors" / "reflectance.npz"
    file.write_bytes(file.read_bytes()[:-9])
    with pytest.raises(InputError, match=r"sensors/reflectance\.npz was changed"):
        open_library(tmp_path / "library")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "probes"),
        ("[probes]\n", "found no \\[probes.NAME\\]"),
        ("[probes.left]\nx_m = 1\n", "found no y_m in probes.left"),
        ("[probe.left]\nx_m = 1\n", r"found no \[probes.NAME\]"),
        ("[probes.left]\nx_m = 0\ny_m = 0\nblack = 3\n", "only one of black and white"),
        ("[probes.left]\nx_m = 0\ny_m = 0\nblack = 3\nwhite = 3\n", "levels apart"),
        ("outliers = 2\n[probes.left]\nx_m = 0\ny_m = 0\n", "outliers 2"),
    ],
)
def test_bad_probes_are_told_in_a_line(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / "probes.toml").write_text(text)
    with pytest.raises(InputError, match=said):
        read_probes(tmp_path / "probes.toml")


def test_carrying_is_told_once(folder: Path, tmp_path: Path) -> None:
    for file in folder.iterdir():
        (tmp_path / file.name).write_bytes(file.read_bytes())
    truth = np.loadtxt(tmp_path / "gt.txt")
    truth[100:, 0] += 0.1
    truth[102:, 0] += 0.1
    np.savetxt(tmp_path / "gt.txt", truth)
    moments = list(open_session(tmp_path).moments())
    assert [k for k, one in enumerate(moments) if "kidnapped" in one.events] == [100]
    assert len(moments) == len(truth)


def test_a_saved_run_without_pictures_keeps_what_its_sensors_said(folder: Path, tmp_path: Path) -> None:
    short = tmp_path / "short"
    short.mkdir()
    for file in folder.iterdir():
        (short / file.name).write_text("".join(file.read_text().splitlines(keepends=True)[60:75]))
    (short / "map.png").write_bytes((folder.parent / "map.png").read_bytes())
    for name in ("left", "right"):  # both levels, which so few rows need not show
        file = short / f"sensor_{name}.txt"
        file.write_text("\n".join(["100", "800"] * 6 + file.read_text().split()[12:]) + "\n")
    mv.replay(short, particles=100, run=tmp_path / "run")
    assert [one.same for one in mv.verify(tmp_path / "run")] == [True]
    restored = open_saved(tmp_path / "run").updates()
    quality = [records["reflectance"].sighting.comparison.quality for _, records in restored]
    assert all(len(one) and np.ptp(one) > 0 for one in quality)
    with pytest.raises(InputError, match=r"step 9 compared no picture .* left reads .* at the truth is"):
        mv.explain(tmp_path / "run", 9)
