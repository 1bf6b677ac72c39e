"""A CMUcam2 on a serial line: its commands and packets, and its frames or histograms as session-log lines.

From the camera's manual: a command ends in CR; the answer is `ACK` or `NCK`, what was asked for, and the
prompt `:`. `RS` resets, `GV` tells the version, `CR` sets registers, `SF` sends a frame (F packet: bytes 01,
width and height, lines that 02 may precede, 03) and `GH` the histogram of a channel (H packet: `H` and 28
numbers, 256 times the share of pixels). From the thesis: 28 bins a channel. Its registers are not known.
"""

from __future__ import annotations

import base64
import os
import re
import select
import time
from collections.abc import Callable, Generator
from functools import partial
from pathlib import Path
from typing import TypeAlias
from urllib.parse import parse_qsl

import numpy as np

from maurice_mcl.values.arrays import U8

from ..errors import FieldError, PictureError, SourceError
from ..files.pictures import encode_picture
from ..formats.cmucam import MOST_BYTES, decode_frame
from ..session_log.header import header_of
from ..session_log.records import ascii_line

PORTION = 1 << 16  # bytes read at once
BAUDS = (1200, 2400, 4800, 9600, 19200, 38400, 57600, 115200)  # the camera's, by jumpers
UNPLUGGED = "was unplugged"
QUIET_S = 0.2  # without a byte: what was sent before is over
ANSWER_S = 3.0  # without a byte: the camera does not answer, or broke off
SETTLE_S = 5.0  # in which automatic gain and white balance settle, before they are fixed
FIXED = "CR 18 40 19 32"  # color RGB without white balance, exposure without automatic gain
TRIES = 3  # answers in a row that cannot be used before the line is opened again
BINS, LOWEST, LEVELS = 28, 16, 8  # of GH: 28 bins of 8 levels from 16 on
SIDE_PX = 16  # of the picture that has a histogram: 256 pixels, the camera's scale

Said: TypeAlias = bytes | FieldError | None  # lines, what is wrong with an answer, or nothing yet
Talk: TypeAlias = Generator[Said, None, bytes]

LONGEST = 256  # bytes of an answer that is no frame; an H packet has up to 114
_PROMPT = re.compile(rb"(ACK|NCK)[\r\n]+([^:]*):\s*$")
_FRAME = re.compile(rb"NCK[\r\n]+:|\x03[\r\n]*:\s*$")


def camera_at(name: str, rest: str) -> Callable[[], CmucamStream]:
    """Return how to connect to `DEVICE`, or `DEVICE?baud=38400&histograms`. SourceError for anything else."""
    device, _, query = rest.partition("?")
    options = dict(parse_qsl(query, keep_blank_values=True))
    baud, histograms = options.pop("baud", str(BAUDS[-1])), options.pop("histograms", None)
    if options or histograms or baud not in map(str, BAUDS):
        rates = ", ".join(map(str, BAUDS))
        raise SourceError(name, f"found ?{query}, expected baud=RATE of {rates}, histograms, or both by &")
    return partial(CmucamStream, name, Path("/", device), int(baud), histograms=histograms is not None)


def read_histogram(answer: bytes) -> list[int]:
    """Return the counts (28,) of an H packet. FieldError for another one."""
    packet = re.search(rb"H((?: \d{1,3}){%d})\s" % BINS, answer + b"\r")
    counts = [] if packet is None else [int(count) for count in packet[1].split()]
    if not any(counts) or max(counts) > 255:
        raise FieldError(f"found the answer {_shown(answer)}, expected H and {BINS} counts up to 255")
    return counts


def picture_of(histograms: list[list[int]]) -> U8:
    """Return a picture (16, 16, 3) with these histograms of its channels (3, 28), its values in order."""
    middles = LOWEST + LEVELS * np.arange(BINS) + LEVELS // 2
    channels = [np.repeat(middles, counts) for counts in histograms]
    even = (np.arange(SIDE_PX**2) + 0.5) / SIDE_PX**2  # rounding may have lost some of 256
    values = [values[(even * len(values)).astype(int)] for values in channels]
    return np.stack(values, axis=-1).reshape(SIDE_PX, SIDE_PX, 3).astype(np.uint8)


class CmucamStream:
    """A conversation with the camera, as a `ByteStream` of session-log lines."""

    def __init__(self, name: str, device: Path, baud: int, *, histograms: bool) -> None:
        """Open the line. OSError if there is none now, SourceError if it is no serial line."""
        self._name, self._baud = name, baud
        self._read_picture = self._histograms if histograms else self._frame
        self._line = _open_serial(name, device, baud)
        self._begun_s = time.monotonic()
        self._talk = self._conversation()

    def read(self, wait_s: float) -> bytes | None:
        """Return the lines that there are within `wait_s`. OSError, FieldError, SourceError."""
        until = time.monotonic() + wait_s
        while (lines := next(self._talk, b"")) is None:
            left_s = until - time.monotonic()
            if left_s <= 0:
                return None
            select.select([self._line], [], [], min(left_s, QUIET_S / 2))
        if isinstance(lines, FieldError):
            raise lines
        return lines

    def close(self) -> None:
        """Close the line."""
        if self._line >= 0:
            os.close(self._line)
            self._line = -1

    def _conversation(self) -> Talk:
        """Reset the camera, fix its exposure, and ask for pictures until the line is closed."""
        self._send(b"\r")
        yield from self._listened(lambda heard: False, QUIET_S)  # to what a program before us asked for
        yield from self._told("RS")
        version = yield from self._told("GV")
        robot = {"name": version.decode("ascii", "replace").strip() or "a CMUcam"}
        yield ascii_line(header_of("cmucam", cameras={"cmucam": {}}, robot=robot))
        yield from self._listened(lambda heard: False, SETTLE_S)
        yield from self._told(FIXED)
        failures = 0
        while failures < TRIES:
            t_s = time.monotonic() - self._begun_s
            try:
                picture = yield from self._read_picture()
            except (FieldError, PictureError) as problem:
                failures += 1
                yield FieldError(problem.message)
                yield from self._listened(lambda heard: False, QUIET_S)
            else:
                failures = 0
                data = base64.b64encode(encode_picture(picture, "png")).decode("ascii")
                yield ascii_line({"t": round(t_s, 3), "image": {"base64": data}})
        raise ConnectionError(0, f"sent {TRIES} answers in a row that cannot be used")

    def _frame(self) -> Generator[Said, None, U8]:
        answer = yield from self._asked("SF", _FRAME)
        return decode_frame(answer)

    def _histograms(self) -> Generator[Said, None, U8]:
        counts = []
        for channel in range(3):
            answer = yield from self._asked(f"GH {channel}", _PROMPT)
            counts.append(read_histogram(answer))
        return picture_of(counts)

    def _told(self, command: str) -> Talk:
        """Send a command that must be understood, and return its answer. SourceError if it never is."""
        problem: FieldError | None = None
        for _ in range(TRIES):
            try:
                answer = yield from self._asked(command, _PROMPT)
            except FieldError as found:
                problem = found
            else:
                return answer
        hint = f"is it a CMUcam2, is it on, and are its jumpers set to {self._baud} baud?"
        raise SourceError(self._name, f"{problem}; {hint}")

    def _asked(self, command: str, end: re.Pattern[bytes]) -> Talk:
        """Send a command and return its answer without `ACK`. FieldError for `NCK` and for none."""
        self._send(command.encode() + b"\r")
        heard = yield from self._listened(lambda heard: end.search(heard[-LONGEST:]) is not None, ANSWER_S)
        before, known, answer = heard.partition(b"ACK")
        if b"NCK" in (before if known else heard):
            raise FieldError(f"found NCK, expected ACK to {command}")
        if not known or (end is _PROMPT and end.search(heard[-LONGEST:]) is None):
            raise FieldError(
                f"found {_shown(heard)}, expected ACK to {command}, its answer and the prompt (:)"
            )
        return answer.rstrip(b"\r\n :") if end is _PROMPT else answer

    def _send(self, data: bytes) -> None:
        try:
            os.write(self._line, data)
        except OSError:
            raise ConnectionError(0, UNPLUGGED) from None

    def _listened(self, over: Callable[[bytes], bool], silent_s: float) -> Talk:
        """Return what is heard until it is over, or until nothing came for a while, or too much did."""
        answer, until = b"", time.monotonic() + silent_s
        while time.monotonic() < until and len(answer) < 2 * MOST_BYTES:
            try:
                data = os.read(self._line, PORTION)
            except BlockingIOError:
                yield None
                continue
            except OSError:
                data = b""
            if not data:
                raise ConnectionError(0, UNPLUGGED)
            answer, until = answer + data, time.monotonic() + silent_s
            if over(answer):
                break
        return answer


def _open_serial(name: str, device: Path, baud: int) -> int:
    try:
        import termios
        import tty
    except ImportError:
        raise SourceError(
            name, "serial lines need Linux or macOS; save the frames and open the file"
        ) from None
    line = os.open(device, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    try:
        tty.setraw(line)
        settings, speed = termios.tcgetattr(line), getattr(termios, f"B{baud}")
        settings[2] |= termios.CLOCAL | termios.CREAD
        settings[4:6] = [speed, speed]
        termios.tcsetattr(line, termios.TCSANOW, settings)
    except termios.error:
        os.close(line)
        raise SourceError(name, f"{device} is no serial line, expected one like /dev/ttyUSB0") from None
    return line


def _shown(answer: bytes) -> str:
    if not answer:
        return "no answer"
    return f"{len(answer)} bytes ({answer[:20].decode('ascii', 'backslashreplace').strip()!r})"
