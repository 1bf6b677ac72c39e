"""A library with few places says so wherever it is used, and each channel is shown in its own unit."""

from __future__ import annotations

import json
from functools import partial

import numpy as np
import pytest

from helpers.commands import run
from maurice_loaders.session_log.writer import SessionWriter
from maurice_mcl.values.session import SessionInfo
from maurice_viz.text.library import WORSE

SPOTS, HEADINGS = ((0.2, 0.2), (0.6, 0.2), (1.0, 0.3)), 8
said = partial(run, env={"COLUMNS": "500"})


@pytest.fixture
def survey(tmp_path):
    path, rng = tmp_path / "survey.log", np.random.default_rng(0)
    with SessionWriter(path, SessionInfo("three spots"), "survey") as log:
        for spot, (x, y) in enumerate(SPOTS):
            for k in range(HEADINGS):
                level = 40 + 24 * ((k + 3 * spot) % HEADINGS)  # alike where the robot looks another way
                picture = np.clip(rng.normal(level, 12, (30, 40, 3)), 0, 255).astype(np.uint8)
                log.image(spot * 10.0 + k, picture, pose=np.array([x, y, k * 2 * np.pi / HEADINGS]))
    return path


def test_every_command_says_that_the_sensor_is_worse_than_nothing(survey):
    for command in (("library", "check"), ("inspect",)):
        assert WORSE in " ".join(said(*command, survey).stdout.split())
    assert WORSE in said("library", "tune", survey, "--channels", "color,edges").stderr
    found = json.loads(said("library", "check", survey, "--json").stdout)["places_told_apart"]
    assert (found["places"], found["worse_than_nothing"]) == (3, True)
    assert found["log_score"] < found["knowing_nothing"]
    assert found["widening"] > 1


def test_every_channel_is_shown_in_its_own_unit(survey):
    channels = json.loads(said("library", "show", survey, "--json").stdout)["channels"]
    units = {name: channels[name]["unit"] for name in ("color", "tiny", "hog")}
    assert list(units.values()) == ["256 x share", "relative brightness", "root of share"]
    shown = " ".join(said("library", "show", survey).stdout.split())
    assert "256 x share of pixels" not in shown
    assert "root of share)" in shown
