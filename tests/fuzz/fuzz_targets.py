"""What is tried: each target makes an input and reads it. Only our own errors may come out of it."""

from __future__ import annotations

import itertools
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
from fuzz_bridges import FOXGLOVE, ROSBRIDGE, Conversation, ScriptedConnection, mutated_talk
from fuzz_mutations import mutated
from fuzz_properties import SHARES as PROPERTIES
from fuzz_seeds import DUMPS, JPEG, LOGS, ON_DISK, STREAMS

from maurice_loaders.errors import InputError, PictureError, ReadingNotes
from maurice_loaders.formats.cmucam import MOST_BYTES, decode_frame, frames, looks_like_dump, open_dump
from maurice_loaders.live.intake import Intake, Received
from maurice_loaders.live.source import Listening, LiveSource, Patience
from maurice_loaders.live.websocket import WebsocketStream
from maurice_loaders.pictures import decode_picture
from maurice_loaders.reading import ReadingOptions
from maurice_loaders.recording import Picture
from maurice_loaders.session_log.reader import SessionLog, picture_bytes
from maurice_loaders.session_log.records import PictureRecord

Make = Callable[[Random], Any]
Read = Callable[[Any, Path], None]


@dataclass(frozen=True, slots=True)
class Target:
    """Something that reads what others wrote."""

    make: Make  # an input
    read: Read  # with a folder for files; raises for what must not happen


def read_log(data: bytes, folder: Path) -> None:
    """Read a file as a session or survey log, to its end, and once more where every problem is an error."""
    path = folder / "fuzz.log"
    path.write_bytes(data)
    _refused(lambda: _go_through(SessionLog(path, keep_going=True)))
    _refused(lambda: _go_through(SessionLog(path)))


def _go_through(log: SessionLog) -> None:
    pictures = log.count_pictures()
    if log.kind == "survey":
        for one in log.survey_pictures():
            assert one.image.dtype == np.uint8
            assert one.covered or one.pose is not None
        return
    updates, _ = log.overview()
    times = []
    for moment in log.moments():
        assert moment.frame.motions.shape[1] == 3
        assert np.isfinite(moment.frame.motions).all()
        assert moment.truth is None or np.isfinite(moment.truth).all()
        times.append(moment.frame.time_s)
    assert times == sorted(times)
    assert len(times) <= updates <= pictures


def read_dump(data: bytes, folder: Path) -> None:
    """Read bytes as a CMUcam's dump, in memory and from a file."""
    end = 0
    for frame in frames(data):
        assert end <= frame.begin < frame.end <= len(data)
        end = frame.end
        piece = data[frame.begin : frame.end]
        assert frame.end - frame.begin <= MOST_BYTES + 1
        if frame.fault:
            assert "\n" not in frame.fault
        else:
            picture = decode_frame(piece)
            assert picture.ndim == 3
            assert picture.shape[2] == 3
    path = folder / "fuzz.dump"
    path.write_bytes(data)
    looks_like_dump(path)
    _refused(lambda: _all_pictures(path))


def _all_pictures(path: Path) -> None:
    for record in open_dump(path, ReadingOptions()).records(ReadingNotes(keep_going=True)):
        if isinstance(record, Picture):
            try:
                record.read()
            except PictureError:
                continue


def _refused(read: Callable[[], None]) -> None:
    """Read; what is refused must be refused in one line."""
    said = ""
    try:
        read()
    except InputError as problem:
        said = str(problem)
    assert "\n" not in said


@dataclass(frozen=True, slots=True)
class Cut:
    """A stream, and in which portions it comes."""

    data: bytes
    sizes: list[int]


def make_stream(random: Random) -> Cut:
    data = mutated(random.choice(STREAMS), STREAMS, random)
    largest = random.choice((10, 300, 5000))
    return Cut(data, [random.randint(1, largest) for _ in range(5)])


class CutChannel:
    """A channel that gives a stream in portions."""

    def __init__(self, cut: Cut) -> None:
        self._data, self._at, self._sizes = cut.data, 0, itertools.cycle(cut.sizes)

    def read(self, wait_s: float) -> bytes:
        begin = self._at
        self._at += next(self._sizes)
        return self._data[begin : self._at]

    def close(self) -> None: ...


def read_stream(cut: Cut, folder: Path) -> None:
    """Take in a stream as a live source's."""
    _listen(lambda: CutChannel(cut))


def read_foxglove(talk: Conversation, folder: Path) -> None:
    """Take in what a Foxglove bridge says."""
    _converse("foxglove.websocket.v1", talk)


def read_rosbridge(talk: Conversation, folder: Path) -> None:
    """Take in what rosbridge says."""
    _converse(None, talk)


def _converse(subprotocol: str | None, talk: Conversation) -> None:
    connection: Any = ScriptedConnection(subprotocol, talk)
    _listen(lambda: WebsocketStream("ws://robot:1", connection, connection.close, ReadingOptions()))
    assert connection.sent < 10_000 * len(talk)


def _listen(connect: Callable[[], Any]) -> None:
    stop = threading.Event()
    source = LiveSource("peer", connect, peer=True, once=True)
    intake = Intake(
        source, Listening(source, stop, Patience(60)), ReadingNotes(keep_going=True), lambda text: None
    )
    _refused(lambda: _check(iter(intake)))


def _check(heard: Iterator[Received | None]) -> None:
    last_s = float("-inf")
    for one in heard:
        if one is None:
            continue
        assert one.record.t_s >= last_s
        assert one.line.count(b"\n") == 1
        last_s = one.record.t_s
        if isinstance(one.record, PictureRecord):
            try:
                decode_picture(picture_bytes(one.record, Path("nowhere")))
            except PictureError:
                continue


TARGETS: dict[str, Target] = {
    "session log": Target(lambda random: mutated(random.choice(LOGS), LOGS, random), read_log),
    "CMUcam dump": Target(lambda random: mutated(random.choice(DUMPS), DUMPS, random), read_dump),
    "stream": Target(make_stream, read_stream),
    "Foxglove bridge": Target(lambda random: mutated_talk(FOXGLOVE, random), read_foxglove),
    "rosbridge": Target(lambda random: mutated_talk(ROSBRIDGE, random), read_rosbridge),
}
SHARES: dict[str, float] = {  # of all inputs; the rest is made by hypothesis
    "session log": 0.35,
    "CMUcam dump": 0.25,
    "stream": 0.15,
    "Foxglove bridge": 0.10,
    "rosbridge": 0.05,
} | PROPERTIES


def prepare(folder: Path) -> None:
    """Put beside the logs what they name."""
    (folder / ON_DISK).write_bytes(JPEG)
