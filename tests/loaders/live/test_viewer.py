"""Viewers of a drive that is going on: they go along with it."""

from __future__ import annotations

from pathlib import Path

import pytest

from maurice_loaders.formats.registry import open_session
from maurice_loaders.libraries.store import open_library
from maurice_viz.running.output import layout_of
from maurice_viz.scene import RunView, Scene


@pytest.mark.parametrize(("live", "state"), [(True, "following"), (False, "paused")])
def test_the_time_goes_along_with_a_drive_that_is_going_on(
    live: bool, state: str, small_session: Path
) -> None:
    info = open_session(small_session).info
    assert info.survey is not None
    scene = Scene(info, open_library(info.survey, keep_going=False), has_truth=True, live=live)
    layout = layout_of([RunView("blended", ("color",), None)], scene)
    assert layout.time_panel.play_state == state
