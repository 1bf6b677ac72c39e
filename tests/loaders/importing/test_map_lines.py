"""Walls from a text file."""

from pathlib import Path

import numpy as np
import pytest

from maurice_loaders.errors import InputError
from maurice_loaders.importing.pose_table import arena_from_lines

POSES = np.array([[1.0, 2.0, 0.0], [4.0, 3.0, 0.0]])


def lines(folder: Path, text: str) -> Path:
    (folder / "map.txt").write_text(text)
    return folder / "map.txt"


def test_units(tmp_path: Path) -> None:
    millimeters = arena_from_lines(lines(tmp_path, "1000 2000 3000 2500\n"), "mm", POSES)
    meters = arena_from_lines(lines(tmp_path, "1 2 3 2.5"), "m", POSES)
    assert np.allclose(millimeters.walls, [[1, 2, 3, 2.5]])
    assert np.allclose(meters.walls, millimeters.walls)


def test_bounds_reach_a_metre_beyond_the_poses(tmp_path: Path) -> None:
    assert arena_from_lines(lines(tmp_path, ""), "m", POSES).bounds == (0, 1, 5, 4)
    assert arena_from_lines(lines(tmp_path, ""), "m", POSES).walls.shape == (0, 4)


def test_walls_far_outside_are_left_out_and_passing_ones_are_not(tmp_path: Path) -> None:
    text = "# plan\n\n-9 2 9 2\n20 20 21 20\n0.5 -3 0.5 0.9\n0.5, -3, 0.5, 1.1\n"
    walls = arena_from_lines(lines(tmp_path, text), "m", POSES).walls
    assert walls.tolist() == [[-9, 2, 9, 2], [0.5, -3, 0.5, 1.1]]


@pytest.mark.parametrize("line", ["1 2 3", "1 2 3 4 5", "1 2 3 wall", "1 2 3 nan"])
def test_a_bad_line_is_named(tmp_path: Path, line: str) -> None:
    with pytest.raises(InputError, match=r"map\.txt:2: found '.*', expected four numbers x1 y1 x2 y2"):
        arena_from_lines(lines(tmp_path, f"1 2 3 4\n{line}\n"), "m", POSES)


def test_a_wall_too_far_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"map\.txt:2: found '.*', expected each a number up to 1e9 in size"):
        arena_from_lines(lines(tmp_path, "1 2 3 4\n1 2 1e300 4\n"), "m", POSES)
    with pytest.raises(InputError, match=r"map\.txt: found a map that .* spans 20000 m, expected at most"):
        arena_from_lines(lines(tmp_path, "-10000 2 10000 2\n"), "m", POSES)


def test_no_map(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be read as a map"):
        arena_from_lines(tmp_path / "no.txt", "m", POSES)
    with pytest.raises(InputError, match="found no regular file, expected a map"):
        arena_from_lines(Path("/dev/zero"), "m", POSES)
    with pytest.raises(ValueError, match="found map unit 'ft'"):
        arena_from_lines(lines(tmp_path, ""), "ft", POSES)
