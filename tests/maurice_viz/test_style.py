from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maurice_mcl.values.map import Arena
from maurice_viz import style
from maurice_viz.drawing.histogram_row import BARS
from maurice_viz.entities import Phase, RunPaths, phase_number
from maurice_viz.panels.traces import ALL_TOGETHER, MARKS

INCHES = style.Scale(style.UNITS["in"])


PLOT_GROUNDS: tuple[style.RGB, ...] = ((13, 14, 15), (255, 255, 255))  # of the viewer's dark and light themes
LEAST_CONTRAST = 3.0  # of graphics against their ground (WCAG 2.1, 1.4.11)


def luminance(color: style.RGB) -> float:
    """Relative luminance as WCAG 2.1 defines it."""
    shares = np.array(color) / 255
    linear = np.where(shares <= 0.03928, shares / 12.92, ((shares + 0.055) / 1.055) ** 2.4)
    return float(linear @ (0.2126, 0.7152, 0.0722))


def contrast(one: style.RGB, other: style.RGB) -> float:
    low, high = sorted((luminance(one), luminance(other)))
    return (high + 0.05) / (low + 0.05)


@pytest.mark.parametrize("ground", PLOT_GROUNDS)
@pytest.mark.parametrize(
    "color",
    {
        *style.RUN_COLORS,
        *style.CHANNEL_COLORS,
        style.PICTURE,
        style.REFERENCE,
        style.ODOMETRY,
        style.LOST,
        style.BAR,
    },
)
def test_lines_and_bars_of_plots_are_seen_in_both_themes(color, ground):
    assert contrast(color, ground) >= LEAST_CONTRAST


def test_colors_that_stand_beside_each_other_differ():
    for colors in (style.RUN_COLORS, style.MODE_COLORS):
        for k, one in enumerate(colors):
            assert all(np.abs(np.subtract(one, other)).max() > 50 for other in colors[:k])


def test_places_are_scaled_and_turned():
    drawn = INCHES.screen(np.array([[0.0254, 0.0508], [-0.254, -0.0254]]))
    np.testing.assert_array_equal(drawn, np.array([[1, -2], [-10, 1]], np.float32))
    np.testing.assert_allclose(style.heading_vector(np.pi / 2, 3.0), [[0, -3]], atol=1e-6)
    scale = style.scale_for("m", Arena((500_000.0, 4_000_000.0, 500_010.0, 4_000_010.0), np.zeros((0, 4))))
    drawn = scale.screen(np.array([[500_005.25, 4_000_006.5]]))
    np.testing.assert_allclose(drawn, [[0.25, -1.5]], atol=1e-3)


@given(st.floats(-100, 100), st.floats(-100, 100))
def test_drawn_points_are_within_a_rounding_step(x, y):
    for units in style.UNITS.values():
        drawn = style.Scale(units).screen(np.array([[x, y]]))[0]
        assert drawn == pytest.approx([x * units.per_m, -y * units.per_m], abs=units.fine)


def test_units_are_written_and_known():
    assert INCHES.say(0.254) == "10.0 in"
    assert INCHES.say_area(0.3048**2 * 3) == "3.0 ft2"
    assert style.Scale(style.UNITS["m"]).say_area(2.5) == "2.5 m2"
    assert INCHES.say_pose(np.array([0.254, 0.508, np.pi / 2])) == "(10.0, 20.0) in, 90 deg"
    assert style.Scale(style.UNITS["m"]).say(0.254) == "0.25 m"
    with pytest.raises(ValueError, match="furlong"):
        style.units_named("furlong")


def test_colors_follow_weights_and_copies():
    assert style.packed((1, 2, 3)) == 0x010203FF
    for n in (1, 10, 5000):
        assert (style.weight_colors(np.full(n, -np.log(n))) == style.LUT[127]).all()
    weights = np.array([0.0, 1e-9, 0.05, 0.25, 0.7])
    with np.errstate(divide="ignore"):
        colors = style.weight_colors(np.log(weights))
    brightness = [sum(int(c) >> shift & 255 for shift in (24, 16, 8)) for c in colors]
    assert brightness == sorted(brightness)
    assert colors[0] == colors[1] == style.LUT[0]


def test_phases_and_paths_follow_the_label():
    numbers = [phase_number(step, slot) for step in (1, 2) for slot in Phase]
    assert numbers == list(range(6, 18))
    assert RunPaths("color").particles == "/color/belief/particles"


@pytest.mark.parametrize("label", ["", "world", "session", "a/b"])
def test_labels_that_would_collide_are_refused(label):
    with pytest.raises(ValueError, match="label"):
        RunPaths(label)


# A difference of 1 in CIELAB (CIE 1976) can just be seen; of 20, two marks are called by two names.
LEAST_DIFFERENCE, LEAST_WITHOUT_ONE = 20.0, 10.0
TO_XYZ = np.array([[0.4125, 0.3576, 0.1804], [0.2127, 0.7152, 0.0722], [0.0193, 0.1192, 0.9503]])
# Machado, Oliveira and Fernandes, 2009: eyes that lack red, green or blue
PROTANOPIA = np.array([[0.152, 1.053, -0.205], [0.115, 0.786, 0.099], [-0.004, -0.048, 1.052]])
DEUTERANOPIA = np.array([[0.367, 0.861, -0.228], [0.280, 0.673, 0.047], [-0.012, 0.043, 0.969]])
TRITANOPIA = np.array([[1.256, -0.077, -0.179], [-0.078, 0.931, 0.148], [0.005, 0.691, 0.304]])


def lab(color: style.RGB, seen: np.ndarray) -> np.ndarray:
    """Return L*, a*, b* (D65) of an sRGB color, as seen by an eye that mixes linear colors like this."""
    shares = np.array(color) / 255
    linear = np.where(shares <= 0.04045, shares / 12.92, ((shares + 0.055) / 1.055) ** 2.4)
    relative = TO_XYZ @ np.clip(seen @ linear, 0, 1) / TO_XYZ.sum(axis=1)
    root = np.where(relative > (6 / 29) ** 3, np.cbrt(relative), relative / (3 * (6 / 29) ** 2) + 4 / 29)
    return np.array([116 * root[1] - 16, 500 * (root[0] - root[1]), 200 * (root[1] - root[2])])


CHANNELS = {f"channel {number}": color for number, color in enumerate(style.CHANNEL_COLORS, 1)}
RUNS = {f"run {number}": color for number, color in enumerate(style.RUN_COLORS, 1)}
LINES = {"all channels": ALL_TOGETHER, **{name: color for name, color, _ in MARKS if color != style.PALE}}
OF_HISTOGRAMS = {"picture": style.PICTURE, "reference": style.REFERENCE, "neither": style.BAR}
ON_MAPS = RUNS | {  # every mark that stands on a map by itself
    "truth": style.TRUTH,
    "particles": style.CLOUD,
    "fresh particles": style.FRESH,
    "dead particles": style.DEAD,
    "weight": style.WEIGHT,
    "references": style.CIRCLE,
    "best references": style.RANK,
    "beams that end short": style.SHORT,
    "beams that end beyond": style.BEYOND,
    "beams that end in unknown space": style.UNMAPPED,
    **{f"mode {number}": color for number, color in enumerate(style.MODE_COLORS, 1)},
}
MEETINGS = {  # meanings that stand on one view, or on one screen
    "maps": ON_MAPS,
    "plots": RUNS | LINES,
    "evidence": RUNS | CHANNELS | LINES,
    "charts": RUNS | CHANNELS | OF_HISTOGRAMS,
    **{f"histograms of runs {bars}": RUNS | {"bars": bars} for bars in BARS},  # each in a chart of its own
    "lanes": RUNS | {"lost": style.STATES["lost"], "what the log says": style.PALE},
    "drives": {"odometry": style.ODOMETRY, "truth": style.TRUTH, "truth in plots": style.BAR} | RUNS,
}


@pytest.mark.parametrize(
    ("seen", "least"),
    [
        (np.eye(3), LEAST_DIFFERENCE),
        (PROTANOPIA, LEAST_WITHOUT_ONE),
        (DEUTERANOPIA, LEAST_WITHOUT_ONE),
        (TRITANOPIA, LEAST_WITHOUT_ONE),
    ],
)
@pytest.mark.parametrize("view", MEETINGS)
def test_one_meaning_a_color(view, seen, least):
    places = {meaning: lab(color, seen) for meaning, color in MEETINGS[view].items()}
    for first, second in combinations(places, 2):
        assert np.linalg.norm(places[first] - places[second]) >= least, (first, second)
