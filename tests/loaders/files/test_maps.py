"""ROS maps: a YAML file and a picture become walls around the cells that are free."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from maurice_loaders.errors import InputError
from maurice_loaders.files.maps import read_map, read_ros_map
from maurice_loaders.libraries.store import build_library, library_key
from maurice_loaders.session_log.records import read_header
from maurice_mcl.values.arrays import U8
from maurice_mcl.values.map import Arena, make_grid

FREE, UNKNOWN, OCCUPIED = 254, 205, 0  # as map_saver writes them
HEAD = "resolution: 0.5\norigin: [-1.0, 2.0, 0.0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
CELLS = np.array(  # the top row is the farthest in y
    [
        [UNKNOWN, OCCUPIED, OCCUPIED, OCCUPIED, OCCUPIED],
        [UNKNOWN, OCCUPIED, FREE, FREE, OCCUPIED],
        [UNKNOWN, OCCUPIED, FREE, FREE, OCCUPIED],
        [UNKNOWN, UNKNOWN, FREE, OCCUPIED, OCCUPIED],
    ],
    np.uint8,
)
PLACE = np.array([[0.25, 2.75]])


def ros_map(folder: Path, head: str = HEAD, cells: U8 = CELLS, name: str = "map.pgm") -> Path:
    cv2.imwrite(str(folder / name), cells)
    (folder / "map.yaml").write_text(f"image: {name}\n{head}")
    return folder / "map.yaml"


def free_at(arena: Arena, x: float, y: float) -> bool:
    grid = make_grid(arena, PLACE)
    column, row = np.floor((np.array([x, y]) - grid.corner) / grid.cell_m + 1e-6).astype(int)
    inside = 0 <= row < grid.shape[0] and 0 <= column < grid.shape[1]
    return bool(inside and grid.free[row, column])


@pytest.mark.parametrize("name", ["map.pgm", "map.png"])
def test_cells_lie_where_resolution_and_origin_say(tmp_path: Path, name: str) -> None:
    arena = read_ros_map(ros_map(tmp_path, name=name))
    assert arena.bounds == (0.0, 2.0, 1.0, 3.5)  # of the free cells
    assert sorted(arena.walls.tolist()) == sorted(
        [
            [0.0, 2.0, 0.5, 2.0],
            [0.5, 2.5, 1.0, 2.5],
            [0.0, 3.5, 1.0, 3.5],
            [0.0, 2.0, 0.0, 3.5],
            [0.5, 2.0, 0.5, 2.5],
            [1.0, 2.5, 1.0, 3.5],
        ]
    )
    assert free_at(arena, 0.25, 2.25)
    assert free_at(arena, 0.75, 3.25)
    assert not free_at(arena, 0.75, 2.25)


def test_a_turned_origin_turns_the_walls(tmp_path: Path) -> None:
    arena = read_ros_map(ros_map(tmp_path, HEAD.replace("2.0, 0.0]", "2.0, 1.5707963267948966]")))
    assert arena.bounds == pytest.approx((-2.5, 3.0, -1.0, 4.0))


def test_negate_thresholds_lists_and_quotes_are_respected(tmp_path: Path) -> None:
    same = read_ros_map(ros_map(tmp_path)).walls
    negated = read_ros_map(ros_map(tmp_path, HEAD.replace("negate: 0", "negate: 1"), 255 - CELLS))
    assert np.array_equal(negated.walls, same)
    listed = HEAD.replace("origin: [-1.0, 2.0, 0.0]", "origin:\n- -1.0\n- 2.0\n- 0.0  # yaw")
    file = ros_map(tmp_path, f"mode: trinary\n{listed}")
    file.write_text("# made\n---\n" + file.read_text().replace("map.pgm", '"map.pgm"'))
    assert np.array_equal(read_ros_map(file).walls, same)
    wide = read_ros_map(ros_map(tmp_path, HEAD.replace("0.196", "0.3")))  # now unknown cells count as free
    assert wide.bounds == (-1.0, 2.0, 1.0, 4.0)


YAML_FORMS = {
    "several lines": "image: map.pgm\n" + HEAD.replace("2.0, 0.0]", "\n  2.0,\n  0.0]"),
    "flow": "{image: map.pgm, resolution: 0.5, origin: [-1.0, 2.0, 0.0], free_thresh: 0.196}",
    "indented": "".join(f"  {line}\n" for line in ("image: map.pgm", *HEAD.splitlines())),
    "quoted": "image: map.pgm\n" + HEAD.replace("0.5", '"0.5"'),
    "anchors": "a: &a 0.5\nrest: &rest {image: map.pgm}\n<<: *rest\n" + HEAD.replace("0.5", "*a", 1),
    "two documents": "image: map.pgm\n" + HEAD + "\n---\nimage: none.pgm\n",
}


@pytest.mark.parametrize("form", YAML_FORMS)
def test_yaml_of_every_form_is_one_map(tmp_path: Path, form: str) -> None:
    file = ros_map(tmp_path)
    same = read_ros_map(file).walls
    file.write_text(YAML_FORMS[form])
    assert np.array_equal(read_ros_map(file).walls, same)


@pytest.mark.parametrize("white", [100, 1020, 65535])
def test_a_pgm_is_read_by_its_largest_value(tmp_path: Path, white: int) -> None:
    file = ros_map(tmp_path)
    same = read_ros_map(file).walls
    shades = np.rint(CELLS / 255 * white).astype(">u2" if white > 255 else np.uint8)
    head = f"P5\n# by hand\n{CELLS.shape[1]} {CELLS.shape[0]}\n{white}\n".encode()
    (tmp_path / "map.pgm").write_bytes(head + shades.tobytes())
    assert np.array_equal(read_ros_map(file).walls, same)


@pytest.mark.parametrize(
    ("head", "told"),
    [
        ("", "found resolution nothing"),
        (HEAD.replace("0.5", "-1"), "found cells of -1 m"),
        (HEAD.replace(", 0.0]", "]"), "found origin .* expected .x, y, yaw."),
        (HEAD.replace("negate: 0", "mode: gray"), "mode 'gray'"),
        (HEAD.replace("negate: 0", "what"), "map.yaml: found no YAML, line 5: could not find expected ':'"),
        ("]", "map.yaml: found no YAML, line 2"),
        ("a: " + "[" * 3000, "map.yaml: found YAML nested too deeply"),
        ("a: &a {b: *a}\n", "found resolution nothing"),
        (HEAD.replace("negate: 0", "image: none.pgm"), "none.pgm cannot be read"),
        (HEAD.replace("negate: 0", "image: map.yaml"), "begins with"),
        (HEAD.replace("0.196", "0"), "found no free cell"),
        (HEAD.replace("-1.0, 2.0", "1e8, 2.0"), "together span 1e.08 m"),
    ],
)
def test_what_is_no_map_is_refused_in_one_line(tmp_path: Path, head: str, told: str) -> None:
    file = ros_map(tmp_path, head)
    with pytest.raises(InputError, match=told) as refused:
        read_map(file, "m", PLACE)
    assert "\n" not in str(refused.value)


def test_a_survey_names_its_map_and_a_build_may_name_another(survey: Path, tmp_path: Path) -> None:
    file = ros_map(tmp_path)
    key = library_key(survey)
    header, *rest = survey.read_text().splitlines()
    survey.write_text("\n".join([json.dumps(json.loads(header) | {"map": "map.yaml"}), *rest]))
    arena = read_header(survey)[0].arena
    assert arena is not None
    assert len(arena.walls) == 6
    named = library_key(survey)
    ros_map(tmp_path, HEAD.replace("0.5", "0.25"))
    assert len({key, named, library_key(survey)}) == 3  # the cache sees a changed map
    assert len(build_library(survey, ["color"], map_file=file).arena.walls) == 6
    (tmp_path / "map.yaml").unlink()
    with pytest.raises(InputError, match=r"survey\.log:1: found map 'map.yaml', which cannot be used"):
        read_header(survey)
