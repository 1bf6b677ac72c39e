"""CMUcam frame dumps: as the camera sends them over its serial line, and as programs saved them.

A frame is `01`, perhaps width and height, lines of red, green, blue, and `03`; `02` stands before each line,
or before some, or before none (CMUcam2 manual, SF; thesis section on the camera). The camera's values are 16
to 240, so that 1, 2 and 3 are markers only; where the size is given, others are read as well. The CMUcam1
sends columns (DF). A triplet stands for two of the sensor's pixels side by side and is doubled.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from itertools import count
from pathlib import Path

import numpy as np

from maurice_mcl.values import U8, SessionInfo

from ..errors import InputError, PictureError, ReadingNotes
from ..files.text import natural_order
from ..reading.options import Reading
from ..reading.recording import Picture, Record
from .registry import Format

BEGIN, LINE, END = b"\x01", b"\x02", b"\x03"
LEAST, WIDEST, HIGHEST = 4, 176, 255  # pixels; the camera has 176 x 255
MOST_BYTES = 4 + HIGHEST * (3 * WIDEST + 1)
COLUMNS_OF = (143, 80)  # a CMUcam1's frame: lines of 143, 80 of them, are columns


@dataclass(frozen=True, slots=True)
class Found:
    """A frame in a dump, or what is left of one."""

    begin: int  # of its 01
    end: int  # after its 03
    fault: str = ""  # what is wrong with it


def frames(data: bytes, at: int = 0, *, last: bool = True) -> Iterator[Found]:
    """Find the frames, passing over what is between; unless `last`, one cut at the end is not given."""
    while (begin := data.find(BEGIN, at)) >= 0:
        if not last and begin + MOST_BYTES > len(data):
            return
        frame = _sized(data, begin) or _marked(data, begin)
        yield frame
        at = frame.end


def decode_frame(data: bytes) -> U8:
    """Return the picture (H, W, 3) of one frame, 01 to 03. PictureError for missing or surplus bytes."""
    frame = next(frames(data), None)
    if frame is None or frame.fault:
        raise PictureError(frame.fault if frame else "found no frame, expected one that begins with 01")
    pixels, width = _pixels(data[frame.begin : frame.end])
    picture = np.frombuffer(pixels, np.uint8).reshape(-1, width, 3)
    if picture.shape[1::-1] == COLUMNS_OF:
        picture = picture.transpose(1, 0, 2)
    return np.ascontiguousarray(np.repeat(picture, 2, axis=1))


def _sized(data: bytes, begin: int) -> Found | None:
    if begin + 3 > len(data):
        return None
    width, height = data[begin + 1], data[begin + 2]
    if not (LEAST <= width <= WIDEST and height >= LEAST):
        return None
    for markers in (height, 0, 1, height - 1):
        end = begin + 3 + 3 * width * height + markers
        if data[end : end + 1] == END and _fits(data[begin + 3 : end], width, height, markers):
            return Found(begin, end + 1)
    return None


def _fits(body: bytes, width: int, height: int, markers: int) -> bool:
    line = 3 * width
    if markers == height:
        return body[:: line + 1] == LINE * height
    if markers == height - 1:
        return body[line :: line + 1] == LINE * markers
    return markers == 0 or body[-1:] == LINE or body[:1] == LINE


def _marked(data: bytes, begin: int) -> Found:
    """Find a frame by its markers; after a stray 01 or a cut frame go on with the next 01."""
    after = data.find(BEGIN, begin + 1, begin + MOST_BYTES)
    end = data.find(END, begin + 1, begin + MOST_BYTES if after < 0 else after)
    if end < 0:
        stop = after if after >= 0 else min(len(data), begin + MOST_BYTES)
        return Found(begin, stop, f"found a frame of {stop - begin} bytes without its end (03)")
    try:
        _pixels(data[begin : end + 1])
    except PictureError as problem:
        return Found(begin, end + 1, str(problem))
    return Found(begin, end + 1)


def _pixels(frame: bytes) -> tuple[bytes, int]:
    """Return the values of a frame, and its width in triplets. PictureError when lines are unequal."""
    sized = _sized(frame, 0)
    if sized is not None:
        return _without_markers(frame), frame[1]
    body = frame[1:-1]
    if len(body) >= 2 and body[:1] != LINE and _is_size(body):
        return body[2:].replace(LINE, b""), body[0]
    lines = [line for line in body.split(LINE) if line]
    lengths = {len(line) for line in lines}
    if len(lines) < LEAST or len(lengths) != 1 or len(lines[0]) % 3 or len(lines[0]) < 3 * LEAST:
        shown = ", ".join(str(length) for length in sorted(lengths)[:3])
        raise PictureError(f"found a frame of {len(lines)} lines of {shown} bytes, expected equal triplets")
    return b"".join(lines), len(lines[0]) // 3


def _is_size(body: bytes) -> bool:
    width, height = body[0], body[1]
    return LEAST <= width <= WIDEST and len(body[2:].replace(LINE, b"")) == 3 * width * height


def _without_markers(frame: bytes) -> bytes:
    """Take the markers out of a frame whose size is known, whatever its values are."""
    width, height, body = frame[1], frame[2], frame[3:-1]
    line = 3 * width
    extra = len(body) - line * height
    if extra == height:
        return b"".join(body[at + 1 : at + 1 + line] for at in range(0, len(body), line + 1))
    if extra == height - 1:
        return b"".join(body[at : at + line] for at in range(0, len(body), line + 1))
    return body[1:] if extra == 1 and body[:1] == LINE and body[-1:] != LINE else body[: line * height]


CHUNK_BYTES = 2**17
PERIOD_S = 1.0  # frames carry no time
PREFIX = 256  # bytes of text (banner, ACK, prompt) before the first frame
ENDINGS = (".dump", ".dmp", ".raw", ".bin", ".cmu", ".dat", ".frame", ".txt", "")


@dataclass(frozen=True, slots=True, eq=False)
class DumpRecording:
    """Frames one after the other, one file or several."""

    path: Path
    info: SessionInfo

    def records(self, notes: ReadingNotes) -> Iterator[Record]:
        """Yield the frames in order, a second apart; only some of a file is held."""
        notes.warning("frames carry no times: one a second is taken")
        number = count()
        for file in _files(self.path):
            for frame in _found(file):
                at = next(number)
                name = f"{file.name}, byte {frame.begin}"
                yield Picture(at * PERIOD_S, partial(_read, file, frame), name)


def open_dump(path: Path, options: Reading) -> DumpRecording:
    """Open a dump. Raises InputError if there is no frame at all."""
    if not any(not frame.fault for file in _files(path) for frame in _found(file)):
        raise InputError(path, "found no whole frame (01 ... 03), expected a CMUcam's frame dump")
    return DumpRecording(path, SessionInfo(path.resolve().stem))


def looks_like_dump(path: Path) -> bool:
    """Recognize a dump by a complete frame at its beginning, after at most some lines of text."""
    if path.is_dir():
        return any(_begins_with_frame(file) for file in _files(path)[:1])
    return _begins_with_frame(path)


def _begins_with_frame(path: Path) -> bool:
    try:
        if not path.is_file():
            return False
        with path.open("rb") as file:
            data = file.read(PREFIX + 2 * MOST_BYTES)
    except OSError:
        return False
    prefix, mark, _ = data.partition(b"\x01")
    if not mark or len(prefix) > PREFIX or any(not (32 <= c < 127 or c in b"\r\n\t") for c in prefix):
        return False
    first = next(frames(data), None)
    return first is not None and not first.fault


def _files(path: Path) -> list[Path]:
    if not path.is_dir():
        return [path]
    return natural_order(file for file in path.iterdir() if file.is_file() and file.suffix.lower() in ENDINGS)


def _found(file: Path) -> Iterator[Found]:
    """Find the frames of a file, a piece at a time; positions are the file's."""
    try:
        with file.open("rb") as source:
            buffer, start = b"", 0
            while chunk := source.read(CHUNK_BYTES):
                buffer, used = buffer + chunk, 0
                for frame in frames(buffer, last=False):
                    yield Found(start + frame.begin, start + frame.end, frame.fault)
                    used = frame.end
                keep = min(len(buffer), max(used, len(buffer) - MOST_BYTES))
                buffer, start = buffer[keep:], start + keep
            for frame in frames(buffer):
                yield Found(start + frame.begin, start + frame.end, frame.fault)
    except OSError as problem:
        raise InputError(file, f"cannot be read: {problem.strerror}") from None


def _read(file: Path, frame: Found) -> U8:
    if frame.fault:
        raise PictureError(frame.fault)
    with file.open("rb") as source:
        source.seek(frame.begin)
        return decode_frame(source.read(frame.end - frame.begin))


FORMATS = (Format("cmucam", "a CMUcam's frame dump, or a folder of them", looks_like_dump, open_dump),)
