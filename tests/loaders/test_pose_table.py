"""Tables of poses and text files of walls: read strictly, complaints name row and column."""

from __future__ import annotations

import math
import os
from pathlib import Path

import numpy as np
import pytest

from maurice_loaders.errors import InputError
from maurice_loaders.files.maps import arena_from_lines
from maurice_loaders.formats.picture_folder import open_table
from maurice_loaders.importing import PoseRow, import_pictures, read_rows
from maurice_loaders.reading.options import Reading

HEAD = "image,x_m,y_m,heading_deg"


def table(folder: Path, *lines: str, head: str = HEAD) -> Path:
    path = folder / "poses.csv"
    path.write_text("\n".join([head, *lines]) + "\n", encoding="utf-8")
    return path


def read(path: Path, **columns: str) -> list[PoseRow]:
    return read_rows(open_table(path.parent, Reading(table=path, columns=columns)))


def test_rows_in_order_with_headings_in_radians_and_other_columns(tmp_path: Path) -> None:
    first, second = read(table(tmp_path, "a.jpg,1,2,90", "b.jpg,-1.5,0,-180"))
    assert (first.picture.t_s, first.picture.name) == (0.0, "a.jpg")
    assert first.pose == pytest.approx([1, 2, math.pi / 2])
    assert second.pose == pytest.approx([-1.5, 0, -math.pi])
    path = tmp_path / "p.csv"
    path.write_text('\ufeffΘ,"bild",y,note,x\r\n0.5,"Büro, 1.jpg",2,x,1\r\n', encoding="utf-8")
    (row,) = read(path, image="bild", x="x", y="y", heading="Θ:rad")
    assert row.picture.name == "Büro, 1.jpg"
    assert row.pose.tolist() == [1, 2, 0.5]


def test_units_and_times_are_those_of_every_other_table(tmp_path: Path) -> None:
    head = "t_ms,file,x_mm,y_mm,yaw_deg"
    first, second = read(table(tmp_path, "500,a.jpg,1000,2500,90", "900,b.jpg,1000,2500,90", head=head))
    assert first.pose == pytest.approx([1, 2.5, math.pi / 2])
    assert (first.picture.t_s, second.picture.t_s) == (0.5, 0.9)
    german = table(tmp_path, "a.jpg;1,5;2;90", head=HEAD.replace(",", ";"))
    assert read(german)[0].pose == pytest.approx([1.5, 2, math.pi / 2])


@pytest.mark.parametrize(
    ("column", "heading", "expected"),
    [
        ("heading_rad", None, 90.0),
        ("heading_deg", None, math.pi / 2),
        ("heading", "heading:rad", 90.0),
        ("heading", "heading:deg", math.pi / 2),
        ("heading_deg", "heading_deg:rad", 90.0),
    ],
)
def test_the_unit_of_headings(tmp_path: Path, column: str, heading: str | None, expected: float) -> None:
    path = table(tmp_path, "a.jpg,0,0,90", head=f"image,x_m,y_m,{column}")
    (row,) = read(path) if heading is None else read(path, heading=heading)
    assert row.pose[2] == pytest.approx(expected)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("a.jpg,1,two,3", "found y_m 'two', expected a finite number"),
        ("a.jpg,nan,2,3", "found x_m 'nan', expected a finite number"),
        ("a.jpg,1,2,inf", "found heading_deg 'inf', expected a finite number"),
        ("a.jpg,1,,3", "found y_m '', expected a finite number"),
        ("a.jpg,1e300,2,3", "found x_m '1e300', expected a number up to 1e9 in size"),
        ("a.jpg,1,2,-2e9", "found heading_deg '-2e9', expected a number up to 1e9 in size"),
        ("a.jpg,1,2", "found 3 values, expected at least 4"),
    ],
)
def test_a_bad_row_is_named(tmp_path: Path, line: str, message: str) -> None:
    path = table(tmp_path, "ok.jpg,1,2,3", line)
    with pytest.raises(InputError) as caught:
        read(path)
    assert str(caught.value) == f"{path}:3: {message}"


def test_a_row_without_a_picture_or_a_pose_has_no_place_in_library_or_session(tmp_path: Path) -> None:
    rows = read(table(tmp_path, "a.jpg,1,2,3", ",2,2,3", "b.jpg,,,", "c.jpg,3,2,3"))
    assert [(row.picture.name, row.picture.t_s) for row in rows] == [("a.jpg", 0), ("c.jpg", 3)]


def test_no_table_at_all(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "b.csv").write_bytes(b"\xff\xfe\x00")
    for path, told in (
        (tmp_path / "no.csv", "found no table"),
        (table(tmp_path), "found no rows"),
        (tmp_path / "b.csv", "found bytes that are not UTF-8|found binary data"),
        (tmp_path, "found no table"),
        (tmp_path / "pipe", "found no table"),
        (Path("/dev/zero"), "found no table"),
    ):
        with pytest.raises(InputError, match=told):
            read(path)


@pytest.mark.parametrize(
    ("head", "columns", "told"),
    [
        ("image,x_m,y_m,bearing", {}, "found columns 'image, x_m, y_m, bearing' and no picture with a pose"),
        ("image,x_m,y_m,yaw", {}, "found column 'yaw' without a unit"),
        (HEAD, {"image": "file"}, "found columns image, x_m, y_m, heading_deg, expected also 'file'"),
    ],
)
def test_columns_that_are_not_there_are_named(
    tmp_path: Path, head: str, columns: dict[str, str], told: str
) -> None:
    path = table(tmp_path, "a.jpg,1,5,2", head=head)
    with pytest.raises(InputError, match=rf"poses\.csv(:1)?: {told}"):
        import_pictures(tmp_path, path, tmp_path / "out", Reading(columns=columns))


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
    with pytest.raises(InputError, match="found no such file, expected a map"):
        arena_from_lines(tmp_path / "no.txt", "m", POSES)
    with pytest.raises(InputError, match="found no regular file, expected a map"):
        arena_from_lines(Path("/dev/zero"), "m", POSES)
    with pytest.raises(ValueError, match="found map unit 'ft'"):
        arena_from_lines(walls(tmp_path, ""), "ft", POSES)
