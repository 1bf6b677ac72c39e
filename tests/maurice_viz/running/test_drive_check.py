"""A drive's own pictures against the library, before a replay: what is widened, what is only said."""

from __future__ import annotations

import csv
import json
import os
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

import maurice_mcl as mcl
from helpers.commands import maurice
from maurice_mcl.config.build import adapted, build_localizer
from maurice_mcl.config.parameters import PRESETS, Layer, configure
from maurice_mcl.examples import picture_at
from maurice_mcl.library.quality import DrivePicture, spread_groups
from maurice_mcl.scoring.comparison import DeadReckoning
from maurice_mcl.sensor.descriptors.registry import CHANNELS, FEATURES
from maurice_mcl.sensor.references import nearest_reference
from maurice_mcl.values.geometry import motion_between, wrap
from maurice_mcl.values.library import ChannelIndex, Library
from maurice_mcl.values.map import Arena
from maurice_mcl.values.session import Frame, Moment, SessionInfo
from maurice_viz.running.drive_check import suited

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
    assert "worse than none at their true poses (color, edges: " in said
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
    out, _ = maurice("library", "check", small_session.parent / "survey.log", small_session, "--json")
    drive = json.loads(out)["drive"]
    assert 0 < drive["pictures"] <= 14
    assert {"gain", "widening", "tells", "is_bad"} <= set(drive)


OLIN = Path(os.environ.get("MAURICE_DATA", Path(__file__).parents[4] / "shared" / "data")) / "olin"
SPOTS = ((9, 10, 11, 12, 13, 14, 15), (28, 29, 30, 31, 32), (54, 60, 61, 62, 63, 64))  # runs surveyed


def _pictures(numbers, rows):
    files = [OLIN / rows[k]["image"] for k in numbers]
    return [cv2.cvtColor(cv2.imread(str(file)), cv2.COLOR_BGR2RGB) for file in files]


@pytest.mark.slow
@pytest.mark.skipif(not OLIN.is_dir(), reason=f"no pictures at {OLIN}; set MAURICE_DATA")
def test_few_views_at_few_spots_of_a_real_building_are_never_worse_than_odometry_alone():
    """75 pictures at 3 spots, and a drive between them with made-up odometry."""
    rows = list(csv.DictReader((OLIN / "poses.csv").read_text().splitlines()))
    values = np.array([[float(row[key]) for key in ("x_m", "y_m", "heading_deg")] for row in rows])
    poses = np.column_stack([values[:, :2], wrap(np.radians(values[:, 2]))])
    run = np.array([int(row["pose_run"]) for row in rows])
    some = [np.flatnonzero(np.isin(run, spot)) for spot in SPOTS]
    kept = np.concatenate([each[np.linspace(0, len(each) - 1, 25).astype(int)] for each in some])
    images, index = _pictures(kept, rows), {}
    for name in FEATURES["best"]:
        found = np.stack([CHANNELS[name].describe(image) for image in images])
        index[name] = ChannelIndex(found, np.zeros(found.shape[1], np.float32), found.max(axis=0))
    low, high = poses[:, :2].min(axis=0) - 1, poses[:, :2].max(axis=0) + 1
    library = Library("spots", poses[kept], (None,) * 75, index, Arena((*low, *high), np.zeros((0, 4))))
    driven = np.flatnonzero((run <= 71) & ~np.isin(run, sum(SPOTS, ())))[::3]
    rng, moments = np.random.default_rng(0), []
    for step, (k, image) in enumerate(zip(driven, _pictures(driven, rows), strict=True), start=1):
        motion = motion_between(poses[driven[max(step - 2, 0)]], poses[k])
        sd = np.array([*[0.1 * np.hypot(*motion[:2])] * 2, np.radians(3.0) * bool(motion.any())])
        motions = (motion + sd * rng.standard_normal(3))[None]
        frame = Frame(step, float(step), motions, image, "")
        moments.append(Moment(frame, poses[k]))
    groups = [
        [DrivePicture(lambda k=k: moments[k].frame.image, moments[k].truth) for k in group]
        for group in spread_groups(len(moments))
    ]
    configuration = configure([Layer("preset robust", PRESETS["robust"])])
    nearest = nearest_reference(library.poses, library.arena)
    configuration, _ = adapted(configuration, library, nearest)
    session = SimpleNamespace(info=SessionInfo("olin"))
    localizer = build_localizer(library, session, configuration.parameters, reference=nearest)
    start = moments[0].truth
    _, widened, said = suited(configuration, localizer, start, groups)
    assert len(said) == 1
    reckoning = DeadReckoning.of(widened, start)
    records = mcl.run(widened, SimpleNamespace(info=session.info, moments=lambda: iter(moments)), start)
    for moment, record in records:
        reckoning.add(moment, record)
    alone = reckoning.result()
    assert not alone.is_better
    assert alone.against.mean < 0.05  # meters more than odometry alone
