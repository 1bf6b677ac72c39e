"""World files: the example of the documentation loads, and bad ones are refused in one line."""

from __future__ import annotations

import re
from pathlib import Path

import cv2
import numpy as np
import pytest

from maurice_datasets.worlds.build import load_world, shipped_worlds
from maurice_datasets.worlds.draw import read_image
from maurice_datasets.worlds.world import World, clearance, floor_at, inside
from maurice_loaders.errors import InputError

EXAMPLE = Path(__file__).parents[3] / "docs" / "examples" / "workshop.toml"
SMALL = """
format = 1
units = "m"
height = 2.5
[library]
anchor = [0.5, 0.5]
spacing = 0.5
[style.plain]
lamp = { brightness = 1.0, color = "warm" }
[[room]]
name = "a"
rect = [0, 0, 2, 3]
style = "plain"
[[room]]
name = "b"
rect = [2.1, 0, 4, 3]
style = "plain"
[[door]]
rect = [2, 1, 2.1, 2]
[[floor]]
name = "wood"
[[furniture]]
kind = "block"
at = [3.5, 2.5]
size = [0.4, 0.4]
height = 0.3
"""


ROOM = "rect = [0, 0, 2, 3]"


def poster(wall: str, at: float, size: tuple[float, float]) -> str:
    return f'[[poster]]\nroom = "a"\nwall = "{wall}"\nat = {at}\nsize = {list(size)}\n[[floor]]'


def write(folder: Path, text: str = SMALL) -> Path:
    file = folder / "mine.toml"
    file.write_text(text, encoding="utf-8")
    return file


def refusal(file: Path) -> str:
    with pytest.raises(InputError) as caught:
        load_world(file, 0)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_the_documented_world_loads_in_any_units(tmp_path):
    for seed in range(5):
        world = load_world(EXAMPLE, seed)
        assert len(world.arena.rooms) == 2
        assert world.start is not None
    in_m = load_world(write(tmp_path), 3)
    scaled = re.sub(r"\[([\d., ]+)\]", lambda m: "[" + ", ".join(
        f"{100 * float(v):g}" for v in m[1].split(",")) + "]", SMALL)  # fmt: skip
    scaled = scaled.replace("= 0.5\n", "= 50\n").replace("= 2.5\n", "= 250\n").replace("= 0.3\n", "= 30\n")
    in_cm = load_world(write(tmp_path, scaled.replace('"m"', '"cm"')), 3)
    assert np.allclose(in_m.arena.walls, in_cm.arena.walls)
    assert np.allclose(in_m.nodes, in_cm.nodes)


def test_a_small_world_has_its_map_and_walls(tmp_path):
    world = load_world(write(tmp_path), 0)
    assert world.arena.size_m == pytest.approx((4, 3))
    assert world.arena.obstacles[0].polygon.mean(axis=0) == pytest.approx([3.5, 2.5])
    assert [floor_at(world.arena, x, y) for x, y in world.nodes] == ["wood"] * len(world.nodes)
    assert not np.isclose(world.nodes, [3.5, 2.5]).all(axis=1).any()
    assert np.isclose(world.nodes, [0.5, 0.5]).all(axis=1).any()
    length = np.linalg.norm(world.arena.walls[:, 2:] - world.arena.walls[:, :2], axis=1).sum()
    assert length == pytest.approx(2 * (2 + 3) + 2 * (1.9 + 3) - 2 * 1 + 2 * 0.1)
    assert clearance(world.arena, np.array([[2.05, 1.5]]))[0] == pytest.approx(0.5)
    assert clearance(world.arena, np.array([[2.05, 0.5]]))[0] == pytest.approx(0.05)


@pytest.mark.parametrize("paint", ['{ texture = "brick", color = "white" }', '"brick"'])
def test_one_paint_for_all_walls_needs_no_list(tmp_path, paint):
    one, listed = (
        load_world(write(tmp_path, SMALL.replace("[style.plain]", f"[style.plain]\nwalls = {walls}")), 0)
        for walls in (paint, f"[{paint}]")
    )
    bare = load_world(write(tmp_path), 0)
    walls = [[face.albedo for face in world.shell] for world in (one, listed, bare)]
    assert all(map(np.array_equal, walls[0], walls[1]))
    assert not all(map(np.array_equal, walls[0], walls[2]))


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("rect = [2.1, 0, 4, 3]", "rect = [1.5, 0, 4, 3]", "room[1].rect: 'b' overlaps"),
        ("rect = [2, 1, 2.1, 2]", "rect = [0.5, 1, 0.6, 2]", "door[0].rect: reaches 'a'"),
        ("rect = [2, 1, 2.1, 2]", "rect = [2, 2.5, 2.1, 3.5]", "door[0].rect"),
        ("spacing = 0.5", "spacing = -0.5", "library.spacing: found -0.5"),
        ("spacing = 0.5", "spacing = nan", "library.spacing: found nan"),
        ("spacing = 0.5", "spacing = 0.5\nclearance = 2", "no node of the grid is free"),
        ("spacing = 0.5", "spacing = 0.5\ncolour = 1", "library.colour: no such key"),
        ('kind = "block"', 'kind = "throne"', "furniture[0].kind: found 'throne'"),
        ("height = 0.3", 'height = 0.3\npaint = "velvet"', "no texture called 'velvet'; expected one of pl"),
        ("height = 0.3", 'height = 0.3\npaint = { texture = "cloth", color = "blau" }', "no color called"),
        ("height = 0.3", 'height = 0.3\npaint = { image = "no.png" }', "paint.image: there is no file"),
        ("at = [3.5, 2.5]", "at = [2.1, 2.5]", "furniture[0]: the block reaches into a wall"),
        ("size = [0.4, 0.4]", "size = [0.4, -1]", "furniture[0].size"),
        ("size = [0.4, 0.4]", "size = [0.4]", "expected a list of 2 values"),
        ("at = [3.5, 2.5]", "at = [{ from = 3, to = 2 }, 2.5]", "put the smaller first"),
        ('units = "m"', "units = 3", "units: found 3"),
        ('units = "m"', 'units = "m"\nstart = { pose = [2.05, 0.5, 0] }', "start.pose"),
        ('units = "m"', 'units = "m"\nstart = { pose = [0.05, 0.5, 0] }', "a wall through it"),
        ('units = "m"', 'units = "m"\nstart = { pose = [3.5, 2.5, 0] }', "has furniture[0] (block) on it"),
        ('name = "b"', 'name = "a"', "same name"),
        ('style = "plain"', 'style = "fancy"', "room[0].style: found 'fancy'"),
        ("height = 2.5", "height = 1" + "0" * 400, "height: found "),
        ("height = 2.5", "height = inf", "height: found "),
        ("height = 2.5", "height = 1" + "0" * 5000, "cannot be read as TOML"),
        ("height = 2.5", "height = " + 3000 * "[" + 3000 * "]", "cannot be read as TOML"),
        ("[style.plain]", '[style.plain]\nhang = [["a"]]', "style.plain.hang: nothing called ['a'] can hang"),
        ("[style.plain]", "[style.plain]\nhang = []", "expected a list of 1 to 64 values"),
        ('name = "wood"', 'name = "wood"\npaint = { image = "mine.toml" }', "floor[0].paint.image: "),
        (ROOM, f'{ROOM}\nwindows = [{{ wall = "east", at = 1.5 }}]', "looks into 'b' (room[1])"),
        (ROOM, f'{ROOM}\nwindows = [{{ wall = "west", at = 9 }}]', "windows[0]: reaches beyond its wall"),
        (
            ROOM,
            f'{ROOM}\nwindows = [{{ wall = "west", at = 1 }}, {{ wall = "west", at = 1.2 }}]',
            "room[0].windows[1]: is where room[0].windows[0] is",
        ),
        ("[[floor]]", "[[door]]\nrect = [2, 1.5, 2.1, 2.5]\n[[floor]]", "door[1].rect: stands in door[0]"),
        ("[[floor]]", poster("east", 1.5, (1, 1)), "poster[0]: hangs where a door is"),
        ("[[floor]]", poster("north", 9, (1, 1)), "poster[0]: reaches beyond its wall"),
        ("[[floor]]", poster("north", 1, (1, 3)), "poster[0]: reaches beyond its wall"),
        ("format = 1", "format = 2", "format: expected 1"),
        ("format = 1", "format = ", "cannot be read as TOML"),
        ('[[floor]]\nname = "wood"', "", "floor: found none"),
    ],
)  # fmt: skip
def test_bad_worlds_are_refused_with_file_key_and_reason(tmp_path, old, new, said):
    assert old in SMALL
    problem = refusal(write(tmp_path, SMALL.replace(old, new, 1)))
    assert problem.startswith(str(tmp_path / "mine.toml"))
    assert said in problem


def test_other_refusals(tmp_path):
    more = '[[furniture]]\nkind = "plant"\nat = [3.4, 2.4]\nsize = [0.3, 0.3]\n'
    assert "furniture[1]: the plant stands in the block of furniture[0]" in refusal(
        write(tmp_path, SMALL + more)
    )
    with pytest.raises(InputError, match="expected one of office, twins, two-rooms"):
        load_world("three-rooms", 0)
    with pytest.raises(InputError, match="expected one of nominal, dim, hard"):
        load_world("two-rooms", 0, "easy")


def test_images_are_upright_and_made_smaller(tmp_path):
    image = np.zeros((20, 20, 3), np.uint8)
    image[:10] = (0, 0, 255)  # the upper half red, as OpenCV has it
    cv2.imwrite(str(tmp_path / "half.png"), image)
    text = SMALL.replace("height = 0.3", 'height = 0.3\npaint = { image = "half.png" }')
    face = load_world(write(tmp_path, text), 0).furniture[0].faces[0]
    assert face.albedo[1, :, 0].min() > 0.8
    assert face.albedo[-2, :, 0].max() < 0.1
    cv2.imwrite(str(tmp_path / "large.png"), np.full((3000, 1500, 3), 200, np.uint8))
    assert read_image(tmp_path / "large.png").shape == (1024, 512, 3)


def test_a_poster_takes_one_place_and_nothing_else_hangs_there(tmp_path):
    """Its place is drawn once: what is drawn for it keeps the rest of the wall's things away."""
    cv2.imwrite(str(tmp_path / "red.png"), np.full((9, 9, 3), (0, 0, 255), np.uint8))
    drawn = poster("west", 0, (0.5, 0.5)).replace("at = 0", "at = { from = 0.5, to = 2.5 }")
    drawn = drawn.replace("[[floor]]", 'paint = { image = "red.png" }\n[[floor]]')
    text = SMALL.replace("[[floor]]", drawn).replace("[style.plain]", "[style.plain]\nhang_every = 0.6")
    places = set()
    for seed in range(6):
        faces = load_world(write(tmp_path, text), seed).shell
        (red,) = [f for f in faces if f.albedo[1, 1, 0] > 0.8 and f.albedo[1, 1, 1:].max() < 0.1]
        low, high = sorted((red.corner[1], red.corner[1] + red.across[1]))
        places.add(round(float(low), 3))
        for face in faces:
            same_wall = abs(face.corner[0] - red.corner[0]) < 1e-6 and abs(face.across[0]) < 1e-6
            if face is not red and same_wall and abs(face.across[1]) > 0.3:  # sockets may be anywhere
                ends = sorted((face.corner[1], face.corner[1] + face.across[1]))
                assert ends[1] <= low + 1e-6 or high - 1e-6 <= ends[0]
    assert len(places) == 6


@pytest.fixture(scope="module")
def office() -> World:
    return load_world("office", 0)


def test_the_office_is_large_with_rooms_alike_and_can_be_driven_through(office):
    assert office.arena.size_m >= (12, 8)
    assert len(office.arena.rooms) >= 8
    for room in office.arena.rooms:
        assert inside(room.polygon, office.nodes).sum() >= 4, room.name
    for x, y in office.nodes:
        assert floor_at(office.arena, float(x), float(y)) in ("carpet", "wood")


@pytest.mark.slow
@pytest.mark.parametrize("name", shipped_worlds())
def test_shipped_worlds_stand_for_many_seeds(name):
    for seed in range(20, 24):
        assert len(load_world(name, seed).nodes) > 50
