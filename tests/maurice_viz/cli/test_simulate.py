"""The command itself, in processes of its own: what it prints, refuses, and how it ends."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import time

import pytest
from typer.testing import CliRunner

from helpers.commands import COMMAND, failure
from maurice_viz.cli.app import app

PATIENCE_S = 60


def command(*args: str) -> list[str]:
    return [*COMMAND, "simulate", *args]


def environment(**own: str) -> dict[str, str]:
    return os.environ | {"TERM": "dumb", "COLUMNS": "200"} | own


@pytest.mark.parametrize(
    ("args", "told"),
    [
        (["tracking"], "either -o DIR or --serve"),
        (["tracking", "-o", "a", "--serve", "tcp://127.0.0.1:0"], "either -o DIR or --serve"),
        (["flying", "-o", "a"], "expected one of tracking, global, kidnapped"),
        (["kidnaped", "-o", "a"], "did you mean kidnapped?"),
        (["tracking", "-o", "a", "--kidnap-at", "3"], "found a kidnapping in the task"),
        (["tracking", "-o", "a", "--lights", "blink@3"], "light change"),
        (["tracking", "-o", "a", "--slip-at", "soon"], "expected one like 34, or a range like 34-37"),
        (["tracking", "-o", "a", "--updates", "9", "--slip-at", "8-12"], "found a slip in movement 12"),
        (["tracking", "-o", "a", "--tier", "easy"], "expected one of nominal, dim, hard"),
        (["tracking", "-o", "a", "--rate", "2"], "go with --serve"),
        (["tracking", "--serve", "127.0.0.1:1"], "expected tcp://HOST:PORT"),
    ],
)
def test_wrong_options_are_usage_errors(args, told, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(app, ["simulate", *args], env={"TERM": "dumb", "COLUMNS": "200"})
    assert done.exit_code == 2
    assert told in " ".join(done.stderr.split())
    assert list(tmp_path.iterdir()) == []


def test_a_port_in_use_is_one_line():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        address = f"tcp://127.0.0.1:{taken.getsockname()[1]}"
        said = failure("simulate", "tracking", "--updates", "1", "--serve", address)
    assert said.startswith(f"maurice-replay: {address}: cannot listen there")


def test_ctrl_c_ends_the_live_robot_with_its_account():
    with subprocess.Popen(
        command("tracking", "--serve", "tcp://127.0.0.1:0"),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment(),
    ) as robot:
        address = robot.stdout.readline().strip()
        with socket.create_connection(("127.0.0.1", int(address.rsplit(":", 1)[1])), PATIENCE_S) as reader:
            header = json.loads(reader.makefile("rb").readline())
            robot.send_signal(signal.SIGINT)
            said = robot.communicate(timeout=PATIENCE_S)[1]
    assert header["format"] == "maurice-session-log"
    assert robot.returncode == 130
    assert "readers: 1, lines left out for slow ones: 0" in said
    assert "Traceback" not in said


def test_being_stopped_half_way_leaves_no_folder(tmp_path):
    out = tmp_path / "here"
    out.mkdir()
    with subprocess.Popen(
        command("tracking", "-o", str(out / "drive"), "--updates", "100000"),
        stderr=subprocess.PIPE,
        env=environment(MAURICE_CACHE=str(tmp_path / "cache")),
        text=True,
    ) as going:
        until = time.monotonic() + PATIENCE_S
        while not list(out.glob(".drive.*.part")) and time.monotonic() < until:
            time.sleep(0.02)
        going.send_signal(signal.SIGTERM)
        said = going.communicate(timeout=PATIENCE_S)[1]
    assert going.returncode == 143, said
    assert said.count("maurice-replay: stopped") == 1
    assert "Traceback" not in said
    assert list(out.iterdir()) == []
    assert not list((tmp_path / "cache").rglob("*.part"))
