"""Viewers as processes: which of them end with us."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from rerun.experimental import ViewerClient

from helpers.commands import maurice
from maurice_viz.entities import Phase, Place
from maurice_viz.viewer import open_viewers, snapshot
from maurice_viz.viewer.snapshot import software_driver

KILLED = """
import os, pathlib, sys
from maurice_viz.viewer import open_viewers
open_viewers.viewer_binary = lambda: pathlib.Path(sys.argv[1])
viewer = open_viewers.start_viewer(1, [])
tied = open_viewers.Tied(viewer) if {tied} else None
print(viewer.pid, flush=True)
{ending}
"""


def is_running(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


ENDINGS = {
    "killed": "os.kill(os.getpid(), 9)",
    "crashed": "os.abort()",
    "left": "os._exit(3)",
    "failed": "raise SystemExit(1)",
    "ended it": "tied.end() if tied else None",
}


@pytest.mark.parametrize("ending", ENDINGS)
@pytest.mark.parametrize("tied", [True, False])
def test_a_tied_viewer_ends_with_us_however_we_end_and_a_window_stays(
    tied: bool, ending: str, tmp_path: Path
) -> None:
    fake = tmp_path / "viewer"
    fake.write_text("#!/bin/sh\nexec sleep 60\n")
    fake.chmod(0o755)
    words = [sys.executable, "-c", KILLED.format(tied=tied, ending=ENDINGS[ending]), str(fake)]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    viewer, until = int(done.stdout), time.monotonic() + 5
    while is_running(viewer) and time.monotonic() < until and tied:
        time.sleep(0.02)
    assert is_running(viewer) != tied
    if not tied:
        os.kill(viewer, signal.SIGKILL)


@pytest.mark.slow
@pytest.mark.skipif(software_driver() is None, reason="no software Vulkan driver to start a viewer with")
def test_a_viewer_is_moved_to_a_phase_and_a_tab(small_session, tmp_path, monkeypatch):
    maurice("compare", small_session, "--particles", "50", "-o", "a.rrd")
    port = open_viewers.free_port()
    monkeypatch.setattr(snapshot, "free_port", lambda: port)
    with snapshot.headless_viewer(tmp_path / "a.rrd"):
        assert open_viewers.look_at(port, Place(3, Phase.RESAMPLE), "inside-a-step", "blended")
        client = ViewerClient.connect(open_viewers.address(port))
        until = time.monotonic() + 20
        while (recording := client.get_state().recordings[0]).current_timeline != "phase":
            assert time.monotonic() < until
            time.sleep(0.1)
        assert "21" in str(recording.current_time)  # 6 * 3 + 3
        views = {view.name for view in client.get_state().views}
        assert "Before" in views
        with pytest.raises(open_viewers.LayoutError, match="it has color, blended"):
            open_viewers.look_at(port, Place(3), "inside-a-step", "none")
