"""Pictures of the real viewer: every panel is there and shows something, and looks as it did.

`MAURICE_REMAKE_PICTURES=1 .venv/bin/python -m pytest tests/test_pictures.py` makes the stored pictures anew.
"""

import os
from pathlib import Path

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from maurice_loaders.errors import InputError
from maurice_mcl.arrays import U8
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
    "overview": {
        "belief": (5, 70, 595, 450),
        "words": (5, 510, 595, 600),
        "events": (5, 690, 595, 790),
        "distances": (25, 845, 595, 950),
        "circles": (605, 70, 1095, 480),
        "histogram": (640, 515, 1090, 715),
        "difference": (640, 760, 1090, 945),
        "camera": (1105, 70, 1345, 310),
        "edges": (1355, 70, 1595, 310),
        "best five": (1105, 385, 1595, 510),
        "heading": (1125, 560, 1595, 720),
        "shares": (1125, 775, 1595, 950),
    },
    "inside-a-step": {
        "cloud from near": (60, 100, 540, 570),
        "words": (5, 620, 595, 720),
        "events": (5, 830, 595, 950),
        "likelihood": (610, 100, 1060, 480),
        "headings": (605, 530, 830, 740),
        "camera": (840, 530, 1070, 740),
        "survivors": (620, 790, 1070, 950),
        "film": (1080, 100, 1595, 340),
        "modes": (1100, 390, 1595, 570),
        "evidence": (1100, 610, 1595, 840),
        "key": (1080, 890, 1595, 960),
    },
    "explain": {
        "map": (5, 110, 545, 560),
        "words": (5, 650, 545, 780),
        "camera": (560, 95, 810, 210),
        "truth's": (820, 95, 1070, 360),
        "estimate's": (1080, 95, 1330, 360),
        "winner": (1340, 95, 1595, 360),
        "descriptors": (570, 395, 1595, 475),
        "costs": (570, 520, 1595, 625),
        "table": (560, 680, 1150, 900),
    },
    "traces": {
        "position error": (25, 95, 530, 275),
        "heading error": (25, 320, 530, 500),
        "ratio": (25, 545, 530, 730),
        "rank": (25, 775, 530, 955),
        "spread": (550, 95, 1060, 230),
        "ancestors": (550, 820, 1060, 955),
        "evidence": (1090, 95, 1595, 660),
        "key": (1070, 720, 1595, 790),
        "events": (1070, 830, 1595, 960),
    },
    "compare": {
        "left belief": (5, 95, 510, 465),
        "right belief": (1090, 95, 1595, 465),
        "all on one map": (650, 115, 960, 355),
        "camera": (580, 392, 730, 515),
        "position error": (535, 548, 1080, 645),
        "error minus the first's": (535, 690, 1080, 790),
        "left words": (5, 850, 510, 955),
        "shared words": (525, 840, 880, 955),
        "right words": (1090, 850, 1595, 955),
    },
}
FOUR = {
    "first belief": (5, 130, 310, 400),
    "second belief": (320, 130, 620, 400),
    "last belief": (1290, 130, 1590, 400),
    "first circles": (5, 470, 310, 720),
    "last circles": (1290, 470, 1590, 720),
    "all on one map": (660, 100, 950, 300),
    "position error": (640, 460, 970, 530),
    "apart": (640, 670, 970, 740),
    "shared words": (640, 790, 960, 955),
    "last words": (1290, 760, 1590, 900),
}


def recorded(out: Path, *args: str) -> Path:
    result = CliRunner().invoke(app, [*args, "--save", str(out)])
    assert result.exit_code == 0, result.output
    return out


def taken(viewer: Viewer, timeline: str, value: int) -> U8:
    png = np.frombuffer(viewer.picture(timeline, value), np.uint8)
    return np.asarray(cv2.imdecode(png, cv2.IMREAD_COLOR), np.uint8)


def assert_filled(image: U8, panels: dict[str, tuple[int, int, int, int]]) -> None:
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
        for layout in ("overview", "inside-a-step", "explain", "traces"):
            viewer.show_layout(layout)
            image = taken(viewer, "step", 10)
            assert_filled(image, PANELS[layout])
            assert_looks_as_stored(image, layout)


@pytest.mark.slow
@needs_renderer
def test_steps_and_phases_are_different_pictures(small_session, tmp_path):
    out = recorded(tmp_path / "one.rrd", str(small_session))
    with headless_viewer(out) as viewer:
        first, last, resampled = (
            taken(viewer, *place) for place in (("step", 1), ("step", 14), ("phase", 6 * 14 + 3))
        )
    assert_filled(last, PANELS["overview"])
    assert_filled(resampled, PANELS["overview"])
    assert (first != last).any(axis=2).mean() > 0.02
    belief = (slice(70, 450), slice(5, 595))
    assert (last[belief] != resampled[belief]).any(), "the resampled cloud is another picture"


@pytest.mark.slow
@needs_renderer
def test_a_comparison_is_filled_and_looks_as_it_did(small_session, tmp_path):
    out = recorded(tmp_path / "two.rrd", "compare", str(small_session))
    with headless_viewer(out) as viewer:
        image = taken(viewer, "step", 10)
    assert_filled(image, PANELS["compare"])
    assert_looks_as_stored(image, "compare")


@pytest.mark.slow
@needs_renderer
def test_every_panel_of_four_runs_is_filled(small_session, tmp_path):
    seeds = [f"--seed={seed}" for seed in range(4)]
    out = recorded(tmp_path / "four.rrd", "compare", str(small_session), *seeds)
    with headless_viewer(out) as viewer:
        assert_filled(taken(viewer, "step", 10), FOUR)


def test_another_picture_is_not_as_stored(monkeypatch):
    """The tolerance is none for a panel that is gone."""
    monkeypatch.delenv(REMAKE, raising=False)
    for layout, panels in PANELS.items():
        stored = cv2.imread(str(STORED / f"{layout}.jpg"), cv2.IMREAD_COLOR)
        full = np.asarray(cv2.resize(stored, (1600, 1000)), np.uint8)
        assert_looks_as_stored(full, layout)
        large = max(panels.values(), key=lambda box: (box[2] - box[0]) * (box[3] - box[1]))
        without = full.copy()
        without[large[1] : large[3], large[0] : large[2]] = 16
        with pytest.raises(AssertionError, match="differ"):
            assert_looks_as_stored(without, layout)


@needs_renderer
def test_what_is_no_recording_is_an_error_and_no_hang(tmp_path):
    broken = tmp_path / "broken.rrd"
    broken.write_bytes(b"RRF2 but no more")
    with pytest.raises(InputError), headless_viewer(broken, patience_s=6.0):
        pass


def test_without_a_driver_the_package_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr("maurice_viz.viewer.snapshot.DRIVERS", ())
    with pytest.raises(InputError, match="mesa-vulkan-drivers"), headless_viewer(tmp_path / "any.rrd"):
        pass
