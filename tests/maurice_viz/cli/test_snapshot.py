"""`maurice-replay snapshot`, as a person types it; with the real viewer where a renderer is there."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from helpers.commands import maurice, one_line
from maurice_viz.viewer.snapshot import software_driver

needs_renderer = pytest.mark.skipif(
    software_driver() is None,
    reason="no software Vulkan driver: apt-get install mesa-vulkan-drivers libvulkan1",
)


def shape(file: Path) -> tuple[int, ...]:
    image = cv2.imread(str(file))
    assert (cv2.Canny(image, 30, 90) > 0).mean() > 0.004, "looks empty"
    return image.shape


WRONG = """
-o a.jpg|-o a.avi|-o a.png --phase all|-o a.png --from 2|-o a.mp4 --step 2|-o a.mp4 --from 5 --to 2|
-o a.png --phase think|-o a.png --size 16x9|-o a.png --size big|-o a.png --layout none-such|
"""


@pytest.mark.parametrize("words", WRONG.split("|"))
def test_what_contradicts_itself_is_a_usage_error(words):
    assert "Usage" in maurice("snapshot", "kept", *words.split(), expect=2)[1]


def test_bad_sources_and_drivers_are_a_line(tmp_path, monkeypatch):
    monkeypatch.setattr("maurice_viz.viewer.snapshot.DRIVER_FOLDERS", ())
    assert "mesa-vulkan-drivers" in one_line(maurice("snapshot", "kept", "-o", "a.png", expect=1)[1])
    assert "mesa-vulkan-drivers" in one_line(maurice("snapshot", "kept", "-o", "a.gif", expect=1)[1])
    monkeypatch.setattr("maurice_viz.viewer.snapshot.software_driver", lambda: Path("driver.json"))
    assert "no such recording" in one_line(maurice("snapshot", "no.rrd", "-o", "a.png", expect=1)[1])
    assert "found no such file or folder" in one_line(maurice("snapshot", "no", "-o", "a.png", expect=1)[1])
    (tmp_path / "a.png").write_bytes(b"earlier")
    assert "--force" in one_line(maurice("snapshot", "no.rrd", "-o", "a.png", expect=1)[1])
    assert (tmp_path / "a.png").read_bytes() == b"earlier"


@needs_renderer
def test_pictures_of_a_saved_run(small_session, tmp_path):
    maurice(small_session, "--particles", "100", "--save-run", "kept", "-o", "none")
    out, err = maurice("snapshot", "kept", "-o", "belief.png", "--step", "7", "--view", "belief",
                       "--size", "900x600")  # fmt: skip
    assert (out, err) == ("belief.png\n", "")
    assert shape(tmp_path / "belief.png") == (600, 900, 3)
    found = one_line(maurice("snapshot", "kept", "-o", "x.png", "--step", "15", expect=1)[1])
    assert "no step 15, expected one from 1 to 14" in found
    assert sorted(file.name for file in tmp_path.glob("*.*")) == ["belief.png", "session.log", "survey.log"]


@pytest.mark.parametrize(
    "asked",
    [
        ["-o", "x.png", "--step", "500"],
        ["-o", "m.gif", "--to", "500"],
        ["-o", "m.gif", "--from", "500"],
    ],
)
def test_a_step_that_a_saved_run_lacks_is_refused_before_anything_is_drawn(small_session, monkeypatch, asked):
    maurice(small_session, "--particles", "50", "--save-run", "kept", "-o", "none")
    monkeypatch.setattr("maurice_viz.app.snapshot.draw_saved", None)
    monkeypatch.setattr("maurice_viz.app.snapshot.expect_driver", lambda source: None)
    found = one_line(maurice("snapshot", "kept", *asked, expect=1)[1])
    assert "kept: found no step 500, expected one from 1 to 14" in found


@pytest.mark.parametrize(
    "asked",
    [
        ["-o", "x.png", "--step", "500"],
        ["-o", "m.gif", "--from", "3", "--to", "500"],
    ],
)
def test_a_step_that_a_recording_lacks_is_refused_before_a_viewer_starts(small_session, monkeypatch, asked):
    maurice(small_session, "--particles", "50", "-o", "a.rrd")
    monkeypatch.setattr("maurice_viz.app.snapshot.expect_driver", lambda source: None)
    monkeypatch.setattr("maurice_viz.app.snapshot.headless_viewer", None)
    found = one_line(maurice("snapshot", "a.rrd", *asked, expect=1)[1])
    assert "a.rrd: found no step 500, expected one from 1 to 14" in found


@pytest.mark.slow
@needs_renderer
def test_pictures_and_a_movie_of_a_recording(small_session, tmp_path):
    maurice(small_session, "--particles", "100", "-o", "a.rrd")
    maurice(
        "snapshot", "a.rrd", "-o", "weight.png", "--step", "7", "--phase", "weight", "--layout", "overview"
    )
    assert shape(tmp_path / "weight.png") == (1000, 1600, 3)
    assert "'the robot sees'" in one_line(
        maurice("snapshot", "a.rrd", "-o", "x.png", "--view", "?", expect=1)[1]
    )
    phase = ["snapshot", "a.rrd", "--step", "7", "--phase", "weight"]
    maurice(*phase, "-o", "inside.png")
    maurice(*phase, "-o", "asked.png", "--layout", "inside-a-step")
    inside, asked = (np.asarray(Image.open(name)).astype(int) for name in ("inside.png", "asked.png"))
    assert np.abs(inside - asked).mean() < 1.0  # a phase is looked at from the inside
    weight = np.asarray(Image.open("weight.png")).astype(int)
    assert np.abs(inside - weight).mean() > 3.0
    maurice("snapshot", "a.rrd", "-o", "m.gif", "--from", "3", "--to", "4", "--view", "belief",
            "--size", "400x300")  # fmt: skip
    with Image.open(tmp_path / "m.gif") as movie:
        assert (movie.size, getattr(movie, "n_frames", 1)) == ((400, 300), 2)
        first = np.asarray(movie.convert("RGB"))
        movie.seek(1)
        assert (np.asarray(movie.convert("RGB")) != first).any()
