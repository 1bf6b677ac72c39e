"""Pictures of the real viewer without a screen: `rerun --headless` on a software renderer.

Needs a Vulkan driver; Mesa's software one will do (`apt-get install mesa-vulkan-drivers libvulkan1`).
"""

from __future__ import annotations

import copy
import json
import subprocess
import time
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rerun.chunk import RrdReader
from rerun.experimental import ViewerClient

from maurice_loaders.errors import InputError
from maurice_loaders.files.writing import temporary_folder

from ..entities import PHASE, STEP
from .open_viewers import (
    VIEWPORT,
    Blueprint,
    LayoutError,
    Tied,
    address,
    free_port,
    start_viewer,
    with_layout,
)


def maximized(blueprint: Blueprint, views: Mapping[str, str], name: str) -> Blueprint:
    """Let one view fill the window: `views` are ids by title, `name` a title or the beginning of exactly one.

    Case does not matter. Raises LayoutError for anything else.
    """
    wanted_title = name.casefold()
    equal = [title for title in views if title.casefold() == wanted_title]
    matching = equal or [title for title in views if title.casefold().startswith(wanted_title)]
    if len(matching) != 1:
        titles = ", ".join(repr(title) for title in sorted(matching or views))
        count = f"found {len(matching) or 'no'} views that begin with {name!r}"
        raise LayoutError(f"{count}; {'these are' if matching else 'there are'} {titles}")
    changed = copy.deepcopy(blueprint)
    changed["/viewport"][VIEWPORT]["maximized"] = views[matching[0]]
    return changed


PATIENCE_S = 180.0  # for a recording to load, and again for a picture to settle: machines are busy
LOOK_EVERY_S = 0.2
CUT_OFF_ERROR = "exceeds file size"  # in the error about a file that ends inside of a frame
EQUAL_PICTURES = 3  # this many equal pictures in a row show that drawing is done
DRIVER_FOLDERS = (Path("/usr/share/vulkan/icd.d"), Path("/etc/vulkan/icd.d"))
ADVICE = "apt-get install mesa-vulkan-drivers libvulkan1"


class Viewer:
    """A running headless viewer with one recording open."""

    def __init__(self, client: Any, recording: Any, file: Path) -> None:
        """Drive a running viewer; errors name `file`."""
        self._client, self._recording, self._file = client, recording, file
        self._last = b""

    def picture(self, timeline: str, value: int, alike: int = EQUAL_PICTURES) -> bytes:
        """Return a PNG of the whole window at one value of the timeline "step" or "phase".

        It is taken once `alike` pictures in a row were equal, plus one if they equal the last one returned.
        """
        if timeline not in (STEP, PHASE):
            raise ValueError(f"pictures are taken on {STEP!r} or {PHASE!r}, found {timeline!r}")
        store = self._recording.store_id
        self._client.set_time(timeline, play_state="paused", recording=store, sequence=value)
        last, count, deadline = b"", 1, time.monotonic() + PATIENCE_S
        while count < alike + (last == self._last) and time.monotonic() < deadline:
            picture = bytes(self._client.take_screenshot())
            count = count + 1 if picture == last else 1
            last = picture
            time.sleep(LOOK_EVERY_S)
        self._last = last
        return last

    def span(self, timeline: str) -> tuple[int, int]:
        """Return the first and last value of a timeline. Raises InputError if the recording lacks it."""
        for known in self._recording.timelines:
            if known.name == timeline:
                return int(known.start), int(known.end)
        raise InputError(self._file, f"found no timeline {timeline!r}; was it made by maurice-replay?")

    def show_layout(self, name: str, run: str | None = None) -> None:
        """Bring the tab of a layout to the front, and in it that of a run.

        Raises InputError with the known names for any other.
        """
        self._arrange(with_layout, name, run)

    def show_only(self, name: str) -> None:
        """Let one view fill the window, by its title or its beginning.

        Raises InputError with the known titles where none or several match.
        """
        views = {str(view.name): str(view.view_id) for view in self._client.get_state().views}
        self._arrange(maximized, views, name)

    def _arrange(self, change: Callable[..., Blueprint], *how: Any) -> None:
        try:
            blueprint = change(self._client.get_blueprint().blueprint, *how)
        except LayoutError as problem:
            raise InputError(self._file, str(problem)) from None
        self._client.set_blueprint(blueprint, store_id=self._recording.store_id)


def recorded_steps(recording: Path, content: str = "/**") -> tuple[int, int] | None:
    """Return the first and last step of the entities `content`; None if there are none or it is damaged."""
    first: list[int] = []
    last: list[int] = []
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # that a killed recording lacks its end
            for chunk in RrdReader(recording).stream().filter(content=content, has_timeline=STEP):
                steps = chunk.to_record_batch().column(STEP).to_numpy(zero_copy_only=False)
                first.append(int(steps.min()))
                last.append(int(steps.max()))
    except (RuntimeError, ValueError, OSError):
        return None
    return (min(first), max(last)) if first else None


def expect_whole_frames(recording: Path) -> None:
    """Refuse what the viewer would wait for: no recording, or one that ends inside of a frame. InputError."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # that a killed recording lacks its end
            for _ in RrdReader(recording).stream():  # to its end: frames are read as they are asked for
                pass
    except (RuntimeError, ValueError, OSError) as problem:
        raise unreadable(recording, problem) from None


def unreadable(recording: Path, problem: Exception) -> InputError:
    """Return the error of a file that Rerun cannot read."""
    if CUT_OFF_ERROR not in str(problem):
        return InputError(recording, f"found no Rerun recording ({problem}); try: rerun rrd verify")
    repair = f"`rerun rrd optimize {recording.name} -o repaired.rrd` keeps what is whole"
    return InputError(recording, f"found a recording that was cut off; {repair}")


def software_driver() -> Path | None:
    """Find Mesa's software Vulkan driver, whose pictures are the same on every machine."""
    folders = [folder for folder in DRIVER_FOLDERS if folder.is_dir()]
    files = [file for folder in folders for file in sorted(folder.glob("lvp*.json"))]
    return files[0] if files else None


def expect_driver(target: Path) -> Path:
    """Find the software driver. Raises InputError that names the package to install."""
    driver = software_driver()
    if driver is None:
        raise InputError(target, f"found no software Vulkan driver to draw with; {ADVICE}")
    return driver


@contextmanager
def headless_viewer(
    recording: Path, size: tuple[int, int] = (1600, 1000), patience_s: float = PATIENCE_S
) -> Iterator[Viewer]:
    """Open a recording in a headless viewer, and close the viewer at the end.

    Raises InputError without a driver, when the viewer ends, or when nothing is loaded in time.
    """
    driver = expect_driver(recording)
    with temporary_folder("maurice-viewer") as home:
        port = free_port()
        viewer = Tied(_start(recording, size, driver, home, port))
        try:
            yield _connect(recording, viewer.process, address(port), patience_s)
        except ConnectionError as problem:  # it died, or it does not answer
            raise InputError(recording, f"the viewer failed: {str(problem).splitlines()[0]}") from problem
        finally:
            viewer.end()


def _start(
    recording: Path, size: tuple[int, int], driver: Path, home: Path, port: int
) -> subprocess.Popen[bytes]:
    settings = home / ".config" / "rerun"
    settings.mkdir(parents=True)
    (settings / "analytics.json").write_text(json.dumps({"analytics_enabled": False}))
    drawn_by = {"VK_ICD_FILENAMES": str(driver), "VK_DRIVER_FILES": str(driver)}
    place = dict.fromkeys(("HOME", "XDG_RUNTIME_DIR", "TMPDIR"), str(home))
    place["XDG_CONFIG_HOME"] = str(home / ".config")
    options = ["--headless", "--window-size", f"{size[0]}x{size[1]}", str(recording)]
    return start_viewer(port, options, drawn_by | place | {"RUST_LOG": "error"})


def _connect(recording: Path, process: subprocess.Popen[bytes], url: str, patience_s: float) -> Viewer:
    client, deadline = None, time.monotonic() + patience_s
    while time.monotonic() < deadline:
        if process.poll() is not None:
            raise InputError(recording, f"the viewer ended with status {process.returncode}")
        try:
            client = client or ViewerClient.connect(url)
            state = client.get_state()
        except (ConnectionError, OSError, RuntimeError):  # it is not listening yet
            client = None
        else:
            if state.recordings and not state.loading and state.recordings[0].timelines:
                return Viewer(client, state.recordings[0], recording)
        time.sleep(LOOK_EVERY_S)
    busy = "where the machine is busy, try again, or draw less with --detail light"
    raise InputError(recording, f"the viewer loaded no recording within {patience_s:.0f} s; {busy}")
