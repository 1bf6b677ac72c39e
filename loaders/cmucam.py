"""CMUcam frame dumps: a file of frames as the serial line gave them, or a folder of such files."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from itertools import count
from pathlib import Path

from maurice_mcl.session import SessionInfo
from maurice_mcl.typing import U8

from .cmucam_frames import MOST_BYTES, Found, decode_frame, frames
from .errors import LogError
from .file_names import natural_order
from .findings import Findings
from .formats import Format, OpenOptions
from .pictures import PictureError
from .recording import Picture, Record

CHUNK_BYTES = 2**17
PERIOD_S = 1.0  # frames carry no time
PREFIX = 256  # bytes of text (banner, ACK, prompt) before the first frame
ENDINGS = (".dump", ".dmp", ".raw", ".bin", ".cmu", ".dat", ".frame", ".txt", "")


@dataclass(frozen=True, slots=True, eq=False)
class DumpRecording:
    """Frames one after the other, one file or several."""

    path: Path
    info: SessionInfo

    def records(self, findings: Findings) -> Iterator[Record]:
        """Give the frames in order, a second apart; only some of a file is held."""
        findings.warning("frames carry no times: one a second is taken")
        number = count()
        for file in _files(self.path):
            for frame in _found(file):
                at = next(number)
                name = f"{file.name}, byte {frame.begin}"
                yield Picture(at * PERIOD_S, partial(_read, file, frame), name)


def open_dump(path: Path, options: OpenOptions) -> DumpRecording:
    """Open a dump. LogError where there is no frame at all."""
    if not any(not frame.fault for file in _files(path) for frame in _found(file)):
        raise LogError(path, "found no whole frame (01 ... 03), expected a CMUcam's frame dump")
    return DumpRecording(path, SessionInfo(path.resolve().stem))


def looks_like_dump(path: Path) -> bool:
    """Tell a dump by a whole frame at its beginning, after at most some lines of text."""
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
    """Give the dumps of a folder in natural order, or the file itself."""
    if not path.is_dir():
        return [path]
    return natural_order(one for one in path.iterdir() if one.is_file() and one.suffix.lower() in ENDINGS)


def _found(file: Path) -> Iterator[Found]:
    """Find the frames of a file, a piece at a time; positions are the file's."""
    try:
        with file.open("rb") as source:
            held, start = b"", 0
            while chunk := source.read(CHUNK_BYTES):
                held, used = held + chunk, 0
                for frame in frames(held, last=False):
                    yield Found(start + frame.begin, start + frame.end, frame.fault)
                    used = frame.end
                keep = min(len(held), max(used, len(held) - MOST_BYTES))
                held, start = held[keep:], start + keep
            for frame in frames(held):
                yield Found(start + frame.begin, start + frame.end, frame.fault)
    except OSError as problem:
        raise LogError(file, f"cannot be read: {problem.strerror}") from None


def _read(file: Path, frame: Found) -> U8:
    if frame.fault:
        raise PictureError(frame.fault)
    with file.open("rb") as source:
        source.seek(frame.begin)
        return decode_frame(source.read(frame.end - frame.begin))


FORMATS = (Format("cmucam", "a CMUcam's frame dump, or a folder of them", looks_like_dump, open_dump),)
