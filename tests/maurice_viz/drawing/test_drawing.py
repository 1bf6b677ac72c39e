"""Drawn on pixels or as bars: grounds of maps, keys, texts, histograms and their tensors."""

from __future__ import annotations

from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from helpers import viz_fakes as fakes
from maurice_mcl.sensor.laser.rays import cast
from maurice_mcl.sensor.laser.sensor import Laser
from maurice_mcl.values.laser import FREE, OCCUPIED, UNKNOWN, LaserScan, OccupancyMap
from maurice_mcl.values.map import Arena
from maurice_viz.drawing import keys
from maurice_viz.drawing.canvas import (
    LONG_SIDE_PX,
    MAP_MARGINS,
    MAP_TEXT_SHARE,
    MOST_TICKS,
    Extent,
    ascii_of,
    blank,
    cells_in,
    draw_ground,
    known_part,
    put_text,
    shown_bounds,
    text_size,
    ticks,
)
from maurice_viz.drawing.indexed import INK_LEVELS, IndexedColors, write
from maurice_viz.drawing.reference_chart import TEXT_SHARE
from maurice_viz.drawing.scan import draw_ranges
from maurice_viz.style import (
    GROUND,
    OBSTACLE,
    PALE,
    RUN_COLORS,
    scale_for,
)


@pytest.mark.parametrize(
    ("low", "high", "smallest", "expected"),
    [
        (0, 204, 12, [0, 24, 48, 72, 96, 120, 144, 168, 192]),
        (0, 36, 12, [0, 12, 24, 36]),
        (-1, 1, 0.5, [-1, -0.5, 0, 0.5, 1]),
        (10.2, 10.4, 0.5, []),
    ],
)
def test_ticks(low, high, smallest, expected):
    assert ticks(low, high, smallest) == pytest.approx(expected)


@pytest.mark.parametrize("side", [0.7, 5, 42, 333, 9_999, 1e6])
def test_ticks_are_never_too_many(side):
    assert len(ticks(0, side, 0.5)) <= MOST_TICKS
    assert len(ticks(0, side, 0.5)) >= min(MOST_TICKS // 3, int(side / 0.5))


def test_a_side_with_little_room_has_fewer_ticks():
    """The narrow side of a street: labels lay over each other."""
    assert ticks(-1.2, 1.8, 0.5, 1.7) == [0.0]
    assert ticks(-1.2, 1.8, 0.5, 2.5) == [0.0, 1.5]
    assert ticks(0, 60, 0.5, 2.5) == [0.0, 25.0, 50.0]


def test_ground_shows_obstacles_and_floors():
    arena = fakes.arena(5, 4)
    scale = scale_for("in", arena)
    ground = draw_ground(arena, scale)
    inside = scale.screen(np.array([[0.11, 0.76], [0.6, 0.5]]) * arena.size_m)
    at = ((inside - (ground.extent.left, ground.extent.top)) / ground.unit_per_px).round().astype(int)
    assert tuple(ground.image[at[0, 1], at[0, 0]]) == OBSTACLE
    assert tuple(ground.image[at[1, 1], at[1, 0]]) != OBSTACLE
    image = draw_ground(arena, scale_for("in", arena)).image
    rows, columns = image.shape[:2]
    wood, carpet = image[rows // 2, columns // 3].astype(int), image[rows // 2, columns * 2 // 3].astype(int)
    assert abs(wood - carpet).sum() > 30


@pytest.mark.parametrize(
    "bounds", [(0, 0, 5, 0.5), (0, 0, 0.5, 5), (500_000, 0, 500_020, 10), (0, 0, 0.01, 0.01)]
)
def test_any_shape_of_arena_can_be_drawn(bounds):
    arena = Arena(bounds, np.zeros((0, 4)))
    image = draw_ground(arena, scale_for("m", arena)).image
    assert max(image.shape) == LONG_SIDE_PX


WIDE, TALL = (Arena((0.0, 0.0, *size), np.zeros((0, 4))) for size in ((8.0, 4.0), (4.0, 10.0)))


def has_color(image, color) -> bool:
    return bool((image == np.array(color, np.uint8)).all(axis=2).any())


@pytest.mark.parametrize("color", RUN_COLORS)
def test_keys_show_the_estimate_in_its_runs_color(color):
    drawn = keys.keys_of(True, color, is_recorded=False, arena=WIDE)
    assert has_color(keys.explain_key(True, color), color)
    assert all(has_color(key, color) for name, key in drawn.items() if name != keys.MATCHES)
    (recorded,) = keys.keys_of(True, color, is_recorded=True, arena=WIDE).values()
    assert has_color(recorded, color)


def test_letters_of_a_key_are_larger_where_the_map_is_narrow():
    """A key is as wide as its map; nothing of it is cut off."""
    wide, tall = (keys.keys_of(True, RUN_COLORS[0], is_recorded=False, arena=arena) for arena in (WIDE, TALL))
    for name in (keys.WEIGHTS, keys.LIKELIHOOD):
        assert len(tall[name]) > 1.3 * len(wide[name])
        assert (tall[name][:, -4:] == np.array(GROUND, np.uint8)).all()


def test_a_key_is_drawn_once_and_stays_as_it_was():
    """Every layout of every run asks for all of them."""
    first, again = (keys.keys_of(True, RUN_COLORS[0], is_recorded=False, arena=WIDE) for _ in range(2))
    for name, key in first.items():
        assert key is again[name]
        with pytest.raises(ValueError, match="read-only"):
            key[0, 0] = 0


def test_text_in_the_font():
    assert ascii_of("café 床") == "cafe ?"
    assert text_size("ab", 20)[0] > text_size("a", 20)[0]


def decoded(png: bytes) -> np.ndarray:
    return cv2.cvtColor(cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB)


def test_a_drawing_of_palette_colors_is_read_back_as_it_was_drawn():
    palette = IndexedColors()
    first = [palette.flat(GROUND), palette.ramp((0, 0, 0), (255, 0, 0)), palette.flat(PALE)]
    assert first == [0, 1, 1 + INK_LEVELS]
    image = np.random.default_rng(0).integers(0, len(palette.colors), (37, 53)).astype(np.uint8)
    for some in (image, image[:1], image[:, :1]):
        np.testing.assert_array_equal(decoded(palette.png(some)), palette.colors[some])


@pytest.mark.parametrize("at", [(5.2, 30.0), (-20.0, 12.0), (70.0, 38.0), (10.0, 500.0), (-900.0, -3.0)])
def test_palette_letters_are_those_of_the_canvas_also_at_the_edge(at):
    palette = IndexedColors()
    ink = palette.ramp(GROUND, PALE)
    image, expected = np.full((40, 120), ink, np.uint8), blank(40, 120, GROUND)
    write(image, "Agj 12.5", *at, 14.0, ink)
    put_text(expected, "Agj 12.5", *at, 14.0, PALE)
    assert np.abs(palette.colors[image].astype(int) - expected).max() <= 255 / INK_LEVELS
    assert (image != ink).any() == (expected != GROUND).any()


CAPITALS_PX = 8.0  # of letters of 11 px
MAP_PX, CHART_PX = 450, 220  # widths on a screen of 1600 x 1000: a map with its margins, a reference's chart


def test_words_of_the_story_and_of_explanations_can_be_read():
    assert keys.BELIEF_PX / keys.WIDTH_PX * MAP_PX >= CAPITALS_PX
    assert keys.TEXT_PX / keys.ROWS_PX * MAP_PX >= CAPITALS_PX
    assert MAP_TEXT_SHARE / (1 + MAP_MARGINS["left"] + MAP_MARGINS["right"]) * MAP_PX >= CAPITALS_PX
    assert 0.85 * TEXT_SHARE * CHART_PX >= CAPITALS_PX


def test_an_occupancy_map_keeps_walls_that_are_thinner_than_a_pixel():
    cells = np.zeros((2000, 1000), np.uint8)
    cells[1500:] = UNKNOWN
    cells[:, 500] = OCCUPIED
    free, occupied = cells_in(OccupancyMap(cells, 0.05, np.zeros(2)), (250, 500))
    assert free.shape == occupied.shape == (500, 250)
    assert occupied[:, 125].all()
    assert not free[:120].any()  # the top of a drawing is the highest y
    assert free[130:, :120].all()


def test_of_a_large_grid_the_part_is_shown_that_is_known():
    cells = np.full((4000, 4000), UNKNOWN, np.uint8)
    cells[3000:3200, 1000:1400] = 0
    grid = OccupancyMap(cells, 0.05, np.array([-10.0, 0.0]))
    arena = Arena(grid.bounds, np.zeros((0, 4)), occupancy=grid)
    low, high = np.array([-10 + 50.0, 150.0]), np.array([-10 + 70.0, 160.0])
    np.testing.assert_allclose(shown_bounds(arena), [*(low - 0.5), *(high + 0.5)])
    nothing = OccupancyMap(np.full((10, 10), UNKNOWN, np.uint8), 0.05, np.zeros(2))
    assert known_part(nothing) is nothing
    bare = Arena((0.0, 0.0, 3.0, 2.0), np.zeros((0, 4)))
    assert shown_bounds(bare) == bare.bounds


def test_ranges_are_drawn_from_left_to_right_wherever_the_laser_begins():
    """A laser that sees all around may count its beams from any of them."""
    cells = np.full((80, 80), FREE, np.uint8)
    cells[[0, -1]] = cells[:, [0, -1]] = cells[50:60, 60:70] = OCCUPIED
    laser, pose, step = (
        Laser(OccupancyMap(cells, 0.1, np.zeros(2))),
        np.array([3.0, 3.0, 0.4]),
        2 * np.pi / 60,
    )
    angles = step * np.arange(60)
    ranges = cast(laser.occupancy, pose, angles, 8.0)[0]
    pictures = []
    for first in (0, 17, 43):
        scan = LaserScan(np.roll(ranges, -first), float(angles[first]) + 1e-9, step, 0.05, 8.0)
        reading = laser.read(SimpleNamespace(scan=scan))
        pictures.append(
            draw_ranges(laser.judged(reading, pose), reading, RUN_COLORS[0], scale_for("m", WIDE))
        )
    assert pictures[0] == pictures[1] == pictures[2]


IN, OVER, OUT = np.float32([[2, -1.5], [3, -1], [9, -1]])


def test_an_outline_ends_at_the_sides_of_the_map_unless_it_is_wholly_outside():
    extent, angles = Extent(0.0, 4.0, -3.0, 0.0), np.linspace(0, 2 * np.pi, 33)
    circle = np.column_stack([np.cos(angles), np.sin(angles)]).astype(np.float32)
    inside, over, outside = (size * circle + at for size, at in ((1, IN), (2, OVER), (1, OUT)))
    assert np.array_equal(extent.cut(inside), inside)
    assert np.array_equal(extent.cut(outside), outside)
    cut = extent.cut(over)
    within = (over >= [0, -3]).all(axis=1) & (over <= [4, 0]).all(axis=1)
    assert np.array_equal(cut[within], over[within])
    assert cut.min(axis=0) == pytest.approx([1, -3])
    assert cut.max(axis=0) == pytest.approx([4, 0])
