"""What is tried: what targets read and peers send. Only our own errors may come out of it."""

from __future__ import annotations

import itertools
import json
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest
from fuzz_bridges import FOXGLOVE, ROSBRIDGE, Conversation, ScriptedConnection, mutated_talk
from fuzz_inputs import CARMEN, DUMPS, HEADER, JPEG, LOGS, ON_DISK, PICTURE, SCAN, STREAMS, mutated
from fuzz_watch import in_time
from hypothesis import HealthCheck, given, seed, settings
from hypothesis import strategies as st

from maurice_loaders.bags.topics import PoseTopic
from maurice_loaders.errors import FieldError, InputError, PictureError, ReadingNotes
from maurice_loaders.formats.cmucam import MOST_BYTES, decode_frame, frames, looks_like_dump, open_dump
from maurice_loaders.formats.registry import open_session
from maurice_loaders.live import source as live_source_module
from maurice_loaders.live.intake import Intake, Received
from maurice_loaders.live.session import LiveRecorder
from maurice_loaders.live.source import Listening, LiveSource, Patience
from maurice_loaders.live.translation import ChosenTopics, Translator
from maurice_loaders.live.websocket import ASK, HEAD, Foxglove, Rosbridge, WebsocketStream
from maurice_loaders.reading.observations import SCANS
from maurice_loaders.reading.options import Reading
from maurice_loaders.reading.recording import Picture
from maurice_loaders.session_log.reader import SurveyLog, is_survey
from maurice_loaders.session_log.records import LineReader, read_header

CARMENS = [text.encode() for text in CARMEN]
HEAD_LINE = json.dumps(HEADER)


def line(t_s: float, **record: object) -> bytes:
    return (json.dumps({"t": t_s} | record) + "\n").encode()


NUMBERS = st.one_of(
    st.floats(), st.integers(), st.floats(-100, 100), st.sampled_from([1e9, 4e9, -4e9, 1e400])
)
JSON = st.recursive(
    st.one_of(st.none(), st.booleans(), NUMBERS, st.text(max_size=6)),
    lambda inner: st.one_of(
        st.lists(inner, max_size=4), st.dictionaries(st.text(max_size=5), inner, max_size=4)
    ),
    max_leaves=8,
)
KEYS = st.sampled_from(
    ["t", "odometry", "image", "truth", "event", "camera", "covered", "encoders_m", "format", "x", "scan"]
)
SCAN_KEYS = st.sampled_from([*SCAN, "mount"])
VECTORS = st.lists(NUMBERS, min_size=3, max_size=3)
RECORDS = st.one_of(
    st.builds(
        lambda t, m: line(t, odometry=m),
        st.floats(-10, 1e3),
        st.lists(st.floats(-5, 5), min_size=3, max_size=3),
    ),
    st.builds(lambda t: line(t, image={"base64": PICTURE}), st.floats(-10, 1e3)),
    st.builds(lambda t, e: line(t, event=e), NUMBERS, st.text(max_size=5)),
    st.builds(lambda t, key, value: line(t, scan=SCAN | {key: value}), st.floats(-10, 1e3), SCAN_KEYS, JSON),
    st.dictionaries(KEYS, st.one_of(JSON, VECTORS), max_size=4).map(lambda found: line(0, **found)),
    st.just(HEAD_LINE.encode() + b"\n"),
    st.binary(max_size=40),
    st.just(b"\n"),
)
PORTIONS = st.lists(st.one_of(RECORDS, st.none()), max_size=12)
CUTS = st.lists(st.integers(1, 60), min_size=1, max_size=5)


class Scripted:
    """A channel that gives what it was given, cut anew; None: a moment in which nothing comes."""

    def __init__(self, portions: list[bytes | None], cuts: list[int]) -> None:
        self._parts = self._cut(portions, cuts)

    def read(self, wait_s: float) -> bytes | None:
        return next(self._parts, b"")

    def close(self) -> None: ...

    @staticmethod
    def _cut(portions: list[bytes | None], cuts: list[int]) -> Iterator[bytes | None]:
        sizes = itertools.cycle(cuts)
        for portion in portions:
            if portion is None:
                yield None
                continue
            at = 0
            while at < len(portion):
                size = next(sizes)
                yield portion[at : at + size]
                at += size


def check_recording(connections: list[tuple[list[bytes | None], list[int], bool]]) -> None:
    """Whatever comes, over however many connections, what is recorded is a log that is right."""
    stop = threading.Event()
    scripts = [
        Scripted([HEAD_LINE.encode() + b"\n", *portions] if greets else portions, cuts)
        for portions, cuts, greets in connections
    ]
    waiting = iter(scripts)

    def connect() -> Scripted:
        script = next(waiting, None)
        if script is None:
            stop.set()
            raise ConnectionRefusedError(111, "Connection refused")
        return script

    source, notes = LiveSource("peer", connect, peer=True), ReadingNotes(keep_going=True)
    with pytest.MonkeyPatch.context() as patch, tempfile.TemporaryDirectory() as folder:
        patch.setattr(live_source_module, "FIRST_WAIT_S", 0.0)
        recorder = LiveRecorder(Path(folder))
        intake = Intake(source, Listening(source, stop, Patience(60)), notes, lambda text: None)
        heard, begun, refused = [], False, ""
        try:
            for one in intake:
                if intake.info is not None and not begun:
                    recorder.begin(intake.info)
                    begun = True
                if isinstance(one, Received):
                    recorder.add(one.line)
                    heard.append(one.record.t_s)
        except InputError as problem:
            refused = str(problem)
        finally:
            recorder.close()
        assert "\n" not in refused
        assert not (begun and refused)
        assert heard == sorted(heard)
        if begun:
            assert read_header(recorder.path)[1] == "session"
            again = LineReader(recorder.path).records(ReadingNotes(keep_going=False))
            assert [record.t_s for record in again] == heard


OPS = st.sampled_from(["advertise", "unadvertise", "serverInfo", "publish", "service_response", "status"])
CHANNEL = st.fixed_dictionaries(
    {
        "id": st.one_of(st.integers(0, 3), JSON),
        "topic": st.sampled_from(["/odom", "/camera"]),
        "encoding": st.sampled_from(["cdr", "json", "ros1", "protobuf"]),
        "schemaName": st.sampled_from(["nav_msgs/msg/Odometry", "foxglove.CompressedImage", "nothing"]),
        "schema": st.one_of(st.just(""), st.text(max_size=20)),
    }
)
MESSAGES = st.one_of(
    st.builds(
        lambda op, more: {"op": op} | more, OPS, st.dictionaries(st.text(max_size=8), JSON, max_size=3)
    ),
    st.lists(st.one_of(CHANNEL, JSON), max_size=3).map(lambda found: {"op": "advertise", "channels": found}),
    st.builds(lambda found: {"op": "service_response", "id": ASK, "values": found}, JSON),
    st.builds(lambda found: {"op": "publish", "topic": "/odom", "msg": found}, JSON),
    JSON,
)
SAID = st.one_of(
    MESSAGES,
    st.binary(max_size=60),
    st.text(max_size=30),
    st.builds(lambda number, data: HEAD.pack(1, number, 5) + data, st.integers(0, 3), st.binary(max_size=80)),
    st.builds(lambda number: HEAD.pack(1, number, 5) + line(0, timestamp=3), st.integers(0, 3)),
)


def check_bridge(bridge_of: type, said: list[object]) -> None:
    """Whatever a bridge says is a message, or one complaint."""
    bridge, translator = bridge_of(), Translator(0.1)
    topics = ChosenTopics("/camera", PoseTopic("/odom"))
    for one in said:
        message = one if isinstance(one, bytes | str) else json.dumps(one)
        try:
            heard = bridge.hear(message)
            list(bridge.subscribe(topics.names))
            if heard is not None:
                assert all(isinstance(found["t"], float) for found in translator.take(heard, topics))
        except FieldError:
            continue
        assert len(bridge.topics) < 10_000


ARGUMENTS = {
    "drawn streams": (
        check_recording,
        (st.lists(st.tuples(PORTIONS, CUTS, st.booleans()), min_size=1, max_size=3),),
    ),
    "drawn bridges": (check_bridge, (st.sampled_from([Foxglove, Rosbridge]), st.lists(SAID, max_size=10))),
}
PROPERTIES = {"drawn streams": 0.05, "drawn bridges": 0.05}  # of all inputs of `make fuzz`


def try_drawn(name: str, number: int, count: int) -> int:
    """Try so many inputs of a kind, the ones of this number; give how many there were."""
    check, drawn = ARGUMENTS[name]
    tried = 0

    def one(values: tuple[Any, ...]) -> None:
        nonlocal tried
        tried += 1
        with in_time():
            check(*values)

    quiet = settings(
        max_examples=count, database=None, deadline=None, suppress_health_check=list(HealthCheck)
    )
    seed(number)(quiet(given(st.tuples(*drawn))(one)))()
    return tried


Make = Callable[[Random], Any]
Read = Callable[[Any, Path], str]


@dataclass(frozen=True, slots=True)
class Target:
    """Something that reads what others wrote."""

    make: Make  # an input
    read: Read  # with a folder for files; what was refused, in one line; raises for what must not happen


def read_log(data: bytes, folder: Path) -> str:
    """Read a file as a session or survey log, to its end, and once more where every problem is an error."""
    path = folder / "fuzz.log"
    path.write_bytes(data)
    _refused(lambda: _go_through(path, Reading(format="session-log", keep_going=True)))
    return _refused(lambda: _go_through(path, Reading(format="session-log")))


def _go_through(path: Path, options: Reading) -> None:
    if is_survey(path):
        survey = SurveyLog(path, options)
        assert survey.count_pictures() >= 0
        for picture in survey.survey_pictures():
            assert picture.image.dtype == np.uint8
            assert picture.covered or picture.pose is not None
        return
    session = open_session(path, options)
    scans, (updates, _) = session.observed.scans, session.overview()
    times = []
    for moment in session.moments():
        assert moment.frame.motions.shape[1] == 3
        assert np.isfinite(moment.frame.motions).all()
        assert moment.truth is None or np.isfinite(moment.truth).all()
        if moment.frame.scan is not None:
            assert scans or session.observed.pictures
            assert np.isfinite(moment.frame.scan.points()).all()
        times.append(moment.frame.time_s)
    assert times == sorted(times)
    assert len(times) <= updates
    assert updates <= session.count_pictures() or session.observed.name == SCANS


def read_carmen(data: bytes, folder: Path) -> str:
    """Read a file as a CARMEN log, twice as a session log is."""
    path = folder / "fuzz.clf"
    path.write_bytes(data)
    _refused(lambda: _go_through(path, Reading(format="carmen", keep_going=True)))
    return _refused(lambda: _go_through(path, Reading(format="carmen")))


def read_dump(data: bytes, folder: Path) -> str:
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
    return _refused(lambda: _all_pictures(path))


def _all_pictures(path: Path) -> None:
    for record in open_dump(path, Reading()).records(ReadingNotes(keep_going=True)):
        if isinstance(record, Picture):
            try:
                record.read()
            except PictureError:
                continue


def _refused(read: Callable[[], None]) -> str:
    """Read; return what is refused, which must be one line, or nothing."""
    said = ""
    try:
        read()
    except InputError as problem:
        said = str(problem)
    assert "\n" not in said
    return said


def make_stream(random: Random) -> tuple[bytes, list[int]]:
    """Make a stream, and the sizes of the portions in which it comes."""
    data = mutated(random.choice(STREAMS), STREAMS, random)
    largest = random.choice((10, 300, 5000))
    return data, [random.randint(1, largest) for _ in range(5)]


def read_stream(cut: tuple[bytes, list[int]], folder: Path) -> str:
    """Take in a stream as a live source's."""
    return _listen(lambda: Scripted([cut[0]], cut[1]))


def read_bridge(subprotocol: str | None, talk: Conversation, folder: Path) -> str:
    """Take in what a bridge says."""
    connection: Any = ScriptedConnection(subprotocol, talk)
    said = _listen(lambda: WebsocketStream("ws://robot:1", connection, connection.close, Reading()))
    assert connection.sent < 10_000 * len(talk)
    return said


def _listen(connect: Callable[[], Any]) -> str:
    stop = threading.Event()
    source = LiveSource("peer", connect, peer=True, once=True)
    intake = Intake(
        source, Listening(source, stop, Patience(60)), ReadingNotes(keep_going=True), lambda text: None
    )
    return _refused(lambda: _check(iter(intake)))


def _check(arrivals: Iterator[Received | None]) -> None:
    last_s = float("-inf")
    for received in arrivals:
        if received is None:
            continue
        record = received.record
        assert record.t_s >= last_s
        assert received.line.count(b"\n") == 1
        last_s = record.t_s
        if isinstance(record, Picture):
            with suppress(PictureError):
                record.read()


TARGETS: dict[str, Target] = {
    "session log": Target(lambda random: mutated(random.choice(LOGS), LOGS, random), read_log),
    "CARMEN log": Target(lambda random: mutated(random.choice(CARMENS), CARMENS, random), read_carmen),
    "CMUcam dump": Target(lambda random: mutated(random.choice(DUMPS), DUMPS, random), read_dump),
    "stream": Target(make_stream, read_stream),
    "Foxglove bridge": Target(
        lambda random: mutated_talk(FOXGLOVE, random), partial(read_bridge, "foxglove.websocket.v1")
    ),
    "rosbridge": Target(lambda random: mutated_talk(ROSBRIDGE, random), partial(read_bridge, None)),
}
SHARES: dict[str, float] = {  # of all inputs; the rest is made by hypothesis
    "session log": 0.35,
    "CARMEN log": 0.05,
    "CMUcam dump": 0.20,
    "stream": 0.15,
    "Foxglove bridge": 0.10,
    "rosbridge": 0.05,
} | PROPERTIES


def prepare(folder: Path) -> None:
    """Put beside the logs what they name."""
    (folder / ON_DISK).write_bytes(JPEG)
