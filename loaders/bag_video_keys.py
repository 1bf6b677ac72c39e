"""Which parts of a video stream can be decoded by themselves: its key frames, by the first bits of each unit.

H.264 and H.265 are read in Annex B form (units after 0 0 1), VP9 and AV1 as their specifications have them.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator

_UNIT = re.compile(rb"\x00\x00\x01(.)", re.DOTALL)
H264_IDR = 5
H265_IRAP = range(16, 22)
AV1_SEQUENCE, AV1_FRAMES = 1, (3, 6)  # a sequence header stands before every key frame


def is_key(codec: str, data: bytes) -> bool:
    """Tell whether a part begins anew. False for what makes no sense."""
    return KEYS[codec](data)


def _h264(data: bytes) -> bool:
    return any(first & 0x1F == H264_IDR for first in _units(data))


def _h265(data: bytes) -> bool:
    return any(first >> 1 & 0x3F in H265_IRAP for first in _units(data))


def _units(data: bytes) -> Iterator[int]:
    return (unit[1][0] for unit in _UNIT.finditer(data))


def _vp9(data: bytes) -> bool:
    """Read marker (2 bits), profile (2, or 3 for profile 3), whether a frame is shown again, and its kind."""
    if not data or data[0] >> 6 != 2:
        return False
    profile_3 = data[0] >> 4 & 3 == 3
    bits = data[0] >> (1 if profile_3 else 2) & 3
    return bits == 0  # no frame shown again, and a key frame


def _av1(data: bytes) -> bool:
    at = 0
    while at < len(data):
        kind, extended, sized = data[at] >> 3 & 15, data[at] >> 2 & 1, data[at] >> 1 & 1
        if kind == AV1_SEQUENCE:
            return True
        if kind in AV1_FRAMES or not sized:
            return False
        size, at = _leb128(data, at + 1 + extended)
        at += size
    return False


def _leb128(data: bytes, at: int) -> tuple[int, int]:
    """Give a number of seven bits a byte, and where it ends."""
    value = 0
    for count in range(8):
        if at + count >= len(data):
            break
        value |= (data[at + count] & 0x7F) << (7 * count)
        if not data[at + count] & 0x80:
            return value, at + count + 1
    return len(data), len(data)


KEYS: dict[str, Callable[[bytes], bool]] = {"h264": _h264, "hevc": _h265, "vp9": _vp9, "av1": _av1}
