"""A live source through several filters: each run is what it is alone on a capture of that source."""

from __future__ import annotations

import base64
import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import count
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from rerun.chunk import RrdReader

import maurice_viz as mv
from helpers import expect_facts
from helpers.cmucam_peer import answer_to, camera
from helpers.commands import maurice, one_line, runs_of
from helpers.live_peers import free_address, peer, says
from helpers.rosbridge import after_subscribing, compressed, odometry, rosbridge
from maurice_loaders.live import cmucam as live_cmucam
from maurice_loaders.live import source as live_source_module
from maurice_loaders.live import websocket as live_websocket
from maurice_loaders.runs.store import first_difference, open_run
from maurice_viz.entities import RESULT, TEXT

PRESETS, PARTICLES = ("thesis", "robust"), 80
FEW = ("--particles", str(PARTICLES), "--json")
pytestmark = pytest.mark.filterwarnings("ignore:RRD file has no footer")  # live ones have none on purpose


@pytest.fixture(autouse=True)
def _quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live_source_module, "POLL_S", 0.05)
    monkeypatch.setattr(live_source_module, "LONGEST_WAIT_S", 0.2)
    monkeypatch.setattr(live_websocket, "CHOOSE_S", 0.5)


@pytest.fixture
def lines(small_session: Path) -> list[bytes]:
    """The session's lines with pictures inside, as a live robot sends them."""
    return [
        _with_picture_inside(line, small_session.parent) for line in small_session.read_bytes().splitlines()
    ]


def _with_picture_inside(line: bytes, folder: Path) -> bytes:
    record = json.loads(line)
    if isinstance(record.get("image"), str):
        record["image"] = {"base64": base64.b64encode((folder / record["image"]).read_bytes()).decode()}
    return json.dumps(record).encode() + b"\n"


@contextmanager
def _socket(lines: list[bytes], monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    with peer(says(b"".join(lines))) as address:
        yield address


@contextmanager
def _pipe(lines: list[bytes], monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    read, write = os.pipe()

    def send() -> None:
        with os.fdopen(write, "wb") as pipe:
            pipe.writelines(lines)

    thread = threading.Thread(target=send)
    thread.start()
    monkeypatch.setattr(sys, "stdin", SimpleNamespace(fileno=lambda: read))
    yield "-"
    thread.join()
    os.close(read)


@contextmanager
def _slow_pipe(lines: list[bytes], monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """A robot that takes a picture every 16 s, with the true pose right after it."""
    records = [json.loads(line) for line in lines[1:]]
    later = [json.dumps(record | {"t": 8 * record["t"]}).encode() + b"\n" for record in records]
    with _pipe([lines[0], *later], monkeypatch) as source:
        yield source


@contextmanager
def _growing_file(lines: list[bytes], monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    file = Path("growing.log")
    file.touch()

    def write() -> None:
        with file.open("wb", buffering=0) as log:
            for line in lines:
                log.write(line)
                time.sleep(0.01)

    thread = threading.Thread(target=write)
    thread.start()
    yield str(file)
    thread.join()


@contextmanager
def _rosbridge(lines: list[bytes], monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    pytest.importorskip("websockets")

    def send(connection: Any) -> None:
        for step in range(12):
            connection.send(odometry(0.5 * step, 1.0 + 0.1 * step))
            connection.send(compressed(0.5 * step))

    with rosbridge(after_subscribing(send)) as address:
        yield address


@contextmanager
def _foxglove(lines: list[bytes], monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    for name in ("websockets", "rosbags", "foxglove"):
        pytest.importorskip(name)
    script = Path(__file__).parents[2] / "helpers" / "foxglove_bridge.py"
    command = [sys.executable, str(script), "0", "json", "12"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    try:
        yield f"ws://127.0.0.1:{process.stdout.readline().strip()}"
    finally:
        process.kill()
        process.wait()
        process.stdout.close()


@contextmanager
def _cmucam(lines: list[bytes], monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    for name, value in (("QUIET_S", 0.05), ("ANSWER_S", 0.4), ("SETTLE_S", 0.02)):
        monkeypatch.setattr(live_cmucam, name, value)
    frames = count()

    def answer(command: str) -> bytes | None:
        return None if command.startswith("SF") and next(frames) == 12 else answer_to(command)

    with camera(answer) as address:
        yield address


SOURCES = {
    "tcp": _socket,
    "stdin": _pipe,
    "slow": _slow_pipe,
    "follow": _growing_file,
    "rosbridge": _rosbridge,
    "foxglove": _foxglove,
    "cmucam": _cmucam,
}


WITH_TRUTH = ("tcp", "stdin", "slow", "follow")


@pytest.mark.parametrize(("kind", "keep_up"), [*((kind, False) for kind in SOURCES), ("tcp", True)])
def test_each_run_is_what_it_is_alone_on_a_capture(kind, keep_up, lines, small_session, monkeypatch):
    survey = small_session.parent / "survey.log"
    live = mv.LiveOptions(kind == "follow", Path("drive"), keep_up, patience_s=1.0)
    with SOURCES[kind](lines, monkeypatch) as source:
        scores = mv.compare(
            source,
            survey,
            filters=[mv.Filter(value, particles=PARTICLES) for value in PRESETS],
            live=live,
            save_run="both",
        )
    assert [run.label for run in scores.runs] == list(PRESETS)
    assert scores.runs[1].against == PRESETS[0]
    assert scores.saved_run == Path("both")
    assert [str(run) for run in mv.verify("both") if not run.same] == []
    for preset in PRESETS:
        mv.replay("drive", filter=mv.Filter(preset, particles=PARTICLES), save_run=f"alone-{preset}")
        alone, beside = open_run(f"alone-{preset}"), open_run(Path("both") / preset)
        pairs = list(zip(alone.steps(), beside.steps(), strict=True))
        assert len(pairs) >= (1 if keep_up else 10)
        assert [first_difference(*pair) for pair in pairs] == [None] * len(pairs)
        assert beside.manifest.pictures == len(pairs)
        assert alone.manifest.has_truth == beside.manifest.has_truth == (kind in WITH_TRUTH)


def test_the_recording_of_several_live_runs_has_all_of_them_and_their_verdict(lines, small_session):
    survey = small_session.parent / "survey.log"
    with peer(says(b"".join(lines))) as address:
        words = ["--preset", "thesis", "--preset", "robust", "--preset", "refined", "--patience", "0.5"]
        out, err = maurice("compare", address, "--library", survey, *words, *FEW, "--every-picture")
    assert [run["label"] for run in runs_of(out)] == ["thesis", "robust", "refined"]
    expect_facts(err, "live-thesis-robust-refined.rrd", "14 pictures came, 0 were skipped")
    assert err.count("thesis uses") == 1
    seen = {
        str(chunk.entity_path): chunk.to_record_batch().num_rows
        for chunk in RrdReader("live-thesis-robust-refined.rrd").stream()
    }
    for label in ("thesis", "robust", "refined"):
        assert f"/{label}/belief/estimate" in seen
    assert {TEXT, RESULT} <= {path.strip("/") for path in seen} | set(seen)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("a.log", "tcp://127.0.0.1:1", *FEW), "a live source is compared alone"),
        (("a.log", "b.log", "--follow", *FEW), "a live source is compared alone"),
        (("a.log", "--capture", "drive", *FEW), "need a live source"),
        (("tcp://127.0.0.1:1", "--save-run", "both", *FEW), "add --capture DIR"),
        (("tcp://127.0.0.1:1", "--preset", "robust", *FEW, "--feature", "color"), "found 1 run to compare"),
    ],
    ids=str,
)
def test_what_does_not_fit_a_live_source_is_a_usage_error(words, said):
    for name in ("a.log", "b.log"):
        Path(name).touch()
    _, err = maurice("compare", *words, expect=2)
    assert said in " ".join(err.split())


def test_a_source_that_is_not_there_is_one_line(small_session):
    survey = small_session.parent / "survey.log"
    _, err = maurice("compare", free_address(), "--library", survey, "--patience", "0.3", *FEW, expect=1)
    assert "found no session log there" in one_line(err.splitlines()[-1])
