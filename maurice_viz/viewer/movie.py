"""Movies from pictures: VP9 in MP4, which browsers play, or an animated GIF. Written whole or not at all.

OpenCV's wheel has no H.264 encoder, and no browser plays its MPEG-4.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Protocol

import cv2
import numpy as np
from PIL import Image

from maurice_loaders.errors import InputError
from maurice_loaders.files.writing import filling
from maurice_mcl.values import U8

SUFFIXES = (".mp4", ".gif")
VP9 = "vp09"
CENTISECOND_MS = 10  # GIF counts in these
MOST_IN_GIF = 300  # pictures: they are held in memory, 1.6 MB each at 1600 x 1000


class Film(Protocol):
    """A movie that is being written."""

    def add(self, picture: U8) -> None:
        """Add a picture (H, W, 3) RGB, of the size of the first."""


@contextmanager
def film(path: Path, fps: float, *, force: bool = False) -> Iterator[Film]:
    """Open a movie for writing; it appears under its name when the block succeeds, else not at all.

    A part that a killed process left of this movie is removed. Raises InputError when the file exists
    (unless `force`) or cannot be written.
    """
    with filling(path, force=force, suffix=path.suffix) as part:  # the suffix tells OpenCV the format
        if path.suffix == ".gif":
            gif = Gif(part, fps)
            yield gif
            gif.end()
        else:
            video = Video(part, fps)
            try:
                yield video
            finally:
                video.end()


def from_png(data: bytes) -> U8:
    """Decode a PNG of the viewer into RGB (H, W, 3)."""
    bgr = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    if bgr is None:
        raise ValueError("the viewer returned no picture")
    return np.asarray(cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB), np.uint8)


class Video:
    """VP9 in an MP4 file."""

    def __init__(self, file: Path, fps: float) -> None:
        self._file, self._fps = file, fps
        self._writer: cv2.VideoWriter | None = None

    def add(self, picture: U8) -> None:
        """Add a picture; an odd row or column is cut off, because VP9 halves the resolution of colors."""
        even = picture[: picture.shape[0] // 2 * 2, : picture.shape[1] // 2 * 2]
        if self._writer is None:
            size = (even.shape[1], even.shape[0])
            self._writer = cv2.VideoWriter(str(self._file), cv2.VideoWriter.fourcc(*VP9), self._fps, size)
            if not self._writer.isOpened():
                raise InputError(self._file, "this build of OpenCV cannot write VP9; write a .gif")
        self._writer.write(cv2.cvtColor(even, cv2.COLOR_RGB2BGR))

    def end(self) -> None:
        """Close the file."""
        if self._writer is not None:
            self._writer.release()


class Gif:
    """An endless animated GIF; frames are kept in memory with their own palettes until the end."""

    def __init__(self, file: Path, fps: float) -> None:
        self._file = file
        self._duration_ms = max(2, round(1000 / fps / CENTISECOND_MS)) * CENTISECOND_MS
        self._frames: list[Image.Image] = []

    def add(self, picture: U8) -> None:
        """Add a picture; an octree keeps rare colors, such as the bright end of the weights."""
        frame = Image.fromarray(picture)
        self._frames.append(frame.quantize(method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE))

    def end(self) -> None:
        """Write the file: Pillow keeps only what changed from one frame to the next."""
        first, *others = self._frames
        first.save(self._file, save_all=True, append_images=others, duration=self._duration_ms, loop=0)
