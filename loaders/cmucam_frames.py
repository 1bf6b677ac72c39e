"""Frames of a CMUcam's frame dump, as the camera sends them and as programs have saved them.

A frame is `01`, perhaps width and height, lines of red, green, blue, and `03`; `02` stands before each line,
or before some, or before none (CMUcam2 manual, SF; thesis section on the camera). The camera's values are 16
to 240, so that 1, 2 and 3 are markers only; where the size is given, others are read as well. The CMUcam1
sends columns (DF). A triplet stands for two of the sensor's pixels side by side and is doubled.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from maurice_mcl.typing import U8

from .pictures import PictureError

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
    """Find the frames from a position on; what lies between them (ACK, prompts) is passed over.

    Unless `last`, a frame that goes on beyond the data is not given, since more may come.
    """
    while (begin := data.find(BEGIN, at)) >= 0:
        if not last and begin + MOST_BYTES > len(data):
            return
        found = _sized(data, begin) or _marked(data, begin)
        yield found
        at = found.end


def decode_frame(data: bytes) -> U8:
    """Give the picture (H, W, 3) of one frame, 01 to 03. PictureError when bytes are missing or too many."""
    found = next(frames(data), None)
    if found is None or found.fault:
        raise PictureError(found.fault if found else "found no frame, expected one that begins with 01")
    pixels, width = _pixels(data[found.begin : found.end])
    picture = np.frombuffer(pixels, np.uint8).reshape(-1, width, 3)
    if picture.shape[1::-1] == COLUMNS_OF:
        picture = picture.transpose(1, 0, 2)
    return np.ascontiguousarray(np.repeat(picture, 2, axis=1))


def _sized(data: bytes, begin: int) -> Found | None:
    """Find a frame by the size that it gives, whatever its values are."""
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
    """Tell whether the markers stand where they belong."""
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
    """Give the values of a frame, and its width in triplets. PictureError when lines are unequal."""
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
