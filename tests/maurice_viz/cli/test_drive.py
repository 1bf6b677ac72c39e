"""The terminal of a robot that is driven by keys: a real one, at whose other end a test types."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from helpers.commands import COMMAND, no_display, run
from helpers.small_room import write_small_room
from maurice_viz.cli.drive import KEY, UNFINISHED, keys_of, new_name

if sys.platform == "win32":
    pytest.skip("needs a POSIX terminal", allow_module_level=True)
import pty
import select
import termios

PATIENCE_S = 120


class Typist:
    """Types at a terminal, and reads what is written there."""

    def __init__(self, folder: Path, *words: str) -> None:
        self.master, self.slave = pty.openpty()
        self.before = termios.tcgetattr(self.slave)
        ends = {"stdin": self.slave, "stdout": self.slave, "stderr": self.slave}
        env = no_display() | {"COLUMNS": "200", "TERM": "xterm"}
        args = [*COMMAND, "drive", "--world", str(folder / "closet.toml"), "--particles", "200", *words]
        self.process = subprocess.Popen(args, cwd=folder, env=env, start_new_session=True, **ends)

    def reads(self, words: str) -> str:
        """Wait for words; return all that was written since the last ones."""
        text, until = "", time.monotonic() + PATIENCE_S
        while words not in text:
            assert time.monotonic() < until, text
            assert self.process.poll() is None or select.select([self.master], [], [], 0)[0], text
            if select.select([self.master], [], [], 0.1)[0]:
                text += os.read(self.master, 65536).decode("utf-8", "replace")
        return text

    def types(self, keys: str, words: str) -> str:
        """Type keys, and wait for words."""
        os.write(self.master, keys.encode())
        return self.reads(words)

    def status(self) -> int:
        """Wait for the end; return the exit status. The terminal is as it was."""
        self.reads("--all prints")
        status = self.process.wait(PATIENCE_S)
        assert termios.tcgetattr(self.slave) == self.before
        return status


@contextmanager
def typist(folder: Path, *words: str) -> Iterator[Typist]:
    at = Typist(folder, *words)
    try:
        at.reads("?: help")
        yield at
    finally:
        at.process.kill()
        at.process.wait()
        os.close(at.master)
        os.close(at.slave)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with a small world."""
    return write_small_room(tmp_path).parent


def test_a_drive_is_typed_watched_and_saved(folder: Path) -> None:
    with typist(folder) as at:
        assert not termios.tcgetattr(at.slave)[3] & (termios.ICANON | termios.ECHO)
        at.types("\x1b[A", "step 2")
        at.types("\x1b", "")
        at.types("[B", "step 3")  # an arrow in two pieces
        at.types("ad", "step 5")
        at.types("k", "kidnapped")
        at.types("A", "on its own")
        at.reads("step 8")  # by itself
        at.types("p", "paused")
        at.types("p1", "thesis goes on")
        at.types("S", "saved: drive-1/session.log")
        os.write(at.master, b"q")
        assert at.status() == 0
    assert (folder / "drive-1" / "survey" / "survey.log").exists()
    assert (folder / "drive-1.rrd").exists()
    run(folder / "drive-1", "-o", "none", "--particles", "50")


def test_a_request_to_stop_restores_the_terminal(folder: Path) -> None:
    with typist(folder, "-o", "out.rrd") as at:
        at.types("w", "step 2")
        at.process.send_signal(signal.SIGTERM)
        assert at.status() == 143
    assert (folder / "out.rrd").exists()


@pytest.mark.parametrize("words", [[], ["--web"], ["--laser", "-o", "out.rrd"]])
def test_what_is_no_terminal_is_one_line(words: list[str], tmp_path: Path) -> None:
    done = subprocess.run(
        [*COMMAND, "drive", *words], cwd=tmp_path, stdin=subprocess.DEVNULL, capture_output=True, text=True
    )
    assert done.returncode == 1
    assert done.stderr.splitlines() == [done.stderr.strip()]
    assert "reads keys from a terminal, and found none" in done.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("typed", "keys"),
    [
        ("\x1b[A\x1bOB", ["up", "down"]),
        ("\x1b[1;5C\x1b[D", ["right", "left"]),
        ("wwwwad", ["w", "a", "d"]),  # held down
        ("\x1b[A\x1b[A\x1b[A", ["up"]),
        ("AA??", ["A", "A", "?", "?"]),
        ("\x1b[5~é ", ["é", " "]),
    ],
)
def test_keys_are_what_a_terminal_sends(typed: str, keys: list[str]) -> None:
    assert keys_of(typed) == keys


def test_an_arrow_that_is_cut_waits_for_its_rest() -> None:
    cut = {"w\x1b": "w", "\x1b[": "", "a\x1b[1;": "a", "\x1b[A": "\x1b[A"}
    assert {text: UNFINISHED.sub("", text) for text in cut} == cut
    assert KEY.fullmatch("\x1b[A")


def test_a_drive_has_a_name_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert new_name() == "drive-1"
    Path("drive-1").mkdir()
    Path("drive-2.rrd").touch()
    assert new_name() == "drive-3"
