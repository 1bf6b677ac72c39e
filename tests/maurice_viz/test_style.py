from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maurice_mcl.map import Arena
from maurice_viz.panels.traces import ALL_TOGETHER, COLORS, EVIDENCE_COLORS
from maurice_viz.style import (
    BAR,
    LUT,
    MODE_COLORS,
    RGB,
    RUN_COLORS,
    UNITS,
    Scale,
    copy_colors,
    heading_vector,
    packed,
    scale_for,
    units_named,
    weight_colors,
)

INCHES = Scale(UNITS["in"])


PLOT_GROUNDS: tuple[RGB, ...] = ((13, 14, 15), (255, 255, 255))  # of the viewer's dark and light themes
LEAST_CONTRAST = 3.0  # of graphics against their ground (WCAG 2.1, 1.4.11)


def luminance(color: RGB) -> float:
    """Relative luminance as WCAG 2.1 defines it."""
    shares = np.array(color) / 255
    linear = np.where(shares <= 0.03928, shares / 12.92, ((shares + 0.055) / 1.055) ** 2.4)
    return float(linear @ (0.2126, 0.7152, 0.0722))


def contrast(one: RGB, other: RGB) -> float:
    low, high = sorted((luminance(one), luminance(other)))
    return (high + 0.05) / (low + 0.05)


@pytest.mark.parametrize("ground", PLOT_GROUNDS)
@pytest.mark.parametrize("color", {*RUN_COLORS, *EVIDENCE_COLORS, *COLORS.values(), ALL_TOGETHER, BAR})
def test_lines_and_bars_of_plots_are_seen_in_both_themes(color: RGB, ground: RGB) -> None:
    assert contrast(color, ground) >= LEAST_CONTRAST


def test_colors_that_stand_beside_each_other_differ() -> None:
    for colors in (RUN_COLORS, EVIDENCE_COLORS, MODE_COLORS):
        for k, one in enumerate(colors):
            assert all(np.abs(np.subtract(one, other)).max() > 50 for other in colors[:k])


def test_y_is_turned_over_and_nothing_else() -> None:
    drawn = INCHES.screen(np.array([[0.0254, 0.0508], [-0.254, -0.0254]]))
    np.testing.assert_array_equal(drawn, np.array([[1, -2], [-10, 1]], np.float32))


@given(st.floats(-100, 100), st.floats(-100, 100))
def test_drawn_points_are_within_a_rounding_step(x: float, y: float) -> None:
    for units in UNITS.values():
        drawn = Scale(units).screen(np.array([[x, y]]))[0]
        assert drawn == pytest.approx([x * units.per_m, -y * units.per_m], abs=units.fine)


def test_a_heading_to_the_left_points_up_the_screen() -> None:
    np.testing.assert_allclose(heading_vector(np.pi / 2, 3.0), [[0, -3]], atol=1e-6)


def test_a_map_far_away_is_drawn_about_its_middle_without_loss() -> None:
    scale = scale_for("m", Arena((500_000.0, 4_000_000.0, 500_010.0, 4_000_010.0), np.zeros((0, 4))))
    drawn = scale.screen(np.array([[500_005.25, 4_000_006.5]]))
    np.testing.assert_allclose(drawn, [[0.25, -1.5]], atol=1e-3)


def test_lengths_and_poses_are_written_with_their_units() -> None:
    assert INCHES.say(0.254) == "10.0 in"
    assert INCHES.say_area(0.3048**2 * 3) == "3.0 ft2"
    assert Scale(UNITS["m"]).say_area(2.5) == "2.5 m2"
    assert INCHES.say_pose(np.array([0.254, 0.508, np.pi / 2])) == "(10.0, 20.0) in, 90 deg"
    assert Scale(UNITS["m"]).say(0.254) == "0.25 m"


def test_unknown_units_are_refused() -> None:
    with pytest.raises(ValueError, match="furlong"):
        units_named("furlong")


def test_colors_are_packed_red_first() -> None:
    assert packed((1, 2, 3)) == 0x010203FF


def test_an_average_weight_has_the_middle_color_whatever_the_number_of_particles() -> None:
    for n in (1, 10, 5000):
        assert (weight_colors(np.full(n, -np.log(n))) == LUT[127]).all()


def test_heavier_is_brighter_and_the_ends_are_clipped() -> None:
    weights = np.array([0.0, 1e-9, 0.05, 0.25, 0.7])
    with np.errstate(divide="ignore"):
        colors = weight_colors(np.log(weights))
    brightness = [sum(int(c) >> shift & 255 for shift in (24, 16, 8)) for c in colors]
    assert brightness == sorted(brightness)
    assert colors[0] == colors[1] == LUT[0]


def test_more_copies_are_brighter() -> None:
    assert copy_colors(np.array([1, 8])).tolist() == [LUT[127], LUT[255]]
