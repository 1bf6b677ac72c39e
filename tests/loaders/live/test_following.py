"""The commands, as processes of their own: whatever ends them, the files are complete."""

from __future__ import annotations

import base64
import json
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rerun.chunk import RrdReader
from typer.testing import CliRunner, Result

from helpers import expect_facts
from helpers.live_peers import HEADER, Act, free_address, line, peer, says
from maurice_loaders.files.pictures import encode_jpeg
from maurice_loaders.formats.registry import open_session
from maurice_viz.cli.app import app

MAIN = [sys.executable, "-c", "from maurice_viz.cli.main import main; main()"]
PATIENCE_S = 60.0
pytestmark = pytest.mark.filterwarnings("ignore:RRD file has no footer")  # live ones have none on purpose
Text = subprocess.CompletedProcess[str]


@pytest.fixture(autouse=True)
def _nowhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without a display, and where files that nobody named do no harm."""
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")


def run(*words: object) -> Result:
    """Run a command in this process, which is quicker to begin than another one."""
    return CliRunner().invoke(app, [*map(str, words)])


def piped(said: bytes, *words: object) -> Text:
    """Run a command in a process of its own, whose standard input is a pipe."""
    pipe, command = subprocess.PIPE, [*MAIN, *map(str, words)]
    return subprocess.run(
        command, input=said.decode(), stdout=pipe, stderr=pipe, text=True, timeout=PATIENCE_S, check=False
    )


def figures(done: Result | Text) -> dict[str, Any]:
    """The figures of the only run, but for how fast it was."""
    found = json.loads(done.stdout)["runs"][0]
    assert isinstance(found, dict)
    return {key: value for key, value in found.items() if key != "steps_per_s"}


def with_picture_inside(line: bytes, folder: Path) -> bytes:
    record = json.loads(line)
    if isinstance(record.get("image"), str):
        record["image"] = {"base64": base64.b64encode((folder / record["image"]).read_bytes()).decode()}
    return json.dumps(record).encode() + b"\n"


def steps_in(recording: Path) -> set[int]:
    """The steps that a recording shows an estimate for."""
    steps: set[int] = set()
    estimates = {"content": "/blended/belief/estimate", "has_timeline": "step"}
    for chunk in RrdReader(recording).stream().filter(**estimates):
        steps |= set(chunk.to_record_batch().column("step").to_pylist())
    return steps


@pytest.fixture
def inline(small_session: Path) -> list[bytes]:
    """The session's lines with pictures inside, as a live robot says them."""
    lines = small_session.read_bytes().splitlines()
    return [with_picture_inside(line, small_session.parent) for line in lines]


@pytest.fixture
def library(small_session: Path) -> Path:
    return small_session.parent / "survey.log"


def test_a_pipe_gives_the_same_figures_as_the_file(
    small_session: Path, library: Path, inline: list[bytes]
) -> None:
    expected = figures(run(small_session, "--json", "-o", "none"))
    words = ["--library", library, "--json", "-o", "none", "--capture", "rec"]
    done = piped(b"".join(inline), "-", *words)
    assert done.returncode == 0, done.stderr
    assert figures(done) == expected
    again = run("rec/session.log", "--json", "-o", "none")
    assert figures(again) == expected
    assert "14 pictures came, 0 were skipped" in done.stderr


@pytest.mark.parametrize(
    ("later_s", "typed", "told"),
    [
        (60.0, [], "joined 6\\d s into the drive, so the particles start anywhere"),
        (60.0, ["--start", "tracking"], None),
        (0.0, [], None),
        (1.7e9, [], "starting where the header says"),
    ],
)
def test_who_joins_late_does_not_start_where_the_robot_was(
    inline: list[bytes], library: Path, later_s: float, typed: list[str], told: str | None
) -> None:
    records = [json.loads(line) for line in inline[1:]]
    moved = [json.dumps(record | {"t": record["t"] + later_s}).encode() + b"\n" for record in records]
    words = ["--library", library, "--json", "-o", "none", "--patience", "0.5", "--every-picture", *typed]
    with peer(says(b"".join([inline[0], *moved]))) as address:
        done = run(address, *words)
    assert done.exit_code == 0, done.stderr
    assert bool(told and re.search(told, done.stderr)) == (told is not None), done.stderr
    assert "joined" not in done.stderr or (told or "").startswith("joined")


def test_a_file_that_grows_gives_the_same_figures(small_session: Path, tmp_path: Path) -> None:
    expected = figures(run(small_session, "--json", "-o", "none"))
    growing = tmp_path / "growing.log"
    growing.touch()

    def write() -> None:
        with growing.open("wb", buffering=0) as log:
            for line in small_session.read_bytes().splitlines(keepends=True):
                log.write(line[:20])
                time.sleep(0.01)
                log.write(line[20:])

    writer = threading.Thread(target=write)
    writer.start()
    done = run(growing, "--follow", "--json", "--patience", "1", "-o", "a.rrd")
    writer.join()
    assert done.exit_code == 0, done.stderr
    assert figures(done) == expected
    assert steps_in(Path("a.rrd")) == set(range(1, 15))


def slowly(lines: list[bytes], pause_s: float) -> Act:
    def say(connection: socket.socket) -> None:
        for one in lines:
            connection.sendall(one)
            time.sleep(pause_s)

    return say


def test_a_file_that_is_not_there_yet_is_waited_for(small_session: Path, tmp_path: Path) -> None:
    new = tmp_path / "new.log"
    command = [*MAIN, str(new), "--follow", "--json", "-o", "none"]
    pipe = subprocess.PIPE
    process = subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True)
    assert process.stderr is not None
    assert process.stderr.readline() == f"{new}: is not there yet; waiting for it\n"
    process.send_signal(signal.SIGINT)
    _, rest = process.communicate(timeout=PATIENCE_S)
    assert (process.returncode, rest) == (130, "maurice-replay: stopped\n")

    def write() -> None:
        time.sleep(0.5)
        for path in (small_session.parent / "pictures").iterdir():
            (tmp_path / "pictures").mkdir(exist_ok=True)
            (tmp_path / "pictures" / path.name).write_bytes(path.read_bytes())
        part = tmp_path / "part"
        part.write_bytes(small_session.read_bytes())
        part.rename(new)

    writer = threading.Thread(target=write)
    writer.start()
    words = ["--library", small_session.parent / "survey.log", "--patience", "2", "-o", "none", "--json"]
    done = run(new, "--follow", *words)
    writer.join()
    assert done.exit_code == 0, done.stderr
    assert len(json.loads(done.stdout)["runs"]) == 1


def test_stopping_leaves_complete_files(inline: list[bytes], library: Path) -> None:
    with peer(slowly(inline + inline[1:] * 20, 0.02)) as address:
        words = [address, "--library", library, "--capture", "rec", "-o", "a.rrd", "--json"]
        process = subprocess.Popen(
            [*MAIN, *map(str, words)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        wait_until(lambda: any(Path().glob("a.*.part.rrd")), process)
        wait_until(pictures_come(20), process)
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 130, err
    assert "Traceback" not in err
    updates = json.loads(out)["runs"][0]["updates"]
    assert updates > 0
    assert steps_in(Path("a.rrd")) == set(range(1, updates + 1))
    assert not list(Path().glob("*.part.rrd"))
    log = Path("rec/session.log")
    assert log.read_bytes().endswith(b"\n")
    assert open_session(log).count_pictures() >= updates


def test_kill_9_leaves_a_log_that_can_be_read(inline: list[bytes], library: Path) -> None:
    with peer(slowly(inline + inline[1:] * 20, 0.02)) as address:
        process = subprocess.Popen([*MAIN, "record", address, "-o", "rec"], stderr=subprocess.DEVNULL)
        log = Path("rec/session.log")
        wait_until(lambda: log.exists() and log.stat().st_size > 40_000, process)
        process.kill()
        process.wait()
    assert open_session(log).count_pictures() > 3


def test_being_ended_while_trying_again_is_no_failure(refused: str) -> None:
    words = [*MAIN, "record", refused, "-o", "rec", "--patience", "60"]
    process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stderr is not None
    first = process.stderr.readline()
    process.terminate()
    out, err = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 143
    assert not out
    assert first == f"{refused}: Connection refused; trying again\n"
    assert err == "stopped before a header came; nothing was written\n"
    assert not Path("rec").exists()


def test_pictures_may_change_their_size(library: Path) -> None:
    said = [HEADER.encode() + b"\n"]
    for t, size in enumerate([(30, 40), (60, 80), (1, 1), (480, 640), (31, 17)]):
        data = base64.b64encode(encode_jpeg(np.full((*size, 3), 40 * t, np.uint8))).decode()
        said.append(line(t, image={"base64": data}))
    words = ["--library", library, "--start", "global", "--every-picture", "--patience", "0.3"]
    with peer(says(b"".join(said))) as address:
        done = run(address, *words, "-o", "a.rrd", "--json")
    assert done.exit_code == 0, done.stderr
    assert figures(done)["updates"] == 5
    assert steps_in(Path("a.rrd")) == {1, 2, 3, 4, 5}


def pictures_come(count: int) -> Callable[[], bool]:
    """Return whether so many more pictures were captured, so that the filter has made updates meanwhile."""
    log = Path("rec/session.log")
    before = log.read_bytes().count(b'"image"')
    return lambda: log.read_bytes().count(b'"image"') >= before + count


def wait_until(true: Any, process: subprocess.Popen[Any]) -> None:
    until = time.monotonic() + PATIENCE_S
    while not true():
        assert process.poll() is None
        assert time.monotonic() < until
        time.sleep(0.02)


def test_recording_tells_what_came_and_ends_by_itself(inline: list[bytes]) -> None:
    with peer(says(b"".join(inline)), says(b"".join(inline))) as address:
        done = run("record", address, "-o", "rec", "--json", "--patience", "0.5")
    assert done.exit_code == 0, done.stderr
    told = json.loads(done.stdout)
    # Twice all lines but the header, and the event that says that the source was away.
    counts = {"records": 2 * (len(inline) - 1), "pictures": 28, "scans": 0, "broken": 0, "gaps": 1}
    assert told == {"session": "rec/session.log"} | counts
    assert "was away for 0.5 s; ended" in done.stderr
    assert open_session(Path("rec/session.log")).count_pictures() == 28
    again = run("record", address, "-o", "rec")
    assert again.exit_code == 1
    assert "--force" in again.stderr


@pytest.fixture
def refused() -> str:
    return free_address()


def test_what_goes_wrong_is_one_line_and_status_1(refused: str, library: Path, inline: list[bytes]) -> None:
    done = run(refused, "--library", library, "--patience", "0.3", "-o", "none")
    assert done.exit_code == 1
    *notes, last = done.stderr.strip().splitlines()
    assert last.startswith(f"maurice-replay: {refused}: found no session log there")
    assert notes == [f"{refused}: Connection refused; trying again"]
    with peer(says(b"".join(inline[:1]))) as address:
        done = run(address, "--library", library, "--patience", "0.3")
    assert done.exit_code == 1
    last = done.stderr.strip().splitlines()[-1]
    assert last.endswith("ended before a picture came, so nothing was localized")
    assert done.exception is None or isinstance(done.exception, SystemExit)
    done = piped(b"nonsense\n", "-", "-o", "none")
    assert done.returncode == 1
    assert "found broken JSON" in done.stderr
    lines = [inline[0].strip(), b'{"t": 1e6, "image": "gone.jpg"}']
    done = piped(b"\n".join(lines) + b"\n", "-", "--library", str(library), "-o", "none")
    assert done.returncode == 1
    expect_facts(done.stderr, "1 lines or pictures", "left out", "standard input:2")
    assert "gone.jpg: found no such picture" in done.stderr


@pytest.mark.parametrize(
    "words", ["a.log --capture d", "a.log --keep-up", "- --save-run d", "tcp://x:1 --save-run d"]
)
def test_options_that_do_not_fit_are_usage_errors(words: str) -> None:
    Path("a.log").touch()
    assert run(*words.split()).exit_code == 2


def test_the_simulated_robot_is_followed() -> None:
    """The whole way, with the real simulator and a library made of its survey."""
    serve = ["simulate", "tracking", "--updates", "6", "--rate", "20", "--serve", "tcp://127.0.0.1:0"]
    pipe = subprocess.PIPE
    robot = subprocess.Popen([*MAIN, *serve], stdout=pipe, stderr=pipe, text=True)
    assert robot.stdout is not None
    address = robot.stdout.readline().strip()
    done = run("record", address, "-o", "rec", "--patience", "0.5", "--json")
    _, said = robot.communicate(timeout=PATIENCE_S)
    assert "lines left out for slow ones: 0" in said
    assert done.exit_code == 0, done.stderr
    assert json.loads(done.stdout)["pictures"] >= 3  # it joins late
    assert open_session(Path("rec/session.log")).info.survey == Path("survey/survey.log").resolve()
