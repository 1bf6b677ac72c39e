"""The open viewers that were started here: one small file each in the user's state folder, for `jump`.

Each file is written whole, so that commands that run at once do not damage each other's. A file whose viewer
has ended is removed when the list is read. Only `jump` depends on these files: where they cannot be written,
it needs --port.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import platformdirs

from maurice_loaders.errors import InputError
from maurice_loaders.io.fields import read_json
from maurice_loaders.io.files import write_whole

from .spawn import is_listening

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
    """Read one file; None where it is gone or invalid."""
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
        return True
    return True
