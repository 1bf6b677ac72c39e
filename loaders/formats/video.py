"""Videos: frames with the times that the file gives them, decoded when somebody asks."""

from __future__ import annotations

import os
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import cv2
import numpy as np

from maurice_mcl.values import U8, SessionInfo

from ..errors import InputError, PictureError, ReadingNotes
from ..files.pictures import expect_size
from ..reading.options import Reading
from ..reading.recording import Picture, Record
from ._tables import begin_of
from .registry import Format

os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")  # errors are reported in one line, by us
ENDINGS = (".mp4", ".avi", ".mkv", ".webm", ".mov", ".mpg", ".mpeg", ".m4v", ".mjpeg", ".mjpg")
ROW_OF_JPEGS = (".mjpeg", ".mjpg")  # pictures one after the other: nothing in them says so, or when


class Frames:
    """The frames of a video by number; reading goes forward, and begins anew for an earlier one."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._reader: cv2.VideoCapture | None = None
        self._at = -1  # the frame that the reader holds

    def times(self, notes: ReadingNotes) -> Iterator[tuple[int, float]]:
        """Yield number and time in seconds of every frame; a file that ends early is a problem."""
        video = _opened(self.path)
        promised = int(video.get(cv2.CAP_PROP_FRAME_COUNT))
        rate = video.get(cv2.CAP_PROP_FPS)
        number, last_s = 0, -1.0
        while video.grab():
            t_s = video.get(cv2.CAP_PROP_POS_MSEC) / 1000
            if not t_s > last_s:
                t_s = last_s + (1 / rate if rate > 0 else 1.0)
            t_s = max(t_s, 0.0)
            yield number, t_s
            number, last_s = number + 1, t_s
        video.release()
        if number < promised - 1:
            fault = f"found {number} frames, {promised} are promised: the file was cut or is damaged"
            notes.problem(InputError(self.path, fault))

    def read(self, number: int) -> U8:
        """Decode one frame, (H, W, 3). PictureError where the video has none."""
        if self._reader is None or number < self._at:
            self._reader, self._at = _opened(self.path), -1
        while self._at < number and self._reader.grab():
            self._at += 1
        success, image = self._reader.retrieve() if self._at == number else (False, None)
        if not success or image is None:
            raise PictureError(f"found no frame {number} in {self.path.name} that can be decoded")
        return np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2RGB), np.uint8)


class VideoRecording:
    """A video by itself: pictures without odometry or truth."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.info = SessionInfo(path.stem)

    def records(self, notes: ReadingNotes) -> Iterator[Record]:
        """Yield the frames in order."""
        if self.path.suffix.lower() in ROW_OF_JPEGS:
            notes.warning("found JPEG pictures one after the other, without times: 25 per second are assumed")
        reading = Frames(self.path)
        for number, t_s in Frames(self.path).times(notes):
            yield Picture(t_s, partial(reading.read, number), f"{self.path.name}, frame {number}")


def open_video(path: Path, options: Reading) -> VideoRecording:
    """Open a video. Raises InputError if it cannot be decoded."""
    _opened(path).release()
    return VideoRecording(path)


def looks_like_video(path: Path) -> bool:
    """Recognize a video by the first bytes: MP4 and MOV, AVI, Matroska and WebM, MPEG."""
    begin = begin_of(path, 16)
    riff = begin[:4] == b"RIFF" and begin[8:12] == b"AVI "
    if begin[:3] == b"\xff\xd8\xff":
        return path.suffix.lower() in ROW_OF_JPEGS
    return begin[4:8] == b"ftyp" or riff or begin[:4] in (b"\x1aE\xdf\xa3", b"\x00\x00\x01\xba")


def _opened(path: Path) -> cv2.VideoCapture:
    level = cv2.utils.logging.getLogLevel()
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)  # our own error reports it in one line
    try:
        video = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
    except cv2.error as problem:
        raise InputError(path, f"cannot be opened as a video: {problem.err}") from None
    finally:
        cv2.utils.logging.setLogLevel(level)
    if not video.isOpened():
        known = "expected MP4, AVI, Matroska or MPEG, whole, of a codec that OpenCV has"
        raise InputError(path, f"cannot be opened as a video, {known}; `ffmpeg -i IN OUT.mp4` makes one")
    try:
        expect_size(int(video.get(cv2.CAP_PROP_FRAME_WIDTH)), int(video.get(cv2.CAP_PROP_FRAME_HEIGHT)))
    except PictureError as problem:
        raise InputError(path, str(problem)) from None
    return video


FORMATS = (Format("video", "a video: pictures without odometry", looks_like_video, open_video, bare=True),)
