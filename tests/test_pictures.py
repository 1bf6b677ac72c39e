"""Pictures of the real viewer: every panel is there, and shows something."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from maurice_loaders.errors import LogError
from maurice_mcl.typing import U8
from maurice_viz.cli import app
from maurice_viz.snapshot import headless_viewer, software_driver

needs_renderer = pytest.mark.skipif(
    software_driver() is None,
    reason="no software Vulkan driver: apt-get install mesa-vulkan-drivers libvulkan1",
)
# Where the panels of each layout lie in a window of 1600 x 1000: left, top, right, bottom, titles left out.
SINGLE = {
    "belief": (5, 70, 595, 550),
    "text": (5, 590, 595, 720),
    "distances": (5, 760, 595, 950),
    "circles": (605, 70, 1095, 480),
    "histogram": (640, 515, 1090, 715),
    "difference": (640, 760, 1090, 945),
    "camera": (1105, 70, 1345, 310),
    "edges": (1355, 70, 1595, 310),
    "best five": (1105, 365, 1595, 510),
    "heading": (1125, 545, 1595, 720),
    "shares": (1125, 775, 1595, 950),
}
COMPARE = {
    "left belief": (5, 95, 510, 465),
    "right belief": (1090, 95, 1595, 465),
    "all on one map": (650, 115, 960, 355),
    "camera": (580, 392, 730, 515),
    "position error": (535, 548, 1080, 645),
    "error minus the first's": (535, 690, 1080, 790),
    "left words": (5, 850, 510, 955),
    "shared words": (525, 840, 880, 955),
    "right words": (1090, 850, 1595, 955),
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


def pictures(recording: Path, *places: tuple[str, int]) -> list[U8]:
    with headless_viewer(recording) as viewer:
        taken = [viewer.picture(*place) for place in places]
    images = [cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR) for png in taken]
    return [np.asarray(image, np.uint8) for image in images]


def assert_filled(image: U8, panels: dict[str, tuple[int, int, int, int]]) -> None:
    """An empty panel is one flat color; a filled one has edges all over."""
    assert image.shape == (1000, 1600, 3)
    for name, (left, top, right, bottom) in panels.items():
        edges = cv2.Canny(image[top:bottom, left:right], 30, 90)
        assert (edges > 0).mean() > 0.004, f"{name} looks empty"


@needs_renderer
def test_every_panel_of_one_run_is_filled(small_session: Path, tmp_path: Path) -> None:
    out = tmp_path / "one.rrd"
    result = CliRunner().invoke(app, [str(small_session), "--save", str(out)])
    assert result.exit_code == 0, result.output
    # step 1 has traces of one point each, which is no line yet
    first, middle, last, resampled = pictures(
        out, ("step", 1), ("step", 7), ("step", 14), ("phase", 6 * 7 + 3)
    )
    for image in (middle, last, resampled):
        assert_filled(image, SINGLE)
    assert (first != middle).any(axis=2).mean() > 0.02
    belief = (slice(70, 550), slice(5, 595))
    assert (middle[belief] != resampled[belief]).any(), "the resampled cloud is another picture"


@needs_renderer
def test_every_panel_of_a_comparison_is_filled(small_session: Path, tmp_path: Path) -> None:
    out = tmp_path / "two.rrd"
    result = CliRunner().invoke(app, ["compare", str(small_session), "--save", str(out)])
    assert result.exit_code == 0, result.output
    (image,) = pictures(out, ("step", 10))
    assert_filled(image, COMPARE)


@needs_renderer
def test_every_panel_of_four_runs_is_filled(small_session: Path, tmp_path: Path) -> None:
    out = tmp_path / "four.rrd"
    seeds = [f"--seed={seed}" for seed in range(4)]
    result = CliRunner().invoke(app, ["compare", str(small_session), *seeds, "--save", str(out)])
    assert result.exit_code == 0, result.output
    (image,) = pictures(out, ("step", 10))
    assert_filled(image, FOUR)


@needs_renderer
def test_what_is_no_recording_is_an_error_and_no_hang(tmp_path: Path) -> None:
    broken = tmp_path / "broken.rrd"
    broken.write_bytes(b"RRF2 but no more")
    with pytest.raises(LogError), headless_viewer(broken, patience_s=6.0):
        pass


def test_without_a_driver_the_package_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("maurice_viz.snapshot.DRIVERS", ())
    with pytest.raises(LogError, match="mesa-vulkan-drivers"), headless_viewer(tmp_path / "any.rrd"):
        pass
