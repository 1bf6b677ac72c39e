"""What goes wrong with files is one line that says what to do."""

import errno
import os
import subprocess
import sys
import time

import pytest
import typer

from maurice_viz.cli.errors import errors_end_the_command

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
def test_an_error_of_the_system_is_one_line(
    number: int, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
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
def test_a_signal_that_comes_in_a_callback_is_not_overheard(name: str, status: int) -> None:
    began = time.monotonic()
    code = LOST.format(name=name)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (status, "maurice-replay: stopped\n")
    assert time.monotonic() - began < 50


IGNORED = """
import os, signal
signal.signal(signal.SIGINT, signal.SIG_IGN)  # as a shell does for a job in the background, and nohup
import maurice_viz.cli.app, maurice_viz.cli.main
from maurice_viz.app.run import stops_between
def app():
    with stops_between() as stops, stops.wait():
        os.kill(os.getpid(), signal.SIGINT)
    print("went on")
maurice_viz.cli.app.app = app
maurice_viz.cli.main.main()
"""


@pytest.mark.skipif(os.name == "nt", reason="signals are otherwise on Windows")
def test_a_job_in_the_background_keeps_ignoring_ctrl_c() -> None:
    done = subprocess.run([sys.executable, "-c", IGNORED], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "went on\n", "")
