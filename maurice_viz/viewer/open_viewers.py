"""The viewer as a process: starting it, remembering which are open, moving the time cursor of one.

Viewers that were started here are remembered for `jump`, each in one small file of the user's state folder,
written whole. Where these cannot be written, `jump` needs --port. Servers listen on this machine alone.
"""

from __future__ import annotations

import json
import os
import shlex
import shutil
import socket
import subprocess
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import platformdirs
import rerun_cli  # type: ignore[import-untyped]  # has no types, comes with rerun-sdk
from rerun.experimental import ViewerClient

from maurice_loaders.errors import InputError
from maurice_loaders.files import read_json, write_whole

from ..entities import STEP

HOST = "127.0.0.1"
PROBE_EVERY_S = 0.1
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
    port: int,
    options: Sequence[str],
    environment: Mapping[str, str] | None = None,
    *,
    ends_with_us: bool = False,
) -> subprocess.Popen[bytes]:
    """Start a viewer in a session of its own, so that neither our end nor our Ctrl-C ends it. OSError.

    With `ends_with_us` Linux ends it when this process ends, even when that was killed.
    """
    tied = ["setpriv", "--pdeathsig", "TERM"] if ends_with_us and shutil.which("setpriv") else []
    command = [*tied, str(viewer_binary()), "--hide-welcome-screen"]
    command += ["--bind", HOST, "--port", str(port), *options]
    quiet = subprocess.DEVNULL
    return subprocess.Popen(
        command,
        stdin=quiet,
        stdout=quiet,
        stderr=quiet,
        env=os.environ | (environment or {}),
        start_new_session=True,
    )


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


STATE = "MAURICE_STATE"  # environment variable: in place of the user's state folder


@dataclass(frozen=True, slots=True)
class OpenViewer:
    """A viewer that was started here."""

    pid: int
    port: int  # of this machine
    opened_s: float  # Unix time
    name: str = ""  # of the recording shown last: the session's
    recording: str = ""  # its id


def state_folder() -> Path:
    """Return the folder of the files: the one that MAURICE_STATE names, else the user's."""
    named = os.environ.get(STATE)
    return (Path(named) if named else platformdirs.user_state_path("maurice-replay")) / "viewers"


def remember(pid: int, port: int) -> None:
    """Remember a viewer that has started."""
    _write(OpenViewer(pid, port, time.time()))


def remember_recording(port: int, name: str, recording: str) -> None:
    """Remember what a viewer shows, if it was started here."""
    known = _read(_file(port))
    if known is not None:
        _write(replace(known, name=name, recording=recording))


def open_viewers() -> list[OpenViewer]:
    """Return the viewers that still listen, the last opened first, and forget the others."""
    found = []
    with suppress(OSError):
        for file in state_folder().glob("*.json"):
            viewer = _read(file)
            if viewer is not None and _is_alive(viewer.pid) and is_listening(viewer.port):
                found.append(viewer)
            else:
                file.unlink(missing_ok=True)
    return sorted(found, key=lambda viewer: -viewer.opened_s)


def _file(port: int) -> Path:
    return state_folder() / f"{port}.json"


def _write(viewer: OpenViewer) -> None:
    file = _file(viewer.port)
    with suppress(OSError, InputError):  # no reason to fail a replay
        file.parent.mkdir(parents=True, exist_ok=True)
        write_whole(file, json.dumps(asdict(viewer), ensure_ascii=False).encode(), force=True)


def _read(file: Path) -> OpenViewer | None:
    with suppress(OSError, ValueError, TypeError):
        found: Mapping[str, Any] = read_json(file.read_bytes())
        viewer = OpenViewer(**found)
        numbers = (viewer.pid, viewer.port, viewer.opened_s)
        if all(isinstance(value, (int, float)) for value in numbers):
            return viewer
    return None


def _is_alive(pid: int) -> bool:
    """Return whether a process exists; True where that cannot be asked (Windows)."""
    if os.name == "nt":
        return True
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except (PermissionError, OverflowError):
        pass
    return True


def move_viewer(folder: Path, session: str, port: int | None, timeline: str, value: int) -> None:
    """Move the viewer on a port, or the last opened one that shows this session, to a value of a timeline.

    Raises InputError if none is open, or its recording has no such timeline.
    """
    recording = ""  # the one in front
    if port is None:
        port, recording = _ours(folder, session)
    elif not is_listening(port):
        raise InputError(
            folder, f"found no viewer on port {port}; open one with: rerun --port {port} FILE.rrd"
        )
    try:
        client = ViewerClient.connect(address(port))
        shown = _recording(client.get_state(), recording)
        if shown is None or timeline not in [known.name for known in shown.timelines]:
            found = f"the viewer on port {port} shows no recording with the timeline {timeline!r}"
            raise InputError(folder, f"{found}; {_how_to_open(folder)}")
        client.set_location(shown.location)
        client.set_time(timeline, sequence=value, play_state="paused", recording=shown.store_id)
    except (ConnectionError, OSError, RuntimeError, ValueError) as problem:
        raise InputError(folder, f"the viewer on port {port} does not answer ({problem})") from None


def look_at(port: int, step: int, patience_s: float = LOADS_S) -> bool:
    """Move the viewer on a port to a step once it shows one; return whether it could be moved in time."""
    deadline = time.monotonic() + patience_s
    while time.monotonic() < deadline:
        try:
            client = ViewerClient.connect(address(port))
            shown = _recording(client.get_state(), "")
            if shown is not None and any(known.name == STEP for known in shown.timelines):
                client.set_location(shown.location)
                client.set_time(STEP, sequence=step, play_state="paused", recording=shown.store_id)
                return True
        except (ConnectionError, OSError, RuntimeError, ValueError):
            pass  # still starting, or still loading
        time.sleep(PROBE_EVERY_S)
    return False


def _ours(folder: Path, session: str) -> tuple[int, str]:
    viewers = open_viewers()
    for viewer in viewers:
        if viewer.name == session:
            return viewer.port, viewer.recording
    shown = ", ".join(repr(viewer.name) for viewer in viewers)
    found = f"the open viewers show {shown}, not {session!r}" if viewers else "no viewer is open"
    raise InputError(folder, f"{found}; {_how_to_open(folder)}")


def _how_to_open(folder: Path) -> str:
    return f"open one with: maurice-replay {shlex.quote(str(folder))}, or name one's port with --port"


def _recording(state: Any, recording: str) -> Any | None:
    """Find a recording by its id, else the one in front; None where nothing is open."""
    known = list(state.recordings)
    found = [one for one in known if recording and recording in str(one.store_id)]
    found += [one for one in known if one.store_id == state.active_recording]
    return next(iter(found + known), None)
