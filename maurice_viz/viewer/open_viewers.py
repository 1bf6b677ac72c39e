"""The viewer as a process: starting it, moving its time cursor, choosing its tab.

Servers listen on this machine alone.
"""

from __future__ import annotations

import copy
import os
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import rerun_cli  # type: ignore[import-untyped]  # has no types, comes with rerun-sdk

from ..entities import Place
from ..errors import SinkError

HOST = "127.0.0.1"
PROBE_EVERY_S = 0.1
PATIENCE_S = 20.0  # for a viewer to come up
SETTLE_S = 0.7  # a viewer that finds no display listens for a moment before it ends
LOADS_S = 10.0  # for a viewer to show what it was given


def viewer_binary() -> Path:
    """Find the viewer that belongs to our own SDK, whatever the PATH; the `rerun` script only wraps it."""
    folder = Path(rerun_cli.__file__).parent
    return folder / ("rerun.exe" if os.name == "nt" else "rerun")


def free_port() -> int:
    """Find a port of our own: on Rerun's usual one an older viewer may be listening."""
    with socket.socket() as listener:
        listener.bind((HOST, 0))
        return int(listener.getsockname()[1])


def address(port: int) -> str:
    """Return the address that recordings are sent to."""
    return f"rerun+http://{HOST}:{port}/proxy"


def start_viewer(
    port: int, options: Sequence[str], environment: Mapping[str, str] | None = None
) -> subprocess.Popen[bytes]:
    """Start a viewer in a session of its own, so that neither our end nor our Ctrl-C ends it. OSError."""
    command = [str(viewer_binary()), "--hide-welcome-screen", "--bind", HOST, "--port", str(port), *options]
    quiet = subprocess.DEVNULL
    return subprocess.Popen(
        command,
        stdin=quiet,
        stdout=quiet,
        stderr=quiet,
        env=os.environ | (environment or {}),
        start_new_session=True,
    )


class Window:
    """A viewer on this display, which comes up while we go on, and stays open afterwards."""

    def __init__(self, options: Sequence[str] = ("--expect-data-soon",)) -> None:
        """Start it. Raises SinkError when that cannot be."""
        self._port, self._is_open = free_port(), False
        self.is_shown = False  # whether somebody draws to it
        try:
            self._process = start_viewer(self._port, options)
        except OSError as error:
            raise SinkError(viewer_binary(), f"does not start ({error.strerror})") from error
        self._waiting = threading.Thread(target=self._wait, daemon=True)
        self._waiting.start()

    def port(self) -> int:
        """Return the port it listens on, once it does.

        Raises SinkError when it does not come up, or ends again at once (the display may be dead).
        """
        self._waiting.join()
        if not self._is_open:
            raise SinkError(viewer_binary(), "opened no window on this display")
        self.is_shown = True
        return self._port

    def close(self) -> None:
        """Close it: there is nothing to show."""
        self._process.terminate()

    def _wait(self) -> None:
        came_up = wait_until_listening(self._process, self._port, PATIENCE_S)
        self._is_open = came_up and not ends_within(self._process, SETTLE_S)


def has_display() -> bool:
    """Return whether there is a screen to open a window on."""
    screen = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    return sys.platform in ("win32", "darwin") or bool(screen)


ENDS_S = 5.0  # for a viewer to end
# Ends the process whose number it is given when its input ends, which it does when we end, even when killed.
WATCH = "import os, sys; sys.stdin.buffer.read(1) or os.kill(int(sys.argv[1]), 15)"


class Tied:
    """A process that ends with this one, however this one ends: another small process watches."""

    def __init__(self, process: subprocess.Popen[bytes]) -> None:
        self.process = process
        self._watcher = subprocess.Popen(
            [sys.executable, "-I", "-S", "-c", WATCH, str(process.pid)],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,  # so that no Ctrl-C ends it before us
        )

    def end(self) -> None:
        """End the process, by force if it does not within some seconds."""
        self.process.terminate()
        try:
            self.process.wait(ENDS_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        with suppress(OSError):  # it was ended by somebody
            self._watcher.communicate(b"-")


def is_listening(port: int) -> bool:
    """Return whether a viewer listens; takes no time where none does."""
    with socket.socket() as probe:
        probe.settimeout(PROBE_EVERY_S)
        return probe.connect_ex((HOST, port)) == 0


def wait_until_listening(viewer: subprocess.Popen[bytes], port: int, patience_s: float) -> bool:
    """Wait for a viewer to come up; False when it ended, or did not listen in time."""
    deadline = time.monotonic() + patience_s
    while time.monotonic() < deadline and viewer.poll() is None:
        if is_listening(port):
            return True
        time.sleep(PROBE_EVERY_S)
    return False


def ends_within(viewer: subprocess.Popen[bytes], seconds: float) -> bool:
    """Wait a moment and return whether the viewer ended."""
    try:
        viewer.wait(seconds)
    except subprocess.TimeoutExpired:
        return False
    return True


CONTAINER, VIEWPORT = "ContainerBlueprint", "ViewportBlueprint"

Blueprint = dict[str, Any]


class LayoutError(ValueError):
    """No layout or view of that name, or several; the message lists the known ones."""


def with_layout(blueprint: Blueprint, name: str, run: str | None = None) -> Blueprint:
    """Bring the tab of that name to the front, and in it that of a run.

    Raises LayoutError where the recording lacks it.
    """
    changed = copy.deepcopy(blueprint)
    containers = {
        path: fields[CONTAINER] for path, fields in changed.items() if path.startswith("/container/")
    }
    root = containers.get(f"/container/{changed['/viewport'][VIEWPORT].get('root_container')}", {})
    tabs = _tabs_under(root, containers)
    if name not in tabs:
        raise LayoutError(f"found no layout {name!r}; it has {', '.join(tabs) or 'none by name'}")
    holder, member = tabs[name]
    holder["active_tab"] = member
    if run is not None:
        of_runs = _tabs_under(containers.get("/" + member.removeprefix("/"), {}), containers)
        if run not in of_runs:
            runs = ", ".join(of_runs) or "all runs in one"
            raise LayoutError(f"found no tab of the run {run!r} in the layout {name}; it has {runs}")
        holder, member = of_runs[run]
        holder["active_tab"] = member
    return changed


def _tabs_under(holder: dict[str, Any], containers: Mapping[str, Any]) -> dict[str, tuple[Any, str]]:
    """Return each named tab with its container; an unnamed tab is searched."""
    tabs: dict[str, tuple[Any, str]] = {}
    contents = holder.get("contents", [])
    for member in [contents] if isinstance(contents, str) else contents:
        inner = containers.get("/" + member.removeprefix("/"), {})  # the viewer writes it either way
        if inner.get("display_name"):
            tabs[inner["display_name"]] = (holder, member)
        elif inner.get("container_kind") == "Tabs":
            tabs |= _tabs_under(inner, containers)
    return tabs


def look_at(
    port: int, place: Place, layout: str | None = None, run: str | None = None, patience_s: float = LOADS_S
) -> bool:
    """Move the viewer on a port to a place once it shows one; return whether it could be moved in time.

    LayoutError if it shows no tab of the name `layout`, or none of `run` in it.
    """
    from rerun.experimental import ViewerClient  # takes as long as a viewer to come up

    deadline = time.monotonic() + patience_s
    while time.monotonic() < deadline:
        try:
            client = ViewerClient.connect(address(port))
            state = client.get_state()
            recordings = list(state.recordings)
            active = [item for item in recordings if item.store_id == state.active_recording]
            recording = next(iter(active + recordings), None)
            if recording is not None and any(item.name == place.timeline for item in recording.timelines):
                client.set_location(recording.location)
                if layout is not None:
                    blueprint = with_layout(client.get_blueprint().blueprint, layout, run)
                    client.set_blueprint(blueprint, store_id=recording.store_id)
                store = recording.store_id
                client.set_time(place.timeline, sequence=place.number, play_state="paused", recording=store)
                return True
        except LayoutError:
            raise
        except (ConnectionError, OSError, RuntimeError, ValueError):
            pass  # still starting, or still loading
        time.sleep(PROBE_EVERY_S)
    return False
