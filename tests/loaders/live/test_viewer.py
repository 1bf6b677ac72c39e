"""Viewers of a drive that is going on: they go along with it, and `jump` finds them."""

from __future__ import annotations

import os
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import rerun.blueprint as rrb

from maurice_loaders.libraries.store import open_library
from maurice_loaders.session_log.reader import SessionLog
from maurice_viz.app.output import DriveScene, layout_of
from maurice_viz.scene import RunView
from maurice_viz.viewer import open_viewers
from maurice_viz.viewer import sinks as live_sink


@pytest.mark.parametrize(("live", "state"), [(True, "following"), (False, "paused")])
def test_the_time_goes_along_with_a_drive_that_is_going_on(
    live: bool, state: str, small_session: Path
) -> None:
    info = SessionLog(small_session).info
    assert info.survey is not None
    scene = DriveScene(info, open_library(info.survey, keep_going=False), has_truth=True, live=live)
    layout = layout_of([RunView("blended", ("color",), None)], scene)
    assert layout.time_panel.play_state == state


def test_the_viewer_of_a_live_session_is_one_that_jump_finds(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    started: list[tuple[int, list[str]]] = []

    def start(port: int, options: list[str]) -> Any:
        started.append((port, options))
        return SimpleNamespace(pid=os.getpid())

    monkeypatch.setenv(open_viewers.STATE, str(tmp_path))
    monkeypatch.setattr(open_viewers, "is_listening", lambda port: True)
    monkeypatch.setattr(live_sink, "start_viewer", start)
    monkeypatch.setattr(live_sink, "ends_within", lambda process, seconds: False)
    going = live_sink.to_file_and_viewers(
        tmp_path / "live.rrd", "a drive", rrb.Blueprint(), force=False, window=True, viewer="rerun"
    )
    with going as rec:
        (viewer,) = open_viewers.open_viewers()
        ((port, options),) = started
        assert (viewer.port, viewer.name) == (port, "a drive")
        assert viewer.recording == rec.get_recording_id()
        assert options[0] == "--connect"
        assert str(port) not in options[1]
