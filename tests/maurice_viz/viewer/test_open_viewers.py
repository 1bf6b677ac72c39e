"""Viewers as processes: which of them end with us."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

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
