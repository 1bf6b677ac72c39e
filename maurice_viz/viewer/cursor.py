"""Moving the time cursor of an open viewer."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Any

from rerun.experimental import ViewerClient

from maurice_loaders.errors import InputError

from .open_viewers import open_viewers
from .spawn import address, is_listening

ANY = ""  # the recording in front


def move_viewer(folder: Path, session: str, port: int | None, timeline: str, value: int) -> None:
    """Move the viewer on a port, or the last opened one that shows this session, to a value of a timeline.

    Raises InputError where none is open, or its recording has no such timeline.
    """
    recording = ANY
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


def _ours(folder: Path, session: str) -> tuple[int, str]:
    """Return port and recording of the last opened viewer that shows a session of that name."""
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
    for known in state.recordings:
        if recording and recording in str(known.store_id):
            return known
    for known in state.recordings:
        if known.store_id == state.active_recording:
            return known
    return state.recordings[0] if state.recordings else None
