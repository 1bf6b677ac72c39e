"""A request to stop waits for the end of an update, and no longer; other failures are one line."""

from __future__ import annotations

import errno
import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import pytest
import typer
from rerun.chunk import RrdReader

from helpers import expect_facts
from helpers.commands import run
from maurice_loaders.runs.manifest import read_manifest
from maurice_loaders.runs.writer import RunWriter
from maurice_viz.cli.shared.errors import errors_end_the_command
from maurice_viz.running.run import stops_between
from maurice_viz.viewer import sinks


def stop() -> None:
    signal.raise_signal(signal.SIGINT)


def updates(done: list[str], *, within: int = 0, between: int = 0) -> None:
    """Go through two updates; one is asked so often to stop within the first, and after it."""
    with stops_between() as stops:
        for number in (1, 2):
            with stops.wait():
                for _ in range(within):
                    stop()
                done.append(f"update {number}")
            for _ in range(between):
                stop()
            done.append(f"after {number}")


@pytest.mark.parametrize(
    ("within", "between", "expected"),
    [(1, 0, ["update 1"]), (0, 1, ["update 1"]), (2, 0, [])],
    ids=["waits for the end", "is heard at once between", "does not wait where it is the second"],
)
def test_a_request_to_stop(within, between, expected):
    done: list[str] = []
    with pytest.raises(KeyboardInterrupt):
        updates(done, within=within, between=between)
    assert done == expected


def test_nothing_stops_or_is_hidden_unasked():
    done: list[str] = []
    updates(done)
    assert done == ["update 1", "after 1", "update 2", "after 2"]

    def full() -> None:
        with stops_between() as stops, stops.wait():
            stop()
            raise OSError("full")

    with pytest.raises(OSError, match="full"):
        full()
    done = []

    def work() -> None:
        with stops_between() as stops, stops.wait():
            done.append(0)

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert done == [0]


def test_handlers_are_put_back_and_what_is_ignored_stays_ignored():
    terminate, interrupt = signal.getsignal(signal.SIGTERM), signal.getsignal(signal.SIGINT)
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    try:
        with stops_between() as stops, stops.wait():
            assert signal.getsignal(signal.SIGINT) is not interrupt
            signal.raise_signal(signal.SIGTERM)
        assert signal.getsignal(signal.SIGINT) is interrupt
        assert signal.getsignal(signal.SIGTERM) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGTERM, terminate)


def test_figures_recording_and_saved_run_go_equally_far(small_session, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    add = RunWriter.add

    def stop_within(self: RunWriter, moment: Any, record: Any) -> None:
        if moment.frame.step == 7:  # scored already, neither saved nor drawn
            stop()
        add(self, moment, record)

    monkeypatch.setattr(RunWriter, "add", stop_within)
    done = run(small_session, "--save-run", "kept", "-o", "a.rrd", "--json", expect=130)
    expect_facts(done.stderr, "stopped", "recording", "scores", "complete")
    assert json.loads(done.stdout)["runs"][0]["updates"] == 7
    assert read_manifest(Path("kept")).steps == 7
    estimates = RrdReader("a.rrd").stream().filter(content="/blended/belief/estimate", has_timeline="step")
    drawn = {step for chunk in estimates for step in chunk.to_record_batch().column("step").to_pylist()}
    assert drawn == set(range(1, 8))


@pytest.mark.parametrize("options", [["--json"], []])
def test_stopping_while_the_recording_is_written_out_leaves_the_figures(
    options, small_session, tmp_path, monkeypatch
):
    """A disk may be slow, and then somebody loses patience."""
    monkeypatch.chdir(tmp_path)

    def impatient(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(sinks, "_check_written", impatient)
    done = run(small_session, "-o", "a.rrd", "--particles", "50", *options, expect=130)
    if options:
        assert json.loads(done.stdout)["runs"][0]["updates"] == 14
    else:
        assert "heading error, mean" in done.stdout


FULL = "maurice-replay: a/b.log: No space left on device"


@pytest.mark.parametrize(
    ("number", "said"),
    [
        (
            errno.ENOSPC,
            "maurice-replay: a/b.log: No space left on device; free some space, or write to another disk",
        ),
        (errno.EACCES, "maurice-replay: a/b.log: Permission denied"),
    ],
)
def test_an_error_of_the_system_is_one_line(number, said, capsys):
    with pytest.raises(typer.Exit) as end, errors_end_the_command():
        raise OSError(number, os.strerror(number), "a/b.log")
    assert end.value.exit_code == 1
    assert capsys.readouterr().err == f"{said}\n"


LOST = """
import os, signal, time, maurice_viz.cli.app, maurice_viz.cli.main
class Lost:
    def __del__(self):
        os.kill(os.getpid(), signal.{name})
        time.sleep(0.2)
def app():
    Lost()
    time.sleep(60)
maurice_viz.cli.app.app = app
maurice_viz.cli.main.main()
"""


@pytest.mark.skipif(os.name == "nt", reason="signals are otherwise on Windows")
@pytest.mark.parametrize(("name", "status"), [("SIGTERM", 143), ("SIGINT", 130)])
def test_a_signal_that_comes_in_a_callback_is_not_overheard(name, status):
    began = time.monotonic()
    code = LOST.format(name=name)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (status, "maurice-replay: stopped\n")
    assert time.monotonic() - began < 50


IGNORED = """
import os, signal
signal.signal(signal.SIGINT, signal.SIG_IGN)  # as a shell does for a job in the background, and nohup
import maurice_viz.cli.app, maurice_viz.cli.main
from maurice_viz.running.run import stops_between
def app():
    with stops_between() as stops, stops.wait():
        os.kill(os.getpid(), signal.SIGINT)
    print("went on")
maurice_viz.cli.app.app = app
maurice_viz.cli.main.main()
"""


@pytest.mark.skipif(os.name == "nt", reason="signals are otherwise on Windows")
def test_a_job_in_the_background_keeps_ignoring_ctrl_c():
    done = subprocess.run([sys.executable, "-c", IGNORED], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "went on\n", "")


ENDING = """
import atexit, os, signal, maurice_viz.cli.app, maurice_viz.cli.main
from maurice_viz.cli.shared.errors import errors_end_the_command, stop_by_exception
def app():
    with errors_end_the_command():
        stop_by_exception()
    atexit.register(os.kill, os.getpid(), signal.{name})  # as while a recording is written out at the end
maurice_viz.cli.app.app = app
maurice_viz.cli.main.main()
"""


@pytest.mark.skipif(os.name == "nt", reason="signals are otherwise on Windows")
@pytest.mark.parametrize(("name", "status"), [("SIGTERM", 143), ("SIGINT", 130)])
def test_a_signal_that_comes_after_the_command_has_its_status(name, status):
    code = ENDING.format(name=name)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (status, "maurice-replay: stopped\n")


LEAVING = """
import atexit, gc, sys, maurice_viz.cli.app, maurice_viz.cli.main
class Large:
    def __del__(self):
        print("freed")
large = Large()
def app():
    atexit.register(print, "closed")
    print(*gc.get_threshold())
    sys.exit({status})
maurice_viz.cli.app.app = app
maurice_viz.cli.main.main()
"""


@pytest.mark.parametrize("status", [0, 130])
def test_at_the_end_all_is_written_and_nothing_freed_piece_by_piece(status):
    code = LEAVING.format(status=status)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (status, "200000 20 100\nclosed\n", "")
