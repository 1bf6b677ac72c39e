"""Whatever a peer sends, made by hypothesis: laws of what is recorded and understood."""

from __future__ import annotations

import itertools
import json
import tempfile
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from fuzz_seeds import HEADER as HEADER_OBJECT
from fuzz_seeds import PICTURE
from fuzz_watch import in_time
from hypothesis import HealthCheck, given, seed, settings
from hypothesis import strategies as st

from maurice_loaders.bags.topics import PoseTopic
from maurice_loaders.errors import FieldError, InputError, ReadingNotes
from maurice_loaders.live import source as live_source_module
from maurice_loaders.live.intake import Intake, Received
from maurice_loaders.live.session import LiveRecorder
from maurice_loaders.live.source import Listening, LiveSource, Patience
from maurice_loaders.live.translation import ChosenTopics, Translator
from maurice_loaders.live.websocket import ASK, HEAD, Foxglove, Rosbridge
from maurice_loaders.session_log.records import read_header, read_records

HEADER = json.dumps(HEADER_OBJECT)


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
    ["t", "odometry", "image", "truth", "event", "camera", "covered", "encoders_m", "format", "x"]
)
VECTORS = st.lists(NUMBERS, min_size=3, max_size=3)
RECORDS = st.one_of(
    st.builds(
        lambda t, m: line(t, odometry=m),
        st.floats(-10, 1e3),
        st.lists(st.floats(-5, 5), min_size=3, max_size=3),
    ),
    st.builds(lambda t: line(t, image={"base64": PICTURE}), st.floats(-10, 1e3)),
    st.builds(lambda t, e: line(t, event=e), NUMBERS, st.text(max_size=5)),
    st.dictionaries(KEYS, st.one_of(JSON, VECTORS), max_size=4).map(lambda found: line(0, **found)),
    st.just(HEADER.encode() + b"\n"),
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
        Scripted([HEADER.encode() + b"\n", *portions] if greets else portions, cuts)
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
            log = recorder.path
            assert read_header(log)[1] == "session"
            assert [
                record.t_s for record in read_records(log, "session", ReadingNotes(keep_going=False))
            ] == heard


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
    st.builds(
        lambda found: {"op": "advertise", "channels": found}, st.lists(st.one_of(CHANNEL, JSON), max_size=3)
    ),
    st.builds(lambda found: {"op": "service_response", "id": ASK, "values": found}, JSON),
    st.builds(lambda found: {"op": "publish", "topic": "/odom", "msg": found}, JSON),
    JSON,
)
SAID = st.one_of(
    MESSAGES,
    st.binary(max_size=60),
    st.text(max_size=30),
    st.builds(lambda number, data: HEAD.pack(1, number, 5) + data, st.integers(0, 3), st.binary(max_size=80)),
    st.builds(
        lambda number, data: HEAD.pack(1, number, 5) + line(0, **data),
        st.integers(0, 3),
        st.just({"timestamp": 3}),
    ),
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
SHARES = {"drawn streams": 0.05, "drawn bridges": 0.05}  # of all inputs of `make fuzz`


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
