"""Where a recording goes: a file, a viewer, or a file and every viewer that connects.

A file is written beside its final name as `<stem>.<process>.part.rrd` and renamed when it is whole; after a
failure the part stays, and the viewer opens it.
"""

from __future__ import annotations

import errno
import os
import shutil
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import rerun as rr
import rerun.blueprint as rrb

from maurice_loaders.errors import TakenError
from maurice_loaders.files.writing import MAKE_ROOM, appear, remove_leftovers

from ..errors import SinkError
from .blocks import BlockRecording
from .open_viewers import (
    HOST,
    SETTLE_S,
    address,
    ends_within,
    free_port,
    start_viewer,
    viewer_binary,
)

if TYPE_CHECKING:
    from .web import WebViewer

APPLICATION = "maurice-replay"
FLUSH_S = 60.0
GIVE_UP_S = 5.0  # for closing what could not be written
CANNOT_WRITE = (RuntimeError, OSError, ValueError)  # what flushing raises
ELSEWHERE_ADVICE = "use -o FILE.rrd, and open it where there is a screen"
SERVED_MEMORY = "25MB"  # of a live recording, kept for viewers that come late; takes some 100 MB of memory
LEAST_FREE_BYTES = 1 << 20  # bytes: a disk with less than that is called full
PROBE_BYTES = 1 << 22  # bytes that are written to try the disk: more than a blueprint of four runs


Remark = Callable[[str], None]  # receives a line for people


def recording(name: str, recording_id: str | None = None) -> rr.RecordingStream:
    """Open a recording that goes nowhere yet; `name`, in any script, is what the viewer shows as its name."""
    return _named(rr.RecordingStream(APPLICATION, recording_id=recording_id), name)


def _named(rec: rr.RecordingStream, name: str) -> rr.RecordingStream:
    rec.set_log_time_enabled(False)  # the wall clock of drawing says nothing about the drive
    rec.set_log_tick_enabled(False)
    rec.send_recording_name(name)
    return rec


def part_of(path: Path) -> Path:
    """Return the name of a recording while it is being written; no other process writes it."""
    return path.with_name(f"{path.stem}.{os.getpid()}.part.rrd")


@contextmanager
def to_file(
    path: Path,
    name: str,
    blueprint: rrb.Blueprint,
    *,
    force: bool = False,
    serve: int | None = None,
    remark: Remark = lambda text: None,
) -> Iterator[rr.RecordingStream]:
    """Open a recording that is written to a file, whole or not at all under that name.

    With `serve`, viewers can also follow it at that port of this machine, whenever they come; none of them,
    slow or frozen, is ever waited for.

    Raises SinkError when the file exists and `force` is not set, when its folder cannot be written to, or
    when the disk ran full. After any other exception the part is closed, stays, and can be opened.
    """
    _check_target(path, force)
    part = part_of(path)
    rec = _named(BlockRecording(APPLICATION, patience_s=FLUSH_S), name) if serve is None else recording(name)
    try:
        if serve is None:
            rec.save(part, default_blueprint=blueprint)
        else:
            server = rr.GrpcServerSink(bind_ip=HOST, port=serve, server_memory_limit=SERVED_MEMORY)
            # A footer lists every chunk, and is held in memory until the end, which may never come.
            rec.set_sinks(rr.FileSink(part, write_footer=False), server, default_blueprint=blueprint)
    except CANNOT_WRITE as error:
        part.unlink(missing_ok=True)
        raise SinkError(path, f"cannot be written ({error}); choose another folder") from error
    try:
        yield rec
    except TakenError:  # of what else is written: nothing is drawn yet, or another process has drawn it
        _close(rec)
        part.unlink(missing_ok=True)
        raise
    except BaseException:
        _close(rec)
        remark(f"{part} holds the recording up to that point")
        raise
    _check_written(part, path, _close(rec))
    try:
        appear(part, path, force=force)
    except TakenError as problem:
        part.unlink(missing_ok=True)
        raise SinkError(path, problem.message) from None


@contextmanager
def to_viewer(port: int, name: str, blueprint: rrb.Blueprint) -> Iterator[rr.RecordingStream]:
    """Open a recording that is shown by the viewer on that port of this machine.

    Raises SinkError at the end when the viewer was closed before it had everything.
    """
    rec = recording(name)
    rec.connect_grpc(address(port), default_blueprint=blueprint)
    try:
        yield rec
    finally:
        flushed = _close(rec)
    if not flushed:
        raise SinkError(viewer_binary(), f"was closed before everything was shown; {ELSEWHERE_ADVICE}")


def _check_target(path: Path, force: bool) -> None:
    if path.suffix != ".rrd":
        raise SinkError(path, f"a recording's name ends in .rrd; use {path.name}.rrd")
    if path.is_dir():
        raise SinkError(path, "is a folder, not a file; choose another name")
    if path.exists() and not force:
        raise SinkError(path, "exists already; use --force to replace it or -o to choose another name")
    remove_leftovers(path)
    part = part_of(path)
    try:
        part.write_bytes(bytes(PROBE_BYTES))  # on a full disk opening the recording would never end
    except OSError as error:
        part.unlink(missing_ok=True)
        raise SinkError(path, f"cannot be written ({error.strerror}); choose another folder") from error


# Recordings that could not be closed. Rerun flushes those that nobody refers to, under a lock that every new
# recording needs: with a dead writer that never ends.
_GIVEN_UP: list[rr.RecordingStream] = []


def _close(rec: rr.RecordingStream) -> bool:
    """Write what is left and close the recording; False if not all could be written."""
    flushed = False
    try:
        rec.flush(timeout_sec=FLUSH_S)
        flushed = True
    except CANNOT_WRITE:
        pass
    finally:
        closed = _disconnect(rec, FLUSH_S if flushed else GIVE_UP_S)
    if not (flushed and closed):
        _GIVEN_UP.append(rec)
    return flushed and closed


def _disconnect(rec: rr.RecordingStream, patience_s: float) -> bool:
    """Close a recording; False if that takes too long, as after the disk ran full: its writer may be dead."""
    closing = threading.Thread(target=rec.disconnect, daemon=True)
    closing.start()
    closing.join(patience_s)
    if closing.is_alive():
        rr.unregister_shutdown()  # at the end of the process, which would wait as well
    return not closing.is_alive()


def _check_written(part: Path, path: Path, flushed: bool) -> None:
    if not part.exists():
        raise SinkError(path, f"{part.name}, in which it was being written, vanished")
    begin = f"{part.name} holds its beginning"
    if shutil.disk_usage(part.parent).free < LEAST_FREE_BYTES:
        raise SinkError(path, f"cannot be written: {os.strerror(errno.ENOSPC)}; {MAKE_ROOM}; {begin}")
    if not flushed:
        raise SinkError(path, f"cannot be written to the end; is the disk full or gone? {begin}")


@contextmanager
def to_file_and_viewers(
    path: Path,
    name: str,
    blueprint: rrb.Blueprint,
    *,
    force: bool,
    window: bool,
    viewer: str,
    web: WebViewer | None = None,
    remark: Remark = lambda text: None,
) -> Iterator[rr.RecordingStream]:
    """Open a recording that goes to a file and is served to viewers; neither waits for the other.

    With `window` a viewer is started, with `web` a page; `viewer` is the viewer's command, for people.
    SinkError as from `to_file`.
    """
    port = free_port() if web is None else web.reserve()
    with to_file(path, name, blueprint, force=force, serve=port, remark=remark) as rec:
        remark(f"live; to look at it, also from another shell: {viewer} --connect {address(port)}")
        if web is not None:
            web.serve()
            web.remark(remark)
        elif window:
            _bring_up(port, remark)
        yield rec


def _bring_up(port: int, remark: Remark) -> None:
    """Start a viewer that follows; where none opens, only remark it."""
    own = free_port()
    try:
        process = start_viewer(own, ["--connect", address(port)])
    except OSError as problem:
        remark(f"{viewer_binary()}: does not start ({problem.strerror}); going on without")
        return
    if ends_within(process, SETTLE_S):
        remark(f"{viewer_binary()}: opened no window on this display; going on without")
        return
