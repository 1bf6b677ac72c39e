"""Video in bags and from bridges: key frames, and decoding up to the requested picture.

H.264 and H.265 in Annex B form (units after 0 0 1), VP9 and AV1; a message is one picture's part.
"""

from __future__ import annotations

import importlib.util
import math
import re
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from statistics import median
from typing import TYPE_CHECKING, Any

import numpy as np

from maurice_mcl.values import U8

from ..errors import PictureError
from ..files.pictures import most_megapixels
from .messages import bytes_of

if TYPE_CHECKING:
    from av.video.codeccontext import VideoCodecContext
    from av.video.frame import VideoFrame

# Key frames, by the first bits of each unit. Ours, as the parser of PyAV ends the process at broken data.

_UNIT = re.compile(rb"\x00\x00\x01(.)", re.DOTALL)
H264_IDR = 5
H265_IRAP = range(16, 22)
AV1_SEQUENCE, AV1_FRAMES = 1, (3, 6)  # a sequence header stands before every key frame


def is_key(codec: str, data: bytes) -> bool:
    """Return whether a part is a key frame. False for invalid data."""
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
    """Return a number in LEB128 (seven bits per byte), and where it ends."""
    value = 0
    for count in range(8):
        if at + count >= len(data):
            break
        value |= (data[at + count] & 0x7F) << (7 * count)
        if not data[at + count] & 0x80:
            return value, at + count + 1
    return len(data), len(data)


KEYS: dict[str, Callable[[bytes], bool]] = {"h264": _h264, "hevc": _h265, "vp9": _vp9, "av1": _av1}


# Frames that depend on each other, decoded as far as they are requested.

INSTALL = "pip install 'maurice-replay[video]'"
# by a part of their name
CODECS = {"264": "h264", "265": "hevc", "hevc": "hevc", "vp9": "vp9", "av1": "av1"}
DECODERS = {"av1": "libdav1d"}  # the codec's own wants hardware
MOST_BUILT = 1800  # pictures per key frame: a minute at 30 per second
MOST_BYTES = 2**28  # of them, packed
MOST_WAITED = 300  # parts before the first key frame; encoders write one at least every 250
PAUSE = 1.6  # of the usual interval: a message was lost, or the camera paused
LATELY = 9  # intervals that define the usual one
Read = Callable[[], U8]


@dataclass(frozen=True, slots=True)
class VideoPart:
    """One picture's part of a video."""

    read: Read  # decodes the picture (H, W, 3) RGB; PictureError for a broken one
    note: str  # a remark for the user; "" for none


def can_decode() -> bool:
    """Return whether the package that decodes video is installed."""
    return importlib.util.find_spec("av") is not None


def codec_of(message: Any) -> str | None:
    """Name the codec of a message's video; None where it is no video that is known."""
    form = getattr(message, "format", None)
    named = str(form if form is not None else getattr(message, "encoding", "")).lower()
    if "jpeg" in named or "png" in named:
        return None
    return next((codec for part, codec in CODECS.items() if part in named.partition(";")[0]), None)


class VideoStream:
    """The video of one topic, message by message. Keeps the packets since the last key frame."""

    def __init__(self) -> None:
        self._waited = 0  # messages before the first key frame, which nothing can be made of
        self._intervals_s = deque[float](maxlen=LATELY)
        self._last_s = math.nan
        self._doubted = False  # since the last key frame
        self._in_order = True  # else parts build upon later ones, and when they come tells nothing
        self._codec = ""
        self._first = b""  # the first key frame: what describes the stream may stand in it alone
        self._group: _Group | None = None

    def add(self, message: Any, t_s: float) -> VideoPart | None:
        """Add the next message; return its part, None before the first key frame. PictureError."""
        codec = codec_of(message)
        if codec is None:
            raise PictureError(f"found video of no known kind, expected one of {', '.join(CODECS)}")
        if codec != self._codec:
            if not can_decode():
                raise PictureError(f"found video ({codec}); decoding it needs an extra; {INSTALL}")
            self._codec, self._first = codec, b""
        data = bytes_of(message.data)
        key = is_key(codec, data)
        if key:
            self._first = self._first or data
            self._group = _Group(codec, self._first)
        if self._group is None:
            self._waited += 1
            if self._waited > MOST_WAITED:
                text = f"found no key frame in {MOST_WAITED} parts of video ({codec}), expected one"
                raise PictureError(text)
            return None
        return VideoPart(partial(self._group.picture, self._group.add(data)), self._note(t_s, key=key))

    def _note(self, t_s: float, *, key: bool) -> str:
        """Return a remark where a part seems to be missing, which decoders do not report."""
        since_s, self._last_s = t_s - self._last_s, t_s
        usual_s = median(self._intervals_s) if len(self._intervals_s) > LATELY // 2 else math.inf
        if since_s > 0:
            self._intervals_s.append(since_s)
        if self._waited:
            waited, self._waited = self._waited, 0
            return f"video: {_pictures(waited)} before the first key frame left out"
        self._in_order = self._in_order and not since_s < 0
        if key or self._doubted or not self._in_order or not since_s > PAUSE * usual_s:
            self._doubted = self._doubted and not key
            return ""
        self._doubted = True
        return f"video: nothing for {since_s:.2f} s; pictures may be wrong until the next key frame"


class _Group:
    """A key frame and the frames that depend on it; decoded from its beginning, once when read in order."""

    def __init__(self, codec: str, first: bytes) -> None:
        self._codec = codec
        self._first = first
        self._packets: list[bytes] = []
        self._bytes = 0
        self._broken: int | None = None  # packet that cannot be decoded, nor what builds upon it
        self._decoder: VideoCodecContext | None = None
        self._next = 0  # packet to be decoded
        self._latest: tuple[int, U8] | None = None

    def add(self, data: bytes) -> int:
        if len(self._packets) >= MOST_BUILT or self._bytes + len(data) > MOST_BYTES:
            fault = f"found video without a key frame for {_pictures(len(self._packets))}"
            raise PictureError(f"{fault} of {self._bytes} bytes, expected one")
        self._bytes += len(data)
        self._packets.append(data)
        return len(self._packets) - 1

    def picture(self, number: int) -> U8:
        from av import FFmpegError

        if self._latest is None or self._latest[0] != number:
            broken = PictureError("found broken video, or a part of it is missing; expected a whole picture")
            if self._broken is not None and number >= self._broken:
                raise broken
            try:
                frame = self._frame(number)
                image = None if frame is None or frame.is_corrupt else frame.to_ndarray(format="rgb24")
            except (FFmpegError, OSError, ValueError):
                self._broken, self._decoder = self._next, None
                raise broken from None
            if image is None:
                raise broken
            self._latest = number, np.asarray(image, np.uint8)
        return self._latest[1].copy()

    def _frame(self, number: int) -> VideoFrame | None:
        """Decode up to a packet and return its frame; a stream with B frames may deliver it late."""
        if self._decoder is None or self._next > number:
            self._decoder = self._begun()
        picture: VideoFrame | None = None
        while self._next <= number:
            for frame in self._decoder.decode(_packet(self._packets[self._next], self._next)):
                picture = frame if frame.pts == number else picture
            self._next += 1
        if picture is None:
            late = self._decoder.decode(None)  # after which it has to begin anew
            picture = next((frame for frame in late if frame.pts == number), None)
            self._decoder = None
        return picture

    def _begun(self) -> VideoCodecContext:
        from av.codec.context import Flags, ThreadType

        decoder = _context(DECODERS.get(self._codec, self._codec))
        decoder.thread_type = ThreadType.SLICE  # threads by frames would keep pictures back
        decoder.flags |= Flags.low_delay
        self._next = 0
        if self._first is not self._packets[0]:
            decoder.decode(_packet(self._first, -1))
        return decoder


def _pictures(count: int) -> str:
    return f"{count} picture{'' if count == 1 else 's'}"


def _context(name: str) -> VideoCodecContext:
    from av import CodecContext
    from av.video.codeccontext import VideoCodecContext

    decoder = CodecContext.create(name, "r")
    assert isinstance(decoder, VideoCodecContext)
    decoder.options = {"max_pixels": str(int(most_megapixels() * 1e6))}  # larger frames are broken video
    return decoder


def _packet(data: bytes, number: int) -> Any:
    from av import Packet

    packet = Packet(data)
    packet.pts = number
    return packet
