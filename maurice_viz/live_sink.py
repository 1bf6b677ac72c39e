"""Where the drawing of a drive that is going on goes: a file, and whatever viewers come."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import rerun as rr
import rerun.blueprint as rrb

from . import sinks
from .console import note
from .open_viewers import remember, remember_recording
from .viewer import address, ends_within, free_port, start_viewer, viewer_binary


@contextmanager
def to_file_and_viewers(
    path: Path, name: str, blueprint: rrb.Blueprint, *, force: bool, window: bool, viewer: str
) -> Iterator[rr.RecordingStream]:
    """Open a recording that goes to a file and is served to viewers; neither waits for the other.

    With `window` a viewer is started; `viewer` is its command, for people. SinkError as from `sinks.to_file`.
    """
    port = free_port()
    with sinks.to_file(path, name, blueprint, force=force, serve=port) as rec:
        note(f"live; to look at it, also from another shell: {viewer} --connect {address(port)}")
        if window:
            _bring_up(port, name, rec.get_recording_id() or "")
        yield rec


def _bring_up(port: int, name: str, recording: str) -> None:
    """Start a viewer that follows, and that `jump` finds; where none comes up that is said, and no more."""
    own = free_port()
    try:
        process = start_viewer(own, ["--connect", address(port)])
    except OSError as problem:
        note(f"{viewer_binary()}: does not start ({problem.strerror}); going on without")
        return
    if ends_within(process, sinks.SETTLE_S):
        note(f"{viewer_binary()}: opened no window on this display; going on without")
        return
    remember(process.pid, own)
    remember_recording(own, name, recording)
