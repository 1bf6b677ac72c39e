"""`library tune` as a person runs it, on the small session and survey."""

from __future__ import annotations

import json
import shutil
from functools import partial

import pytest

from helpers.commands import run
from maurice_loaders.config_files import configuration_of

_tune = partial(run, "library", "tune")


@pytest.fixture
def survey(small_session):
    return small_session.parent / "survey.log"


def test_what_it_writes_is_a_configuration_file(small_session, survey, tmp_path):
    out = tmp_path / "tuned.toml"
    args = [survey, small_session, "--channels", "color,tiny"]
    done = _tune(*args, "-o", out, "--json")
    found = json.loads(done.stdout)
    sensor = configuration_of(None, out, {}, {}).parameters.sensor
    assert dict(sensor.weights) == found["weights"]
    assert dict(sensor.scales) == {name: found["scales"][name] for name in found["weights"]}
    assert (sensor.blend, sensor.likelihood) == ("calibrated", "exponential")
    assert found["fitted"]["pictures"] == 14
    assert found["fitted"]["tuned"] >= max(found["fitted"]["alone"].values()) - 1e-6
    assert found["fitted"]["gained"] == pytest.approx(found["fitted"]["tuned"] - found["fitted"]["default"])
    assert found["scored"] is None
    assert "which flatters" in done.stderr
    assert "exists already" in _tune(*args, "-o", out, expect=1).stderr
    _tune(*args, "-o", out, "--force")


def test_fitted_without_a_session_or_channel(small_session, survey):
    found = json.loads(_tune(survey, small_session, "--channels", "hog", "--json").stdout)
    alone = json.loads(_tune(survey, small_session, "--json").stdout)
    assert found["fitted"]["default"] == pytest.approx(alone["fitted"]["default"])
    assert list(found["weights"]) == ["hog"]
    done = _tune(survey, "--channels", "color,edges")
    assert "its own references, each left out in turn" in done.stdout
    assert "[sensor]\nweights = {" in done.stdout
    assert "on the library itself" not in done.stdout
    assert "scored on the library itself" in done.stderr


def test_a_session_scored_on_may_not_be_fitted_on_under_any_name(small_session, survey, tmp_path):
    copy = tmp_path / "other-name.log"
    shutil.copy(small_session, copy)
    for scored in (small_session, copy):
        done = _tune(survey, small_session, "--drive", scored, expect=1)
        assert done.stderr.startswith(f"maurice-replay: {scored}: is ")
        assert len(done.stderr.splitlines()) == 1


def test_scored_sessions_are_pooled(small_session, survey, tmp_path):
    lines = small_session.read_text().splitlines(keepends=True)
    other = tmp_path / "short.log"
    other.write_text("".join(lines[:13]))
    args = [survey, small_session, "--channels", "color,edges", "--drive", other, "--json"]
    done = _tune(*args)
    found = json.loads(done.stdout)
    assert found["scored_on"] == ["short.log"]
    assert 0 < found["scored"]["pictures"] < 14
    assert "flatters" not in done.stderr


def test_bad_input_is_one_line(small_session, survey, tmp_path):
    truthless = tmp_path / "truthless.log"
    lines = small_session.read_text().splitlines(keepends=True)
    truthless.write_text("".join(line for line in lines if '"truth"' not in line))
    for args, expected in (
        ([survey, truthless], "found no picture with a true pose"),
        ([survey, tmp_path / "none.log"], "No such file"),
        ([survey, "--drive", tmp_path / "none.log"], "No such file"),
        ([survey, survey], "found a survey log, expected a session log"),
    ):
        done = _tune(*args, expect=1)
        assert expected in done.stderr
        assert len(done.stderr.splitlines()) == 1
    assert "no channel called 'colour'" in _tune(survey, "--channels", "colour", expect=2).stderr
