"""Pictures of the real viewer without a screen: `rerun --headless` on a software renderer.

Needs a Vulkan driver; Mesa's software one will do (`apt-get install mesa-vulkan-drivers libvulkan1`).
"""

from __future__ import annotations

import json
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rerun.experimental import ViewerClient

from maurice_loaders.errors import LogError

from .entities import PHASE, STEP
from .viewer import address, free_port, start_viewer

PATIENCE_S = 60.0  # for a recording to load, and again for a picture to settle
LOOK_EVERY_S = 0.2
ALIKE = 3  # so many equal pictures in a row say that nothing is still being drawn
DRIVERS = (Path("/usr/share/vulkan/icd.d"), Path("/etc/vulkan/icd.d"))


class Viewer:
    """A running headless viewer with one recording open."""

    def __init__(self, client: Any, recording: Any) -> None:
        self._client, self._recording = client, recording

    def picture(self, timeline: str, value: int) -> bytes:
        """Give a PNG of the whole window at one place of the timeline "step" or "phase"."""
        if timeline not in (STEP, PHASE):
            raise ValueError(f"pictures are taken on {STEP!r} or {PHASE!r}, found {timeline!r}")
        store = self._recording.store_id
        self._client.set_time(timeline, play_state="paused", recording=store, sequence=value)
        last, alike, deadline = b"", 1, time.monotonic() + PATIENCE_S
        while alike < ALIKE and time.monotonic() < deadline:
            taken = bytes(self._client.take_screenshot())
            alike = alike + 1 if taken == last else 1
            last = taken
            time.sleep(LOOK_EVERY_S)
        return last


def software_driver() -> Path | None:
    """Find Mesa's software Vulkan driver, on which pictures are the same everywhere."""
    found = [file for folder in DRIVERS if folder.is_dir() for file in sorted(folder.glob("lvp*.json"))]
    return found[0] if found else None


@contextmanager
def headless_viewer(
    recording: Path, size: tuple[int, int] = (1600, 1000), patience_s: float = PATIENCE_S
) -> Iterator[Viewer]:
    """Open a recording in a headless viewer, and close the viewer at the end.

    LogError when there is no driver, when the viewer dies, or when nothing is loaded in time.
    """
    driver = software_driver()
    if driver is None:
        advice = "apt-get install mesa-vulkan-drivers libvulkan1"
        raise LogError(recording, f"found no software Vulkan driver to draw with; {advice}")
    with tempfile.TemporaryDirectory(prefix="maurice-viewer-") as home:
        port = free_port()
        process = _start(recording, size, driver, Path(home), port)
        try:
            yield _connect(recording, process, address(port), patience_s)
        finally:
            process.terminate()
            try:
                process.wait(5)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def _start(
    recording: Path, size: tuple[int, int], driver: Path, home: Path, port: int
) -> subprocess.Popen[bytes]:
    settings = home / ".config" / "rerun"
    settings.mkdir(parents=True)
    (settings / "analytics.json").write_text(json.dumps({"analytics_enabled": False}))
    drawn_by = {"VK_ICD_FILENAMES": str(driver), "VK_DRIVER_FILES": str(driver)}
    place = {"HOME": str(home), "XDG_RUNTIME_DIR": str(home), "XDG_CONFIG_HOME": str(home / ".config")}
    options = ["--headless", "--window-size", f"{size[0]}x{size[1]}", str(recording)]
    return start_viewer(port, options, drawn_by | place | {"RUST_LOG": "error"})


def _connect(recording: Path, process: subprocess.Popen[bytes], url: str, patience_s: float) -> Viewer:
    client, deadline = None, time.monotonic() + patience_s
    while time.monotonic() < deadline:
        if process.poll() is not None:
            raise LogError(recording, f"the viewer ended with status {process.returncode}")
        try:
            client = client or ViewerClient.connect(url)
            state = client.get_state()
        except (ConnectionError, OSError, RuntimeError):  # it is not listening yet
            client = None
        else:
            if state.recordings and not state.loading and state.recordings[0].timelines:
                return Viewer(client, state.recordings[0])
        time.sleep(LOOK_EVERY_S)
    raise LogError(recording, f"the viewer loaded no recording within {patience_s:.0f} s")
