"""Tables of poses: read strictly, complaints name row and column."""

import itertools
import math
import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maurice_loaders.errors import InputError
from maurice_loaders.importing.pose_table import Columns, PoseRow, pose_runs, read_pose_table

HEAD = "image,x_m,y_m,heading_deg"


def table(folder: Path, *lines: str, head: str = HEAD) -> Path:
    path = folder / "poses.csv"
    path.write_text("\n".join([head, *lines]) + "\n", encoding="utf-8")
    return path


def test_rows_in_order_with_headings_in_radians(tmp_path: Path) -> None:
    first, second = read_pose_table(table(tmp_path, "a.jpg,1,2,90", "b.jpg,-1.5,0,-180"), Columns())
    assert (first.number, first.line, first.image) == (0, 2, "a.jpg")
    assert first.pose == pytest.approx([1, 2, math.pi / 2])
    assert second.pose == pytest.approx([-1.5, 0, -math.pi])


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


def test_a_heading_of_unknown_unit_is_not_guessed(tmp_path: Path) -> None:
    path = table(tmp_path, "a.jpg,0,0,90", head="image,x_m,y_m,yaw")
    with pytest.raises(InputError, match=r"found heading column 'yaw' without a unit .* deg or rad"):
        read_pose_table(path, Columns(heading="yaw"))


def test_other_columns_other_order_quotes_and_a_byte_order_mark(tmp_path: Path) -> None:
    path = tmp_path / "p.csv"
    path.write_text('\ufeffΘ,"bild",y,note,x\r\n0.5,"Büro, 1.jpg",2,x,1\r\n', encoding="utf-8")
    (row,) = read_pose_table(path, Columns("bild", "x", "y", "Θ", "rad"))
    assert row.image == "Büro, 1.jpg"
    assert row.pose.tolist() == [1, 2, 0.5]


def test_missing_columns_are_named_with_those_found(tmp_path: Path) -> None:
    path = table(tmp_path, head="file,x_m,y_m,theta")
    with pytest.raises(InputError) as caught:
        read_pose_table(path, Columns())
    message = "found columns file, x_m, y_m, theta, expected also image, heading_deg; choose the columns"
    assert str(caught.value) == f"{path}:1: {message}"


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
    with pytest.raises(InputError, match="found no such file"):
        read_pose_table(tmp_path / "no.csv", Columns())
    with pytest.raises(InputError, match="found no rows"):
        read_pose_table(table(tmp_path), Columns())
    (tmp_path / "b.csv").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="cannot be read as a CSV table"):
        read_pose_table(tmp_path / "b.csv", Columns())
    with pytest.raises(InputError, match="cannot be read as a CSV table"):
        read_pose_table(tmp_path, Columns())


def test_a_table_that_never_ends(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", Path("/dev/zero")):
        with pytest.raises(InputError, match="found no regular file, expected a table of poses"):
            read_pose_table(path, Columns())


@pytest.mark.parametrize(("separator", "name"), [(";", "semicolons"), ("\t", "tabs")])
@pytest.mark.parametrize("quote", ["", '"'])
def test_other_separators_are_named(tmp_path: Path, separator: str, name: str, quote: str) -> None:
    head = separator.join(f"{quote}{column}{quote}" for column in HEAD.split(","))
    path = table(tmp_path, separator.join(["a.jpg", "1,5", "2", "3"]), head=head)
    with pytest.raises(InputError) as caught:
        read_pose_table(path, Columns())
    advice = "save the table with commas between columns"
    assert str(caught.value) == f"{path}:1: found columns separated by {name}, expected commas; {advice}"


def test_a_semicolon_within_a_name_is_no_separator(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"found columns file;name, x_m, .*, expected also image; choose"):
        read_pose_table(table(tmp_path, head="file;name,x_m,y_m,heading_deg"), Columns())


@given(st.lists(st.integers(0, 2), min_size=1))
def test_runs_are_maximal_and_lose_nothing(places: list[int]) -> None:
    rows = [PoseRow(k, k, "", np.array([p, 0.0, 0.0])) for k, p in enumerate(places)]
    runs = pose_runs(rows)
    assert [row for run in runs for row in run] == rows
    assert all(row.pose[0] == run[0].pose[0] for run in runs for row in run)
    assert all(a[0].pose[0] != b[0].pose[0] for a, b in itertools.pairwise(runs))
