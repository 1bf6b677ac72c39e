"""Occupancy grids from ROS maps and messages: states, places, turned maps, and writing them."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace as Fields
from typing import Any

import cv2
import numpy as np
import pytest

from maurice_loaders.errors import InputError
from maurice_loaders.files.maps import occupancy_of_message, read_occupancy, read_ros_map, write_ros_map
from maurice_mcl.values.arrays import U8
from maurice_mcl.values.geometry import rotated
from maurice_mcl.values.laser import FREE, OCCUPIED, UNKNOWN, OccupancyMap

HEAD = "resolution: 0.5\norigin: [-1.0, 2.0, 0.0]\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"


def ros_map(folder: Path, image: Any, head: str = HEAD, name: str = "map.png") -> Path:
    cv2.imwrite(str(folder / name), image)
    (folder / "map.yaml").write_text(f"image: {name}\n{head}")
    return folder / "map.yaml"


def message(percents: list[list[int]], yaw: float = 0.0, cell_m: float = 0.5) -> Fields:
    cells = np.array(percents, np.int8)
    turned = Fields(x=0.0, y=0.0, z=np.sin(yaw / 2), w=np.cos(yaw / 2))
    origin = Fields(position=Fields(x=-1.0, y=2.0, z=0.0), orientation=turned)
    info = Fields(height=cells.shape[0], width=cells.shape[1], resolution=cell_m, origin=origin)
    return Fields(info=info, data=cells.reshape(-1))


@pytest.mark.parametrize("name", ["map.pgm", "map.png"])
def test_a_cell_is_where_the_map_says(tmp_path: Path, name: str) -> None:
    grid = read_occupancy(ros_map(tmp_path, np.array([[0, 254, 205], [254, 254, 254]], np.uint8), name=name))
    assert grid.bounds == (-1.0, 2.0, 0.5, 3.0)
    points = np.array([[-0.75, 2.75], [-0.25, 2.75], [0.25, 2.75], [-0.75, 2.25], [9.0, 9.0]])
    assert grid.states_at(points).tolist() == [OCCUPIED, FREE, UNKNOWN, FREE, UNKNOWN]


GRAYS = np.array([[0, 65, 100, 150, 205, 254]], np.uint8)  # taken to 1, .75, .61, .41, .196 and 0


@pytest.mark.parametrize(
    ("mode", "negate", "states"),
    [
        ("trinary", 0, [1, 1, 2, 2, 2, 0]),
        ("scale", 0, [1, 1, 2, 2, 2, 0]),
        ("trinary", 1, [0, 2, 2, 2, 1, 1]),
        ("raw", 0, [0, 1, 1, 2, 2, 2]),  # a shade is a percent, and above 100 nothing is known
    ],
)
def test_modes_are_those_of_map_server(tmp_path: Path, mode: str, negate: int, states: list[int]) -> None:
    head = f"{HEAD}mode: {mode}\nnegate: {negate}\n"
    assert read_occupancy(ros_map(tmp_path, GRAYS, head)).cells[0].tolist() == states


@pytest.mark.parametrize(("mode", "half"), [("trinary", OCCUPIED), ("scale", UNKNOWN)])
def test_transparent_pixels_are_unknown(tmp_path: Path, mode: str, half: int) -> None:
    image = np.array([[[0, 0, 0, 0], [0, 0, 0, 128], [0, 0, 0, 255], [255, 255, 255, 255]]], np.uint8)
    cells = read_occupancy(ros_map(tmp_path, image, f"{HEAD}mode: {mode}\n")).cells
    assert cells[0].tolist() == [UNKNOWN, half, OCCUPIED, FREE]


def test_sixteen_bits_and_colors(tmp_path: Path) -> None:
    deep = np.array([[0, 30000, 65535]], np.uint16)
    assert read_occupancy(ros_map(tmp_path, deep)).cells[0].tolist() == [OCCUPIED, UNKNOWN, FREE]
    color = np.array([[[0, 0, 60], [0, 255, 128], [255, 255, 240]]], np.uint8)
    assert read_occupancy(ros_map(tmp_path, color)).cells[0].tolist() == [OCCUPIED, UNKNOWN, FREE]


def test_unknown_cells_of_map_saver_stay_unknown(tmp_path: Path) -> None:
    """In ROS 2 it long wrote a threshold by which its own shade of unknown is free."""
    head = HEAD.replace("0.196", "0.25")
    saved = np.array([[0, 205, 254]], np.uint8)
    assert read_occupancy(ros_map(tmp_path, saved, head)).cells[0].tolist() == [OCCUPIED, UNKNOWN, FREE]
    assert read_ros_map(tmp_path / "map.yaml").bounds == (0.0, 2.0, 0.5, 2.5)
    drawn = np.array([[0, 205, 230, 254]], np.uint8)  # not by map_saver: as its author said
    assert read_occupancy(ros_map(tmp_path, drawn, head)).cells[0].tolist() == [OCCUPIED, FREE, FREE, FREE]


def test_percents_of_a_message() -> None:
    grid = occupancy_of_message(message([[-1, 0, 25, 26], [64, 65, 100, -1]]))
    assert grid.cells.tolist() == [[2, 0, 0, 2], [2, 1, 1, 2]]
    assert grid.bounds == (-1.0, 2.0, 1.0, 3.0)


def test_a_quarter_turn_is_exact() -> None:
    percents = [[100, 0, -1], [0, 0, 100]]
    grid = occupancy_of_message(message(percents, yaw=np.pi / 2))
    np.testing.assert_allclose(grid.bounds, (-2.0, 2.0, -1.0, 3.5))
    assert grid.cells.tolist() == [[0, 1], [0, 0], [1, 2]]


@pytest.mark.parametrize("yaw", [0.3, -2.0, 2.5])
def test_a_turned_map_keeps_places_and_closed_walls(yaw: float) -> None:
    percents = np.zeros((40, 60), int)
    percents[[0, -1]] = percents[:, [0, -1]] = percents[20, :30] = 100
    grid = occupancy_of_message(message(percents.tolist(), yaw, cell_m=0.1))

    def at(cells: Any) -> U8:
        y, x = 0.1 * (np.argwhere(cells) + 0.5).T
        x, y = rotated(x, y, yaw)
        return grid.states_at(np.column_stack([x - 1.0, y + 2.0]))

    assert set(at(percents == 100)) == {OCCUPIED}
    wall = cv2.dilate((percents == 100).astype(np.uint8), np.ones((5, 5)))
    assert set(at(wall == 0)) == {FREE}
    _, parts = cv2.connectedComponents((grid.cells != OCCUPIED).astype(np.uint8), connectivity=4)
    inside = parts[tuple(np.argwhere(grid.free)[0])]
    around = np.concatenate([parts[[0, -1]].ravel(), parts[:, [0, -1]].ravel()])
    assert inside not in around


@pytest.mark.parametrize("corner", [(-1.0, 2.0), (1 / 3, -1e5 - 0.1)])
def test_a_written_map_reads_back_the_same(tmp_path: Path, corner: tuple[float, float]) -> None:
    cells = np.random.default_rng(1).integers(0, 3, (7, 11)).astype(np.uint8)
    grid = OccupancyMap(cells, 0.1 / 3, np.array(corner))
    file = tmp_path / "my map.yaml"
    write_ros_map(grid, file)
    again = read_occupancy(file)
    assert np.array_equal(again.cells, cells)
    assert (again.cell_m, *again.corner) == (grid.cell_m, *corner)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["my map.pgm", "my map.yaml"]
    with pytest.raises(InputError, match="exists already"):
        write_ros_map(grid, file)
    write_ros_map(grid, file, force=True)
    with pytest.raises(InputError, match=r"ends with \.yaml"):
        write_ros_map(grid, tmp_path / "map.pgm")


@pytest.mark.parametrize(
    ("percents", "told"), [([[0, -1]], "no occupied cell"), ([[100, -1]], "no free cell")]
)
def test_a_map_that_tells_a_laser_nothing_is_refused(percents: list[list[int]], told: str) -> None:
    with pytest.raises(ValueError, match=told):
        occupancy_of_message(message(percents))


def test_what_is_no_map_is_refused_in_one_line(tmp_path: Path) -> None:
    white = np.full((3, 3), 254, np.uint8)
    for head, told in (
        (HEAD, "no occupied cell"),
        (HEAD.replace("[-1.0", "[1e9"), "found a map at 1"),
        (HEAD.replace("0.65", "0.1"), "0 <= free <= occupied <= 1"),
        (HEAD.replace("2.0, 0.0]", "2.0, .nan]"), "found origin"),
    ):
        with pytest.raises(InputError, match=told) as refused:
            read_occupancy(ros_map(tmp_path, white, head))
        assert str(refused.value).startswith(str(tmp_path / "map.yaml"))
        assert "\n" not in str(refused.value)
    with pytest.raises(InputError, match=r"none\.yaml"):
        read_occupancy(tmp_path / "none.yaml")
