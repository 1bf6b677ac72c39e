"""Tables of poses and text files of walls: read strictly, complaints name row and column."""

from __future__ import annotations

import itertools
import math
import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maurice_loaders.errors import InputError
from maurice_loaders.importing import (
    Columns,
    PoseRow,
    pose_runs,
    read_pose_table,
)
from maurice_loaders.maps import arena_from_lines

HEAD = "image,x_m,y_m,heading_deg"


def table(folder: Path, *lines: str, head: str = HEAD) -> Path:
    path = folder / "poses.csv"
    path.write_text("\n".join([head, *lines]) + "\n", encoding="utf-8")
    return path


def test_rows_in_order_with_headings_in_radians_and_other_columns(tmp_path: Path) -> None:
    first, second = read_pose_table(table(tmp_path, "a.jpg,1,2,90", "b.jpg,-1.5,0,-180"), Columns())
    assert (first.number, first.line, first.image) == (0, 2, "a.jpg")
    assert first.pose == pytest.approx([1, 2, math.pi / 2])
    assert second.pose == pytest.approx([-1.5, 0, -math.pi])
    path = tmp_path / "p.csv"
    path.write_text('\ufeffΘ,"bild",y,note,x\r\n0.5,"Büro, 1.jpg",2,x,1\r\n', encoding="utf-8")
    (row,) = read_pose_table(path, Columns("bild", "x", "y", "Θ", "rad"))
    assert row.image == "Büro, 1.jpg"
    assert row.pose.tolist() == [1, 2, 0.5]


@pytest.mark.parametrize(
    ("column", "unit", "expected"),
    [
        ("heading_rad", None, 90.0),
        ("heading_deg", None, math.pi / 2),
        ("heading", "rad", 90.0),
        ("heading", "deg", math.pi / 2),
        ("heading_deg", "rad", 90.0),
    ],
)
def test_the_unit_of_headings(tmp_path: Path, column: str, unit: str | None, expected: float) -> None:
    path = table(tmp_path, "a.jpg,0,0,90", head=f"image,x_m,y_m,{column}")
    (row,) = read_pose_table(path, Columns(heading=column, heading_unit=unit))
    assert row.pose[2] == pytest.approx(expected)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("a.jpg,1,two,3", "found 'two' in column 'y_m', expected a finite number"),
        ("a.jpg,nan,2,3", "found 'nan' in column 'x_m', expected a finite number"),
        ("a.jpg,1,2,inf", "found 'inf' in column 'heading_deg', expected a finite number"),
        ("a.jpg,1,,3", "found '' in column 'y_m', expected a finite number"),
        ("a.jpg,1e300,2,3", "found '1e300' in column 'x_m', expected a number up to 1e9 in size"),
        ("a.jpg,1,2,-2e9", "found '-2e9' in column 'heading_deg', expected a number up to 1e9 in size"),
        ("a.jpg,1,2", "found nothing in column 'heading_deg', expected a finite number"),
        (",1,2,3", "found no file name in column 'image', expected a picture"),
    ],
)
def test_a_bad_row_is_named(tmp_path: Path, line: str, message: str) -> None:
    path = table(tmp_path, "ok.jpg,1,2,3", line)
    with pytest.raises(InputError) as caught:
        read_pose_table(path, Columns())
    assert str(caught.value) == f"{path}:3: {message}"


def test_no_table_at_all(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "b.csv").write_bytes(b"\xff\xfe\x00")
    for path, told in (
        (tmp_path / "no.csv", "found no such file"),
        (table(tmp_path), "found no rows"),
        (tmp_path / "b.csv", "cannot be read as a CSV table"),
        (tmp_path, "cannot be read as a CSV table"),
        (tmp_path / "pipe", "found no regular file, expected a table of poses"),
        (Path("/dev/zero"), "found no regular file, expected a table of poses"),
    ):
        with pytest.raises(InputError, match=told):
            read_pose_table(path, Columns())


FOUND = "found columns"


@pytest.mark.parametrize(
    ("head", "told"),
    [
        (
            HEAD.replace(",", ";"),
            f"{FOUND} separated by semicolons, expected commas; save the table with commas",
        ),
        (HEAD.replace(",", "\t"), f"{FOUND} separated by tabs, expected commas"),
        ('"' + HEAD.replace(",", '";"') + '"', f"{FOUND} separated by semicolons, expected commas"),
        ('"' + HEAD.replace(",", '"\t"') + '"', f"{FOUND} separated by tabs, expected commas"),
        ("file;name,x_m,y_m,heading_deg", f"{FOUND} file;name, x_m, .*, expected also image; choose"),
        (
            "file,x_m,y_m,theta",
            f"{FOUND} file, x_m, y_m, theta, expected also image, heading_deg; choose the columns",
        ),
        ("image,x_m,y_m,yaw", "found heading column 'yaw' without a unit .* deg or rad"),
    ],
)
def test_columns_that_are_not_there_are_named(tmp_path: Path, head: str, told: str) -> None:
    path = table(tmp_path, "a.jpg;1,5;2;3", head=head)
    with pytest.raises(InputError, match=rf"poses\.csv(:1)?: {told}"):
        read_pose_table(path, Columns(heading="yaw") if "yaw" in head else Columns())


@given(st.lists(st.integers(0, 2), min_size=1))
def test_runs_are_maximal_and_lose_nothing(places: list[int]) -> None:
    rows = [PoseRow(k, k, "", np.array([p, 0.0, 0.0])) for k, p in enumerate(places)]
    runs = pose_runs(rows)
    assert [row for run in runs for row in run] == rows
    assert all(row.pose[0] == run[0].pose[0] for run in runs for row in run)
    assert all(a[0].pose[0] != b[0].pose[0] for a, b in itertools.pairwise(runs))


POSES = np.array([[1.0, 2.0, 0.0], [4.0, 3.0, 0.0]])


def walls(folder: Path, text: str) -> Path:
    (folder / "map.txt").write_text(text)
    return folder / "map.txt"


@pytest.mark.parametrize(("text", "unit"), [("1000 2000 3000 2500\n", "mm"), ("1 2 3 2.5", "m")])
def test_units(tmp_path: Path, text: str, unit: str) -> None:
    assert np.allclose(arena_from_lines(walls(tmp_path, text), unit, POSES).walls, [[1, 2, 3, 2.5]])


def test_bounds_reach_a_meter_beyond_the_poses_and_walls_far_outside_are_left_out(tmp_path: Path) -> None:
    assert arena_from_lines(walls(tmp_path, ""), "m", POSES).bounds == (0, 1, 5, 4)
    assert arena_from_lines(walls(tmp_path, ""), "m", POSES).walls.shape == (0, 4)
    text = "# plan\n\n-9 2 9 2\n20 20 21 20\n0.5 -3 0.5 0.9\n0.5, -3, 0.5, 1.1\n"
    found = arena_from_lines(walls(tmp_path, text), "m", POSES).walls
    assert found.tolist() == [[-9, 2, 9, 2], [0.5, -3, 0.5, 1.1]]


@pytest.mark.parametrize(
    ("text", "told"),
    [
        *(
            (f"1 2 3 4\n{line}\n", ":2: found '.*', expected four numbers x1 y1 x2 y2")
            for line in ("1 2 3", "1 2 3 4 5", "1 2 3 wall", "1 2 3 nan")
        ),
        ("1 2 3 4\n1 2 1e300 4\n", ":2: found '.*', expected each a number up to 1e9 in size"),
        ("-10000 2 10000 2\n", ": found a map and poses that together span 20000 m, expected at most"),
    ],
)
def test_a_bad_line_is_named(tmp_path: Path, text: str, told: str) -> None:
    with pytest.raises(InputError, match=r"map\.txt" + told):
        arena_from_lines(walls(tmp_path, text), "m", POSES)


def test_no_map(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be read as a map"):
        arena_from_lines(tmp_path / "no.txt", "m", POSES)
    with pytest.raises(InputError, match="found no regular file, expected a map"):
        arena_from_lines(Path("/dev/zero"), "m", POSES)
    with pytest.raises(ValueError, match="found map unit 'ft'"):
        arena_from_lines(walls(tmp_path, ""), "ft", POSES)
