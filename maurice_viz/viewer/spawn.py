"""Starting the real viewer. Its server listens on this machine alone (Rerun's own default is everywhere)."""

from __future__ import annotations

import os
import socket
import subprocess
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

import rerun_cli  # type: ignore[import-untyped]  # has no types, comes with rerun-sdk

HOST = "127.0.0.1"
PROBE_EVERY_S = 0.1


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
