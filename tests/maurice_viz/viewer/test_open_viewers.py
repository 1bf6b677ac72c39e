"""Which viewers are open: ours, alive, the last one first; nothing ever fails because of these files."""

from __future__ import annotations

import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from maurice_viz.viewer import open_viewers
from maurice_viz.viewer.open_viewers import HOST, remember, remember_recording, state_folder

Listen = Callable[[], int]


@pytest.fixture(autouse=True)
def state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv(open_viewers.STATE, str(tmp_path / "state"))
    return tmp_path / "state"


@pytest.fixture
def listen() -> Iterator[Listen]:
    """Open a port, as a viewer does."""
    listeners: list[socket.socket] = []

    def opened() -> int:
        listeners.append(socket.create_server((HOST, 0)))
        return int(listeners[-1].getsockname()[1])

    yield opened
    for one in listeners:
        one.close()


def ports() -> list[int]:
    return [viewer.port for viewer in open_viewers.open_viewers()]


def test_strange_states_are_no_error(state):
    assert ports() == []
    assert not state.exists()
    state.write_text("a file stands in its place")
    remember(os.getpid(), 1)
    assert ports() == []


def test_open_viewers_are_listed_with_what_they_show(listen):
    first, second = listen(), listen()
    remember(os.getpid(), first)
    remember(os.getpid(), second)
    assert ports() == [second, first]
    remember_recording(second, "kleine Fahrt \u96e8", "an id")
    viewer, _ = open_viewers.open_viewers()
    assert (viewer.pid, viewer.name, viewer.recording) == (os.getpid(), "kleine Fahrt \u96e8", "an id")
    held = json.loads((state_folder() / f"{second}.json").read_text())
    assert set(held) == {"pid", "port", "opened_s", "name", "recording"}


def test_one_that_listens_no_longer_is_forgotten(state, listen):
    with socket.create_server((HOST, 0)) as gone:
        port = int(gone.getsockname()[1])
        remember(os.getpid(), port)
        assert ports() == [port]
    assert ports() == []
    assert list((state / "viewers").iterdir()) == []
    remember_recording(listen(), "a session", "an id")
    assert ports() == []


@pytest.mark.skipif(os.name == "nt", reason="whether a process is there cannot be asked on Windows")
def test_one_whose_process_ended_is_forgotten_though_another_has_its_port(listen):
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    remember(ended.pid, listen())
    assert ports() == []


@pytest.mark.parametrize(
    "content", [b"", b"\xff", b"[]", b"{}", b'{"pid": "a", "port": "b", "opened_s": null}', b'{"port": 1}']
)
def test_a_broken_file_is_forgotten(content, listen):
    port = listen()
    remember(os.getpid(), port)
    (state_folder() / "1.json").write_bytes(content)
    assert ports() == [port]
    assert [file.name for file in state_folder().iterdir()] == [f"{port}.json"]


def test_without_the_variable_it_is_the_users_own_folder(monkeypatch):
    monkeypatch.delenv(open_viewers.STATE)
    assert state_folder().name == "viewers"
    assert "maurice-replay" in str(state_folder())


KILLED = """
import os, pathlib, sys
from maurice_viz.viewer import open_viewers
open_viewers.viewer_binary = lambda: pathlib.Path(sys.argv[1])
print(open_viewers.start_viewer(1, [], ends_with_us={tied}).pid, flush=True)
os.kill(os.getpid(), 9)
"""


def is_running(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


@pytest.mark.skipif(shutil.which("setpriv") is None, reason="needs setpriv, of Linux")
@pytest.mark.parametrize("tied", [True, False])
def test_a_viewer_that_only_draws_for_us_ends_when_we_are_killed_and_a_window_stays(
    tied: bool, tmp_path: Path
) -> None:
    fake = tmp_path / "viewer"
    fake.write_text("#!/bin/sh\nexec sleep 60\n")
    fake.chmod(0o755)
    words = [sys.executable, "-c", KILLED.format(tied=tied), str(fake)]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    viewer, until = int(done.stdout), time.monotonic() + 5
    while is_running(viewer) and time.monotonic() < until and tied:
        time.sleep(0.02)
    assert is_running(viewer) != tied
    if not tied:
        os.kill(viewer, signal.SIGKILL)
