"""The short version of `make fuzz`; and that it would find something if there were something."""

from __future__ import annotations

import itertools
import json
import resource
import tracemalloc
from pathlib import Path
from typing import Any

import fuzz_all
import pytest
from fuzz_bridges import FOXGLOVE, ROSBRIDGE, ScriptedConnection
from fuzz_inputs import DUMPS, LOGS, STREAMS
from fuzz_targets import ARGUMENTS, SHARES, TARGETS, Target, prepare, try_drawn
from fuzz_watch import TookTooLong, in_memory, in_time

from maurice_loaders.formats.cmucam import decode_frame, frames
from maurice_loaders.formats.registry import open_session
from maurice_loaders.live.source import LineCutter
from maurice_loaders.live.websocket import ASK, WebsocketStream
from maurice_loaders.reading.options import Reading
from maurice_loaders.reading.recording import Picture
from maurice_loaders.session_log.reader import SurveyLog, is_survey
from maurice_loaders.session_log.records import LineReader

COUNT = 60


def said(topic: str, message: object) -> str:
    return json.dumps({"op": "publish", "topic": topic, "msg": message})


def topics(name: str) -> str:
    values = {"topics": [name], "types": ["sensor_msgs/CompressedImage"]}
    return json.dumps({"op": "service_response", "id": ASK, "values": values})


@pytest.mark.parametrize("name", TARGETS)
def test_wrong_inputs_are_refused_in_one_line(name: str, tmp_path: Path) -> None:
    prepare(tmp_path)
    refused = [fuzz_all.try_one(name, number, tmp_path) for number in range(COUNT)]
    assert [line for line in refused if "\n" in line] == []


@pytest.mark.parametrize("name", ARGUMENTS)
def test_laws_of_what_peers_send(name: str) -> None:
    assert try_drawn(name, 0, COUNT) >= COUNT // 2


@pytest.mark.parametrize("data", LOGS)
def test_logs_are_right_before_they_are_changed(data: bytes, tmp_path: Path) -> None:
    prepare(tmp_path)
    (tmp_path / "a.log").write_bytes(data)
    path = tmp_path / "a.log"
    log = SurveyLog(path) if is_survey(path) else open_session(path)
    pictures = list(log.survey_pictures() if isinstance(log, SurveyLog) else log.moments())
    assert bool(pictures) == (b'"image": ' in data or b'"scan": ' in data)
    assert log.problem_count == 0


def test_dumps_are_right_before_they_are_changed_and_every_share_is_somebodys() -> None:
    for data in DUMPS:
        found = [frame for frame in frames(data) if not frame.fault]
        assert found
        assert all(decode_frame(data[one.begin : one.end]).size for one in found)
    assert sum(SHARES.values()) == pytest.approx(1)
    assert set(SHARES) == {*TARGETS, *ARGUMENTS}
    assert STREAMS


@pytest.mark.parametrize("talk", [*FOXGLOVE, *ROSBRIDGE])
def test_bridges_are_right_before_they_are_changed(talk: Any) -> None:
    protocol = "foxglove.websocket.v1" if talk in FOXGLOVE else None
    connection: Any = ScriptedConnection(protocol, talk)
    channel = WebsocketStream("ws://robot:1", connection, connection.close, Reading())
    data = b"".join(channel.read(0.0) or b"" for _ in range(len(talk)))
    header, *lines = LineCutter().feed(data)
    assert json.loads(header.data)["kind"] == "session"
    records = [LineReader(Path("live")).record(line) for line in lines]
    assert sum(isinstance(record, Picture) for record in records) == 3
    assert sum("odometry" in str(line.data) for line in lines) == 2


NO_TIME = {"timestamp": {"sec": 10**300, "nsec": 0}, "pose": None}
FOUND_ONCE: dict[str, tuple[str, list[str]]] = {
    "half a character in a picture": ("rosbridge", [said("/camera", {"format": "jpeg", "data": "\ud800"})]),
    "half a character in a topic": ("rosbridge", [topics("/camera\ud800")]),
    "a time in another universe": ("rosbridge", [said("/camera", NO_TIME), said("/odom", NO_TIME)]),
    "a number of 5000 digits": ("Foxglove bridge", ['{"op": ' + "9" * 5000 + "}"]),
}


@pytest.mark.parametrize("name", FOUND_ONCE)
def test_what_was_found_once_is_not_found_again(name: str, tmp_path: Path) -> None:
    target, messages = FOUND_ONCE[name]
    talk = ROSBRIDGE[0] if target == "rosbridge" else FOXGLOVE[0]
    for heard in ([*talk[:2], *messages, *talk[2:]], [*messages, None]):
        assert "\n" not in TARGETS[target].read(heard, tmp_path)


def test_what_hangs_or_hogs_is_caught() -> None:
    with pytest.raises(TookTooLong), in_time(cpu_s=0.1):
        for _ in itertools.repeat(None):
            pass
    tracemalloc.start()
    try:
        with pytest.raises(AssertionError, match="2 MiB were taken"), in_memory(2**20):
            bytearray(2 * 2**20 + 1000)
    finally:
        tracemalloc.stop()


@pytest.fixture
def planted(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """A target that fails at one input, and cannot be gone through at once."""
    tried: list[int] = []

    def read(number: int, folder: Path) -> str:
        tried.append(number)
        if len(tried) == 700:
            raise KeyboardInterrupt
        if number == made(42):
            raise ZeroDivisionError("planted")
        return ""

    def made(number: int) -> int:
        return fuzz_all.Random(f"planted {number}").randrange(2**60)

    monkeypatch.setattr(fuzz_all, "TARGETS", {"planted": Target(lambda r: r.randrange(2**60), read)})
    monkeypatch.setattr(fuzz_all, "SHARES", {"planted": 1.0})
    return tried


def test_a_crash_is_told_by_its_number_and_a_stopped_run_goes_on(
    planted: list[int], tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    before = resource.getrlimit(resource.RLIMIT_AS)
    words = ["--inputs", "1000", "--state", str(tmp_path / "state.json")]
    with pytest.raises(KeyboardInterrupt):
        fuzz_all.main(words)
    assert fuzz_all.main(words) == 1
    assert len(planted) == 700 + 500  # the second batch anew
    said = capfd.readouterr().out
    assert "--one 'planted' 42: ZeroDivisionError: planted" in said
    assert "going on after 500 inputs" in said
    assert said.splitlines()[-1].startswith("1000 inputs in ")
    with pytest.raises(ZeroDivisionError):
        fuzz_all.main([*words, "--one", "planted", "42"])
    assert resource.getrlimit(resource.RLIMIT_AS) == before, "tests that come later start other programs"
