"""Pictures of the real viewer: every panel is there and shows something, and looks as it did.

`MAURICE_REMAKE_PICTURES=1 .venv/bin/python -m pytest tests/test_pictures.py` makes the stored pictures anew.
"""

from __future__ import annotations

import json
import os
from pathlib import Path

import cv2
import numpy as np
import pytest
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray
from typer.testing import CliRunner

from helpers import viz_fakes as fakes
from helpers.small_session import write_small_session, write_small_survey
from maurice_loaders.errors import InputError
from maurice_mcl.values.arrays import U8
from maurice_viz import style
from maurice_viz.app.compare import MOST_RUNS
from maurice_viz.cli.app import app
from maurice_viz.drawing.canvas import map_extent
from maurice_viz.entities import NODES, STEP
from maurice_viz.panels.views import MAP, plane_view, untitled, window
from maurice_viz.panels.world import draw_world
from maurice_viz.viewer import sinks
from maurice_viz.viewer.snapshot import Viewer, headless_viewer, software_driver

needs_renderer = pytest.mark.skipif(
    software_driver() is None,
    reason="no software Vulkan driver: apt-get install mesa-vulkan-drivers libvulkan1",
)
STORED = Path(__file__).parent / "data" / "pictures"
STORED_SIZE = (800, 500)
REMAKE = "MAURICE_REMAKE_PICTURES"
# Differences of gray levels (0 to 255): letters move by parts of a pixel from one renderer to another, and
# JPEG leaves its own; a panel that is gone or moved changes far more.
MEAN_DIFFERENCE, CLEARLY, CLEARLY_CHANGED = 3.0, 48, 0.02
# Where panels lie in a window of 1600 x 1000: left, top, right, bottom, titles left out.
PANELS = {
    "story": "verdict 5 85 800 125; belief 110 250 600 640; camera 630 195 1010 475; "
    "best match 1150 195 1530 475; tour 785 540 1500 610; events 5 730 1595 820; "
    "errors 30 870 1595 955",
    "overview": "belief 5 100 630 550; words 10 570 630 665; circles 720 135 1110 430; "
    "camera 1180 110 1595 425; "
    "best five 650 440 1590 645; position error 660 680 1115 800; knows 1140 680 1595 800; "
    "events 5 830 1595 950",
    "inside-a-step": "phases 10 70 1590 130; words 10 160 1590 220; before 10 250 540 800; "
    "after 570 250 1100 800; "
    "camera 1130 280 1590 500; weights 1130 600 1590 800; events 5 830 1595 950",
    "explain": "map 60 65 600 540; table 15 565 350 735; sentence 650 90 1590 190; camera 650 260 870 600; "
    "best match 890 260 1110 600; truth's 1130 260 1350 600; estimate's 1370 260 1590 600; "
    "key 645 610 860 765; best match's chart 885 610 1110 815; truth's chart 1125 610 1350 815; "
    "estimate's chart 1365 610 1590 815; events 5 830 1595 950",
    "traces": "position error 20 96 530 240; heading error 20 292 530 436; knows 20 488 530 632; "
    "rank 30 684 530 828; spread 560 96 1060 240; ancestors 560 684 1060 828; "
    "evidence 1100 96 1595 715; key 1075 765 1590 840; events 5 850 1595 950",
    "compare": "words 5 90 1595 130; robot sees 45 200 275 380; first before 330 170 630 380; "
    "first after 645 170 955 380; second before 965 170 1275 380; second after 1285 170 1595 380; "
    "map 20 400 300 600; first match 365 425 595 590; first histograms 650 400 950 600; "
    "second match 1005 425 1235 590; second histograms 1285 400 1590 600; why 10 620 850 690; "
    "drive words 875 620 1590 690; events 5 740 1595 830; errors 30 845 1495 955",
}
FOUR = (
    "words 5 90 1595 130; clouds 300 200 1590 350; robot sees 40 200 240 350; map 20 390 280 560; "
    "matches and histograms 300 390 1590 560; why 10 590 850 660; drive words 875 590 1590 660; "
    "events 5 740 1595 830; errors 30 845 1595 955"
)


def panels_of(layout: str) -> dict[str, tuple[int, ...]]:
    """Return where the panels of a layout lie, by name."""
    words = [text.rsplit(" ", 4) for text in PANELS.get(layout, layout).split("; ")]
    return {name: tuple(map(int, box)) for name, *box in words}


# Colors that are counted in a panel: near enough to be that color, and not its mixture at the edge of a line.
ALIKE = 12  # levels of red, green and blue
COUNTED = {f"run {k + 1}": color for k, color in enumerate(style.RUN_COLORS)}
MAPS = (
    "belief",
    "circles",
    "before",
    "after",
    "map",
    "first before",
    "second after",
)  # panels with walls; letters are as gray
COLORS = STORED / "colors.json"
FEW_PIXELS, COUNT_CHANGED = 60, 0.25  # a difference that may be, of pixels and of their number


def of_color(image: U8, color: style.RGB) -> NDArray[np.bool_]:
    """Return which pixels (H, W) of a picture (H, W, 3) in BGR have a color."""
    return np.asarray((np.abs(image.astype(int) - color[::-1]) <= ALIKE).all(axis=2))


def counted_colors(image: U8, layout: str) -> dict[str, dict[str, int]]:
    """Count the pixels of each color in each panel."""
    counts: dict[str, dict[str, int]] = {}
    for panel, box in panels_of(layout).items():
        colors = COUNTED | ({"walls": style.WALL} if panel in MAPS else {})
        found = {name: int(of_color(image[_within(box)], color).sum()) for name, color in colors.items()}
        counts[panel] = {name: count for name, count in found.items() if count > FEW_PIXELS}
    return counts


def assert_colors_as_stored(image: U8, layout: str) -> None:
    """Compare how many pixels of each panel are walls, or a run's, with those of the stored picture."""
    found = counted_colors(image, layout)
    known = json.loads(COLORS.read_text()) if COLORS.exists() else {}
    if os.environ.get(REMAKE):
        known[layout] = found
        COLORS.write_text(json.dumps(known, indent=1, sort_keys=True) + "\n")
    for panel, counts in known[layout].items():
        for name, count in counts.items():
            off, may_be = abs(found[panel].get(name, 0) - count), FEW_PIXELS + COUNT_CHANGED * count
            assert off <= may_be, (
                f"{layout}, {panel}: {found[panel].get(name, 0)} pixels are {name}, once {count}"
            )


def recolored(image: U8, old: style.RGB, new: style.RGB) -> U8:
    """Return a picture with another color in place of one."""
    changed = image.copy()
    changed[of_color(image, old)] = new[::-1]
    return changed


def recorded(out: Path, *args: str) -> Path:
    result = CliRunner().invoke(app, [*args, "-o", str(out)])
    assert result.exit_code == 0, result.output
    return out


def taken(viewer: Viewer, timeline: str, value: int) -> U8:
    png = np.frombuffer(viewer.picture(timeline, value), np.uint8)
    return np.asarray(cv2.imdecode(png, cv2.IMREAD_COLOR), np.uint8)


def assert_filled(image: U8, panels: dict[str, tuple[int, ...]]) -> None:
    """An empty panel is one flat color; a filled one has edges all over."""
    assert image.shape == (1000, 1600, 3)
    for name, (left, top, right, bottom) in panels.items():
        edges = cv2.Canny(image[top:bottom, left:right], 30, 90)
        assert (edges > 0).mean() > 0.004, f"{name} looks empty"


def assert_looks_as_stored(image: U8, layout: str) -> None:
    """Compare with the stored picture, of half the size; or store it, where that is asked for."""
    path = STORED / f"{layout}.jpg"
    small = cv2.resize(image, STORED_SIZE, interpolation=cv2.INTER_AREA)
    if os.environ.get(REMAKE):
        path.parent.mkdir(parents=True, exist_ok=True)
        cv2.imwrite(str(path), small, [cv2.IMWRITE_JPEG_QUALITY, 90])
    stored = cv2.imread(str(path), cv2.IMREAD_COLOR)
    assert stored is not None, f"{path} is missing; {REMAKE}=1 makes it"
    gray, known = (cv2.cvtColor(one, cv2.COLOR_BGR2GRAY).astype(int) for one in (small, stored))
    apart = np.abs(gray - known)
    assert apart.mean() < MEAN_DIFFERENCE, f"{layout} differs by {apart.mean():.1f} gray levels on average"
    changed = float((apart > CLEARLY).mean())
    assert changed < CLEARLY_CHANGED, f"{changed:.1%} of {layout} are clearly different"


@pytest.mark.slow
@needs_renderer
def test_every_layout_of_one_run_is_filled_and_looks_as_it_did(small_session, tmp_path):
    out = recorded(tmp_path / "one.rrd", str(small_session))
    with headless_viewer(out) as viewer:
        for layout in ("story", "overview", "inside-a-step", "explain", "traces"):
            viewer.show_layout(layout)
            image = taken(viewer, "step", 10)
            assert_filled(image, panels_of(layout))
            assert_looks_as_stored(image, layout)
            assert_colors_as_stored(image, layout)
            if layout == "story" and not os.environ.get(REMAKE):
                assert_faults_are_seen(image, layout, style.WALL, style.RUN_COLORS[0])


def assert_faults_are_seen(image: U8, layout: str, *old: style.RGB) -> None:
    """Plant faults that gray levels on average do not show: one color in place of another."""
    for color in old:
        with pytest.raises(AssertionError, match="pixels are"):
            assert_colors_as_stored(recolored(image, color, style.RUN_COLORS[2]), layout)


@pytest.mark.slow
@needs_renderer
def test_walls_are_seen_whatever_the_number_of_runs(tmp_path):
    """The viewer makes depths of draw orders by the entities of a view (see `style.Order`)."""
    write_small_survey(tmp_path)
    session = write_small_session(tmp_path, carried_at=7)
    for count in range(1, MOST_RUNS + 1):
        command = ["compare", str(session), "--start=global", *(f"--seed={k}" for k in range(count))]
        out = recorded(tmp_path / f"{count}.rrd", *command[count == 1 :])
        with headless_viewer(out) as viewer:
            for layout, step in (("story", 9), ("compare", 1))[: 1 + (count > 1)]:
                viewer.show_layout(
                    layout
                )  # at step 1 the clouds are all over the map, and so is the close-up
                image = taken(viewer, "step", step)
                walls = int(of_color(image[150:560, :480], style.WALL).sum())
                print(count, layout, walls)
                assert walls > 1000, f"{walls} pixels are walls in {layout} of {count} runs"


@needs_renderer
def test_every_layer_is_seen_whatever_the_number_of_entities(tmp_path):
    """One view for each number of entities over the walls: none of them loses its walls, or its nodes."""
    library, side = fakes.make_library(), 8
    scale = style.scale_for("in", library.arena)
    extent = map_extent(library.arena, scale)
    more = [f"/more/{number}" for number in range(side * side)]
    views = [plane_view("x", [*MAP, NODES, *more[:count]], extent) for count in range(side * side)]
    body = untitled(rrb.Vertical(rrb.Grid(*views, grid_columns=side)))
    out = tmp_path / "layers.rrd"
    with sinks.to_file(out, "x", window(body)) as rec:
        draw_world(rec, library, scale)
        for number, path in enumerate(more):
            rec.log(path, rr.Points2D(positions=[], draw_order=100 + number), static=True)
        rec.set_time(STEP, sequence=1)
        rec.log("/any", rr.Scalars(1.0))
    with headless_viewer(out) as viewer:
        image = taken(viewer, "step", 1)
    top, bottom = 40, 965
    for name, color in (("walls", style.WALL), ("nodes", style.NODE)):
        seen = of_color(image, color)[top:bottom]
        cells = [np.array_split(row, side, axis=1) for row in np.array_split(seen, side)]
        counts = np.array([[cell.sum() for cell in row] for row in cells])
        assert counts.min() > 0.7 * np.median(counts) > 20, f"{name}: {counts.tolist()}"


@pytest.mark.slow
@needs_renderer
def test_steps_and_phases_are_different_pictures(small_session, tmp_path):
    out = recorded(tmp_path / "one.rrd", str(small_session))
    with headless_viewer(out) as viewer:
        viewer.show_layout("overview")
        first, last, predicted = (
            taken(viewer, *place) for place in (("step", 1), ("step", 14), ("phase", 6 * 14))
        )
    assert_filled(last, panels_of("overview"))
    assert_filled(predicted, panels_of("overview"))
    assert (first != last).any(axis=2).mean() > 0.02
    belief = (slice(70, 450), slice(5, 595))
    assert (last[belief] != predicted[belief]).any(), "the predicted cloud is another picture"


@pytest.mark.slow
@needs_renderer
def test_a_comparison_is_filled_and_looks_as_it_did(small_session, tmp_path):
    out = recorded(tmp_path / "two.rrd", "compare", str(small_session))
    with headless_viewer(out) as viewer:
        viewer.show_layout("compare")
        image = taken(viewer, "step", 10)
    assert_filled(image, panels_of("compare"))
    assert_looks_as_stored(image, "compare")
    assert_colors_as_stored(image, "compare")
    if not os.environ.get(REMAKE):
        assert_faults_are_seen(image, "compare", *style.RUN_COLORS[:2])


@pytest.mark.slow
@needs_renderer
def test_every_panel_of_four_runs_is_filled(small_session, tmp_path):
    seeds = [f"--seed={seed}" for seed in range(4)]
    out = recorded(tmp_path / "four.rrd", "compare", str(small_session), *seeds)
    with headless_viewer(out) as viewer:
        viewer.show_layout("compare")
        assert_filled(taken(viewer, "step", 10), panels_of(FOUR))


def _within(box: tuple[int, ...]) -> tuple[slice, slice]:
    left, top, right, bottom = box
    return slice(top, bottom), slice(left, right)


def test_another_picture_is_not_as_stored(monkeypatch):
    """The tolerance is none for a panel that is gone."""
    monkeypatch.delenv(REMAKE, raising=False)
    for layout in PANELS:
        stored = cv2.imread(str(STORED / f"{layout}.jpg"), cv2.IMREAD_COLOR)
        full = np.asarray(cv2.resize(stored, (1600, 1000)), np.uint8)
        assert_looks_as_stored(full, layout)
        # the panel that shows most: a large plot of thin lines on black is hardly brighter than none
        large = max(
            panels_of(layout).values(), key=lambda box: (np.maximum(full[_within(box)], 40) - 40).sum()
        )
        without = full.copy()
        without[_within(large)] = 16
        with pytest.raises(AssertionError, match="differ"):
            assert_looks_as_stored(without, layout)


@needs_renderer
def test_what_is_no_recording_is_an_error_and_no_hang(tmp_path):
    broken = tmp_path / "broken.rrd"
    broken.write_bytes(b"RRF2 but no more")
    with pytest.raises(InputError), headless_viewer(broken, patience_s=2.0):
        pass


def test_without_a_driver_the_package_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr("maurice_viz.viewer.snapshot.DRIVER_FOLDERS", ())
    with pytest.raises(InputError, match="mesa-vulkan-drivers"), headless_viewer(tmp_path / "any.rrd"):
        pass
