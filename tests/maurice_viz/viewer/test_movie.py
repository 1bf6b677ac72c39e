"""Movies: read back, they hold the pictures that were put in; a broken one is not there at all."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from maurice_loaders.errors import InputError
from maurice_loaders.files.writing import sibling
from maurice_mcl.values.arrays import U8
from maurice_viz.drawing.canvas import png
from maurice_viz.viewer.movie import film, from_png

FRAMES = 5


def picture(k: int, rows: int = 120, columns: int = 160) -> U8:
    """A square that moves over a ground that stays."""
    image = np.full((rows, columns, 3), (16, 40, 90), np.uint8)
    image[40:80, 20 * k : 20 * k + 40] = (240, 200, 20)
    return image


def mp4(path: Path) -> list[U8]:
    capture, found = cv2.VideoCapture(str(path)), list[U8]()
    while True:
        there, image = capture.read()
        if not there:
            return found
        found.append(np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2RGB), np.uint8))


def gif(path: Path) -> list[U8]:
    with Image.open(path) as image:
        frames = list[U8]()
        for k in range(getattr(image, "n_frames", 1)):
            image.seek(k)
            frames.append(np.asarray(image.convert("RGB"), np.uint8))
        return frames


@pytest.mark.parametrize("suffix", [".mp4", ".gif"])
def test_a_movie_holds_its_pictures_in_order(tmp_path, suffix):
    path = tmp_path / f"m{suffix}"
    with film(path, 4.0) as frames:
        for k in range(FRAMES):
            frames.add(picture(k))
    found = mp4(path) if suffix == ".mp4" else gif(path)
    assert len(found) == FRAMES
    for k, image in enumerate(found):
        assert np.abs(image.astype(int) - picture(k)).mean() < 3
    assert [file.name for file in tmp_path.iterdir()] == [path.name]


def test_gifs_loop_and_keep_rare_colors(tmp_path):
    with film(tmp_path / "m.gif", 4.0) as frames:
        frames.add(picture(0))
        frames.add(picture(1))
    with Image.open(tmp_path / "m.gif") as image:
        assert (image.info["loop"], image.info["duration"]) == (0, 250)
    # The brightest weights are a handful of pixels; a palette by frequency alone would lose them
    image = np.random.default_rng(0).integers(0, 90, (200, 200, 3)).astype(np.uint8)
    image[100:103, 100:103] = (253, 231, 37)
    with film(tmp_path / "rare.gif", 4.0) as frames:
        frames.add(image)
    (found,) = gif(tmp_path / "rare.gif")
    assert np.abs(found[101, 101].astype(int) - (253, 231, 37)).max() < 20


def test_sizes_are_even_and_png_is_exact(tmp_path):
    with film(tmp_path / "m.mp4", 4.0) as frames:
        frames.add(picture(1, rows=121, columns=161))
    assert mp4(tmp_path / "m.mp4")[0].shape == (120, 160, 3)
    assert (from_png(png(picture(2))) == picture(2)).all()


@pytest.mark.parametrize("suffix", [".mp4", ".gif"])
def test_a_movie_that_is_stopped_leaves_nothing(tmp_path, suffix):
    with pytest.raises(KeyboardInterrupt), film(tmp_path / f"m{suffix}", 4.0) as frames:  # noqa: PT012
        frames.add(picture(0))
        raise KeyboardInterrupt
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("suffix", [".mp4", ".gif"])
def test_a_killed_movie_is_removed_by_the_next_and_that_of_a_living_process_stays(tmp_path, suffix):
    path, ended = tmp_path / f"m{suffix}", subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    own = sibling(path, f"part{suffix}")
    killed = own.with_name(own.name.replace(f".{os.getpid()}.", f".{ended.pid}."))
    killed_before = tmp_path / f".m.{ended.pid}.part{suffix}"  # as versions until now named it
    for part in (own, killed, killed_before):
        part.write_bytes(b"half")
    with film(path, 4.0) as frames:
        frames.add(picture(0))
    assert {file.name for file in tmp_path.iterdir()} == {path.name, own.name}


def test_earlier_movies_and_missing_folders(tmp_path):
    path = tmp_path / "m.gif"
    path.write_bytes(b"earlier")
    with pytest.raises(InputError, match="--force"), film(path, 4.0):
        pass
    assert path.read_bytes() == b"earlier"
    with film(path, 4.0, force=True) as frames:
        frames.add(picture(0))
    assert len(gif(path)) == 1
    with pytest.raises(InputError, match="cannot be written"), film(tmp_path / "no" / "m.gif", 4.0) as frames:
        frames.add(picture(0))
