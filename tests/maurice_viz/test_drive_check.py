"""A drive's own pictures against the library, before a replay: what is widened, what is only said."""

from __future__ import annotations

import json

import numpy as np
import pytest

import maurice_mcl as mcl
from helpers.commands import maurice
from maurice_mcl.config.build import build_localizer
from maurice_mcl.config.parameters import PRESETS, Layer, configure
from maurice_mcl.examples import picture_at
from maurice_mcl.sensor.drive_score import DrivePicture
from maurice_viz.app.drive_check import suited

START = np.array([0.4, 0.9, 0.2])


def _groups(off):
    """See the pictures of other poses."""
    poses = np.column_stack([np.linspace(0.3, 0.9, 32), np.linspace(1.3, 0.8, 32), np.linspace(-3, 3, 32)])
    pictures = [DrivePicture(lambda pose=pose: picture_at(pose + off), pose) for pose in poses]
    return [pictures[k : k + 4] for k in range(0, 32, 4)]


def _suited(off, start=START, preset=None, settings=None):
    layers = [] if preset is None else [Layer(f"preset {preset}", PRESETS[preset])]
    configuration = configure([*layers, Layer("settings", settings or {})])
    localizer = build_localizer(mcl.tiny_library(), None, configuration.parameters)
    return configuration, localizer, *suited(configuration, localizer, start, _groups(np.array(off)))


WRONG = (0.3, -0.2, 0.8)


def test_pictures_that_fit_change_nothing_and_say_nothing():
    before, localizer, after, same, said = _suited(
        (0.0, 0.0, 0.0), settings={"sensor.weights": {"tiny": 0.1}}
    )
    assert (before is after, localizer is same, said) == (True, True, ())


def test_pictures_that_mislead_widen_the_scales_of_filter_and_configuration_alike():
    before, localizer, after, widened, (said,) = _suited(WRONG)
    ours, its = before.parameters.sensor, after.parameters.sensor
    assert its.widening > 2 * ours.widening
    assert widened.sensor.parameters == its
    assert widened.sensor.references is localizer.sensor.references
    assert after.values()["sensor.widening"] == its.widening
    assert "worse than none at their true poses (color, edges: -" in said
    assert f"widened by {its.widening:g}" in said
    assert "--set sensor.widening=1 keeps them" in said


@pytest.mark.parametrize(
    "how",
    [{"start": None}, {"settings": {"sensor.widening": 1.0}}, {"preset": "thesis"}],
)
def test_a_search_and_what_somebody_chose_stay_as_they_are(how):
    before, localizer, after, same, said = _suited(WRONG, **how)
    assert before is after
    assert localizer is same
    assert len(said) <= 1
    assert all("survey the places that it goes through" in text for text in said)


def test_library_check_compares_the_pictures_of_a_drive(small_session):
    out, _ = maurice(
        "library", "check", small_session.parent / "survey.log", "--drive", small_session, "--json"
    )
    drive = json.loads(out)["drive"]
    assert 0 < drive["pictures"] <= 14
    assert {"gain", "widening", "tells", "is_bad"} <= set(drive)
