"""What is said of sensors: that a picture is of another camera."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import maurice_viz as mv
from maurice_mcl.sensor.landmarks.camera import PinholeCamera
from maurice_mcl.sensor.landmarks.sensor import Landmarks
from maurice_mcl.values.session import Frame
from maurice_viz.running import run
from maurice_viz.text.sensors import say_other_shape

CAMERA = SimpleNamespace(fit=SimpleNamespace(camera=PinholeCamera(176, 144, 188.0)))


def frame(width: int, height: int) -> Frame:
    return Frame(1, 0.0, np.zeros((0, 3)), np.zeros((height, width, 3), np.uint8), "")


@pytest.mark.parametrize(("size", "told"), [((176, 144), False), ((352, 288), False), ((320, 180), True)])
def test_only_pictures_of_another_shape_are_told(size: tuple[int, int], told: bool) -> None:
    sensor: Any = Landmarks(CAMERA)  # type: ignore[arg-type]
    said = say_other_shape(frame(*size), [sensor])
    assert (said is not None) == told
    if said is not None:
        assert "pictures of 320 x 180" in said
        assert "of 176 x 144" in said
    assert say_other_shape(frame(*size), []) is None


def test_it_is_said_once_a_replay(small_session: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    said = list[str]()
    listener = SimpleNamespace(
        warning=said.append, remark=lambda text: None, progress=lambda done, total, what: None
    )
    monkeypatch.setattr(run, "say_other_shape", lambda frame, sensors: "of another shape")
    mv.replay(small_session, particles=50, listener=listener)
    assert said.count("of another shape") == 1
