"""A scan drawn from above: the robot in the middle, what it hit where it is, and the map turned with it."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from maurice_mcl.sensor.laser.parameters import LaserParameters
from maurice_mcl.sensor.laser.rays import Rays
from maurice_mcl.sensor.laser.sensor import Laser
from maurice_mcl.values.laser import FREE, OCCUPIED, UNKNOWN, LaserScan, OccupancyMap
from maurice_mcl.values.session import Frame
from maurice_viz import style
from maurice_viz.drawing import scan as drawing

METERS = style.Scale(style.UNITS["m"])
RUN = style.RUN_COLORS[1]


def room(wide=6.0, high=4.0, cell_m=0.05):
    """A room with walls, seen from its middle at (0, 0); nothing is known of what is outside."""
    cells = np.full((round(high / cell_m) + 40, round(wide / cell_m) + 40), UNKNOWN, np.uint8)
    cells[20:-20, 20:-20] = OCCUPIED
    cells[22:-22, 22:-22] = FREE
    return OccupancyMap(cells, cell_m, np.array([-wide / 2, -high / 2]) - 20 * cell_m)


def scan_from(there, pose, change=lambda ranges: ranges, beams=120):
    laser = Laser(there, LaserParameters(laser_likelihood_max_dist=1.0))
    angles = -np.pi + 2 * np.pi / beams * np.arange(beams)
    ranges = Rays.of(there).cast(np.array([pose]), angles, 10.0)[0]
    return laser, LaserScan(change(ranges.copy()), -np.pi, 2 * np.pi / beams, 0.1, 10.0)


def pixels(data):
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    return cv2.cvtColor(image, cv2.COLOR_BGR2RGB)


def on_map(laser, scan, pose, color=RUN):
    reading = laser.read(Frame(1, 0.0, np.zeros((0, 3)), np.zeros((2, 2, 3), np.uint8), "", scan=scan))
    pose = np.asarray(pose, np.float64)
    judged = laser.judged(reading, pose)
    return pixels(drawing.draw_scan_on_map(reading, judged, pose, laser.occupancy, color, METERS))


def places_of(image, color):
    """Where a color is above the scale's bar, in pixels (K, 2) from the middle: forward, left."""
    rows, columns = np.nonzero((image[: drawing.HEIGHT_PX - 40] == color).all(axis=2))
    return np.column_stack([drawing.MIDDLE[1] - rows, drawing.MIDDLE[0] - columns])


def test_a_scan_is_turned_with_the_robot():
    there = room()
    _, ahead = scan_from(there, [0.0, 0.0, 0.0])
    _, left = scan_from(there, [0.0, 0.0, np.pi / 2])
    px_per_m = drawing.HEIGHT_PX / 2 / drawing.reach_of(ahead)
    hits = places_of(pixels(drawing.draw_scan(ahead, METERS)), style.PALE)
    assert hits[:, 0].max() == pytest.approx(2.9 * px_per_m, abs=4)  # the far wall is ahead
    assert hits[:, 1].max() == pytest.approx(1.9 * px_per_m, abs=4)
    turned = places_of(pixels(drawing.draw_scan(left, METERS)), style.PALE)
    assert turned[:, 1].max() == pytest.approx(2.9 * px_per_m, abs=4)


@pytest.mark.parametrize("pose", [[0.0, 0.0, 0.0], [0.7, -0.4, 2.1]])
def test_at_the_right_pose_every_beam_lies_on_a_wall(pose):
    laser, scan = scan_from(room(), pose)
    image = on_map(laser, scan, pose)
    assert not len(places_of(image, style.SHORT))
    assert not len(places_of(image, style.BEYOND))
    beams, walls = (places_of(image, color) for color in (RUN, drawing.MAPPED_WALL))
    away = np.abs(beams[:, None] - walls[None]).sum(axis=2).min(axis=1)
    assert np.mean(away < 6) > 0.9  # all but the robot's own mark


def test_beams_that_disagree_have_their_own_colors():
    there = room()

    def change(ranges):
        ranges[60:70] = 0.8  # something stands ahead
        ranges[0:10] = 3.6  # and behind the wall is open
        return ranges

    laser, scan = scan_from(there, [0.0, 0.0, 0.0], change)
    image = on_map(laser, scan, [0.0, 0.0, 0.0])
    assert places_of(image, style.SHORT)[:, 0].min() > 0
    beyond = np.concatenate([places_of(image, style.BEYOND), places_of(image, style.UNMAPPED)])
    assert beyond[:, 0].max() < 0


def test_far_off_the_map_and_with_nothing_hit_a_picture_is_drawn():
    laser, scan = scan_from(room(), [0.0, 0.0, 0.0])
    assert not len(places_of(on_map(laser, scan, [500.0, 0.0, 0.0]), drawing.MAPPED_WALL))
    nothing = LaserScan(np.full(9, np.inf, np.float32), -1.0, 0.25, 0.1, 8.0)
    for picture in (drawing.draw_scan(nothing, METERS), drawing.no_scan("no scan at this step")):
        assert pixels(picture).shape == (drawing.HEIGHT_PX + drawing.CAPTION_PX, drawing.WIDTH_PX, 3)


def test_thin_walls_of_a_large_map_are_not_lost():
    cells = np.zeros((3000, 3000), np.uint8)
    cells[:, 1400] = OCCUPIED  # one cell of 2 cm, where a pixel is 20 cm
    there = OccupancyMap(cells, 0.02, np.array([-30.0, -30.0]))
    scan = LaserScan(np.full(60, 29.0, np.float32), -1.5, 0.05, 0.1, 40.0)
    image = on_map(Laser(there), scan, [0.0, 0.0, 0.5])
    assert len(places_of(image, drawing.MAPPED_WALL)) > 200
