from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import rerun.blueprint as rrb

from helpers import viz_fakes as fakes
from helpers.viz_recordings import scene_of
from maurice_loaders.formats.registry import open_session
from maurice_loaders.libraries.store import open_library
from maurice_viz.drawing import keys
from maurice_viz.drawing.canvas import arena_extent, map_extent
from maurice_viz.entities import RunPaths
from maurice_viz.layouts import one_run, story
from maurice_viz.layouts.compare import ERRORS_PX as COMPARED_ERRORS_PX
from maurice_viz.layouts.compare import compare
from maurice_viz.layouts.registry import runs_blueprint
from maurice_viz.layouts.story import ERRORS_PX
from maurice_viz.panels.story import error_axis, letters_beside, map_share
from maurice_viz.panels.traces import MOST_LETTERS
from maurice_viz.running.output import layout_of
from maurice_viz.scene import RunView, Scene, numbered
from maurice_viz.style import scale_for
from maurice_viz.text.tour import LETTERS

ARENA = fakes.arena(5, 4)
EDGES = RunView("edges", ("edges",))
COLOR, BLENDED = RunView("color", ("color",)), RunView("blended", ("color", "edges"))


def shown(has_truth: bool = True) -> Scene:
    return scene_of(ARENA, "in", has_truth)


def views(part: rrb.Container | rrb.View) -> Iterator[rrb.View]:
    if isinstance(part, rrb.View):
        yield part
    else:
        for inner in part.contents:
            yield from views(inner)


def overview_of(run: RunView, shown: Scene) -> rrb.Blueprint:
    return rrb.Blueprint(one_run.overview(run, shown))


def titles(layout: rrb.Blueprint) -> list[str]:
    return [str(view.name) for view in views(layout.root_container)]


@pytest.mark.parametrize("has_truth", [True, False])
@pytest.mark.parametrize("runs", [[BLENDED], [COLOR, BLENDED], [COLOR, BLENDED, EDGES]])
def test_every_view_has_a_title_of_its_own(runs, has_truth):
    found = titles(runs_blueprint(runs, shown(has_truth)))
    assert all(found)
    assert any("error" in title for title in found) == has_truth


def test_titles_have_units_and_are_unique():
    found = titles(overview_of(BLENDED, shown()))
    assert len(found) == len(set(found))
    for title in titles(overview_of(BLENDED, shown())):
        if "Position" in title or "Belief" in title or "Spread" in title:
            assert "(in)" in title
        if "Heading" in title:
            assert "(deg)" in title


def test_a_title_is_short_or_not_shown():
    runs = numbered([COLOR, BLENDED, replace(EDGES, label="edges with a long name")])
    layouts = [one_run.overview, one_run.explain, one_run.sensors, one_run.recorded, one_run.inside_a_step]
    screens = [layout(BLENDED, shown()) for layout in layouts] + [
        story.traces(runs, shown()),
        compare(runs, shown()),
    ]
    for view in (view for screen in screens for view in views(screen)):
        assert view.titlebar is False or len(str(view.name)) <= MOST_LETTERS, view.name


def test_runs_without_a_camera_have_no_tab_of_pictures_beside_runs_with_one():
    runs = numbered([COLOR, RunView("amcl", ())])
    tabs = runs_blueprint(runs, shown()).root_container.contents[0].contents
    for tab in (tab for tab in tabs if str(tab.name) in ("overview", "explain")):
        assert [str(part.name) for part in tab.contents] == ["color"]


def test_map_views_hold_the_arena_and_leave_keys_out():
    limits = arena_extent(ARENA, scale_for("in", ARENA))
    extent = map_extent(ARENA, scale_for("in", ARENA))
    assert extent.left < limits.left < limits.right < extent.right
    assert extent.top < limits.top < limits.bottom < extent.bottom
    assert extent.width < 1.2 * limits.width
    paths = RunPaths(BLENDED.label)
    for view in views(overview_of(BLENDED, shown()).root_container):
        above = {str(path) for path in view.contents if "/key/" in str(path)}
        if "Belief" in str(view.name):
            assert above == {paths.key(keys.WEIGHTS)}
        if "circles" in str(view.name):
            assert above == {paths.key(keys.MATCHES)}


def test_beside_a_wide_map_there_is_room_for_fewer_words():
    """Along a street the last line of the words was cut."""
    square, street, tower = (scene_of(fakes.arena(*size), "m") for size in ((5, 4), (60, 3), (3, 60)))
    assert [map_share(2, scene) for scene in (street, tower)] == [0.5, 0.3]
    assert letters_beside(2, street) < 0.8 * letters_beside(2, tower)
    assert letters_beside(2, street) < letters_beside(2, square) <= letters_beside(2, tower) == LETTERS
    assert letters_beside(4, square) < letters_beside(3, square)


def test_recorded_localizers_are_compared_on_one_map():
    runs = numbered([RunView("amcl", ()), RunView("particle_cloud_of_nav2", ())])
    compared = runs_blueprint(runs, shown()).root_container.contents[0]
    assert str(compared.name) == "compare"
    found = [str(view.name) for view in views(compared)]
    assert {"Where matches were taken", "After", "This step", "Whole drive", "Position error"} <= set(found)
    assert "Before" not in found  # its phases are not known
    assert "This step" not in titles(runs_blueprint(runs[:1], shown()))


@pytest.mark.parametrize("has_truth", [True, False])
def test_a_run_without_channels_has_no_views_of_comparisons(has_truth):
    """As another localizer's, of which nothing was compared here."""
    found = titles(runs_blueprint([RunView("amcl", ())], shown(has_truth)))
    assert all(found)
    assert any("error" in title for title in found) == has_truth
    assert not any("Match" in title or "vidence" in title or "reference" in title for title in found)


@pytest.mark.parametrize(("most_m", "last_label"), [(0.1, 30), (0.5, 30), (2.0, 100), (4.0, 100), (9.0, 300)])
def test_the_error_axis_holds_the_largest_error_and_the_limit_and_has_a_label(most_m, last_label) -> None:
    axis = error_axis([COLOR], replace(shown(), most_m=most_m), ERRORS_PX)
    assert axis is not None
    assert axis.last_label == last_label
    assert axis.top > max(last_label, most_m / 0.0254, 36)  # in inches, as the limit
    assert error_axis([COLOR], shown(), ERRORS_PX) is None


@pytest.mark.parametrize("height_px", [ERRORS_PX, COMPARED_ERRORS_PX])
def test_labels_of_the_error_axis_are_far_enough_apart_to_be_drawn(height_px) -> None:
    """The viewer (0.41) labels powers of ten alone; nearer than 21 pixels it drops all but zero."""
    for most_m in np.geomspace(0.5, 300, 100):
        axis = error_axis([COLOR], replace(shown(), most_m=float(most_m)), height_px)
        assert axis is not None
        apart = 10 ** np.floor(np.log10(axis.last_label)) / axis.top
        assert apart * (height_px - 16) > 21


def test_light_recordings_offer_only_layouts_whose_panels_are_filled() -> None:
    tabs = runs_blueprint([COLOR, BLENDED], shown(), light=True).root_container.contents
    assert [tab.name for tab in tabs] == ["story", "traces"]


def test_a_run_without_channels_beside_one_with_them_has_no_tab_about_channels() -> None:
    sensed = RunView("sensed", ())
    tabs = {str(tab.name): tab for tab in runs_blueprint([COLOR, sensed], shown()).root_container.contents}
    assert {"overview", "explain", "compare"} <= set(tabs)
    assert [str(tab.name) for tab in tabs["inside-a-step"].contents] == ["color", "sensed"]
    assert "Histograms of sensed" not in {str(view.name) for view in views(tabs["compare"])}


@pytest.mark.parametrize("has_pictures", [True, False])
def test_inside_a_step_has_short_titles_and_no_bars(has_pictures: bool) -> None:
    scene = replace(shown(), has_pictures=has_pictures)
    found = list(views(one_run.inside_a_step(RunView("a", ()), scene)))
    assert all(len(str(view.name)) <= 25 for view in found)
    assert not any(view.titlebar for view in found)
    names = {str(view.name) for view in found}
    assert {"Phases", "Before", "After", "Weights"} <= names
    assert ("The robot sees" in names) == has_pictures


def test_a_run_without_channels_has_no_plot_of_what_pictures_say_and_a_key() -> None:
    found = {str(view.name) for view in views(story.traces([RunView("sensed", ())], shown()))}
    assert {"Position error (in)", "Spread (in)", "Key"} <= found
    assert not {"Knows where it is (0-1)", "Rank of the true place", "Evidence (nats)"} & found


@pytest.mark.parametrize(("live", "state"), [(True, "following"), (False, "paused")])
def test_the_time_goes_along_with_a_drive_that_is_going_on(
    live: bool, state: str, small_session: Path
) -> None:
    info = open_session(small_session).info
    assert info.survey is not None
    scene = Scene(info, open_library(info.survey, keep_going=False), has_truth=True, live=live)
    layout = layout_of([RunView("blended", ("color",), None)], scene)
    assert layout.time_panel.play_state == state
