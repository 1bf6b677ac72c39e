"""Pictures of the real viewer: every panel is there and shows something, and looks as it did.

`MAURICE_REMAKE_PICTURES=1 .venv/bin/python -m pytest tests/test_pictures.py` makes the stored pictures anew.
"""

from __future__ import annotations

import os
from pathlib import Path

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from maurice_loaders.errors import InputError
from maurice_mcl.values.arrays import U8
from maurice_viz.cli.app import app
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
    "compare": "words 5 100 1595 160; clouds 10 180 520 510; drive words 10 540 520 640; "
    "robot sees 560 230 880 500; first match 900 190 1230 500; second match 1260 190 1590 500; "
    "first histograms 560 540 1590 610; second histograms 560 630 1590 710; events 5 740 1595 830; "
    "errors 30 845 1495 955",
}
FOUR = (
    "words 5 100 1595 160; clouds 10 180 520 510; drive words 10 540 520 640; "
    "pictures 540 200 1590 330; first histograms 560 365 1590 430; last histograms 560 640 1590 710; "
    "events 5 740 1595 830; errors 30 845 1595 955"
)


def panels_of(layout: str) -> dict[str, tuple[int, ...]]:
    """Return where the panels of a layout lie, by name."""
    words = [text.rsplit(" ", 4) for text in PANELS.get(layout, layout).split("; ")]
    return {name: tuple(map(int, box)) for name, *box in words}


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
