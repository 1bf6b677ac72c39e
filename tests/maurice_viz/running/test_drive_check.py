"""A drive's own pictures against the library, before a replay: what is widened, what is only said."""

from __future__ import annotations

import csv
import itertools
import json
import os
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

import maurice_mcl as mcl
import maurice_viz as mv
from helpers.commands import maurice
from maurice_datasets.trials.recognition import PlaceRecognition
from maurice_loaders.errors import InputError
from maurice_mcl.config.build import adapted, build_localizer
from maurice_mcl.config.parameters import ALPHAS, PRESETS, Layer, configure
from maurice_mcl.examples import picture_at
from maurice_mcl.library.drive_score import MUTED, DrivePicture
from maurice_mcl.library.left_out import PlaceScore
from maurice_mcl.library.retrieval import Ranking, Retrieval
from maurice_mcl.scoring.comparison import odometry_alone
from maurice_mcl.scoring.table import TableRows
from maurice_mcl.sensor.descriptors.registry import CHANNELS, FEATURES, OUR_NAMES
from maurice_mcl.sensor.references import nearest_reference
from maurice_mcl.values.geometry import motion_between, wrap
from maurice_mcl.values.library import ChannelIndex, Library
from maurice_mcl.values.map import Arena
from maurice_mcl.values.session import Frame, Moment, SessionInfo
from maurice_viz.running.drive_check import suited
from maurice_viz.text.library import say_drive, say_recognition

START = np.array([0.4, 0.9, 0.2])


def _driven(off, motion=(0.1, 0.0, 0.0)):
    """See the pictures of other poses, and move by odometry that soon errs."""
    poses = np.column_stack([np.linspace(0.3, 0.9, 32), np.linspace(1.3, 0.8, 32), np.linspace(-3, 3, 32)])
    moved = np.array([motion])
    return [DrivePicture(lambda pose=pose: picture_at(pose + off), pose, moved) for pose in poses]


def _suited(off, start=START, preset=None, settings=None, library=None, pictures=None):
    """Return the asked and the suited configuration, the filter before and after, and the score."""
    layers = [] if preset is None else [Layer(f"preset {preset}", PRESETS[preset])]
    asked = configure([*layers, Layer("settings", settings or {})])
    library = mcl.tiny_library() if library is None else library
    scaled, places = adapted(asked, library, nearest_reference(library.poses, library.arena))
    localizer = build_localizer(library, mcl.tiny_session(), scaled.parameters)
    pictures = _driven(np.array(off)) if pictures is None else pictures
    return asked, scaled, localizer, *suited(scaled, localizer, places.widening, start, pictures)


WRONG = (0.3, -0.2, 0.8)


def test_pictures_that_fit_change_nothing_and_say_nothing():
    settings = {"sensor.weights": {"tiny": 0.1}}
    _, scaled, localizer, after, same, score = _suited((0.0, 0.0, 0.0), settings=settings)
    assert (scaled is after, localizer is same) == (True, True)
    assert list(say_drive("tiny", ["tiny"], score)) == []


def test_pictures_that_mislead_mute_filter_and_configuration_alike():
    asked, _, localizer, after, muted, score = _suited(WRONG)
    its = after.parameters.sensor
    assert not score.tells
    assert its.widening == MUTED * asked.parameters.sensor.widening
    assert muted.sensor.parameters == its
    assert muted.sensor.references is localizer.sensor.references
    values = after.values()
    assert (values["sensor.widening"], values["recovery.strategy"]) == (its.widening, "none")
    (said,) = say_drive("tiny", ["color", "edges"], score, 1.0)
    assert "worse than none at their true poses (color, edges: " in said
    assert f"widened by {its.widening:g}" in said
    assert "--set sensor.widening=1 keeps them" in said


def _sharp(factor):
    """Return a setting by which likelihoods are sharper, while nobody has chosen scales."""
    return {"sensor.weights": {"tiny": factor}}


def test_the_drive_decides_in_place_of_the_library_and_from_our_own_scales(monkeypatch):
    """What the library widened is not widened again, and a library that doubts a good camera is overruled."""
    doubts = PlaceScore(3, 8, -9.0, -1.0, 100.0)
    monkeypatch.setattr("maurice_mcl.config.build.score_places", lambda table, fit=False: doubts)
    asked, scaled, _, after, localizer, score = _suited((0.0, 0.0, 0.0), settings=_sharp(0.1))
    assert scaled.parameters.sensor.widening == 100
    assert after.parameters.sensor == localizer.sensor.parameters == asked.parameters.sensor
    (said,) = say_drive("tiny", ["tiny"], score, 100.0)
    assert "the scales are not widened, as the drive's pictures fit" in said
    assert "by its own pictures alone they would be, by 100" in said
    asked, _, _, after, _, score = _suited((0.0, 0.0, 0.0), settings=_sharp(30.0))
    assert 1 < score.widening < 100
    assert after.parameters.sensor.widening == score.widening


def test_pictures_that_mislead_are_not_used_where_odometry_stays_right_without_them():
    """The same pictures are worth using, at wider scales, where odometry does not."""
    off, poses = np.zeros(3), [picture.truth for picture in _driven(np.zeros(3))]
    steps = [np.zeros(3), *(motion_between(a, b) for a, b in itertools.pairwise(poses))]
    good = [replace(picture, motions=step[None]) for picture, step in zip(_driven(off), steps, strict=True)]
    settings = _sharp(30.0) | {"motion": {"model": "odometry", **dict.fromkeys(ALPHAS, 0.001)}}
    *_, score = _suited(off, poses[0], settings=settings, pictures=good)
    assert (score.tells, score.widening) == (False, MUTED)
    *_, score = _suited(off, poses[0], settings=settings)
    assert score.tells
    assert score.widening < MUTED


@pytest.mark.parametrize(
    "how",
    [{"start": None}, {"settings": {"sensor.widening": 1.0}}, {"preset": "thesis"}],
)
def test_a_search_and_what_somebody_chose_stay_as_they_are(how):
    _, scaled, localizer, after, same, score = _suited(WRONG, **how)
    assert scaled is after
    assert localizer is same
    assert all("survey the places that it goes through" in text for text in say_drive("tiny", ["x"], score))


def test_library_check_compares_the_pictures_of_a_drive(small_session):
    out, _ = maurice(
        "library", "check", small_session.parent / "survey.log", "--drive", small_session, "--json"
    )
    drive = json.loads(out)["drive"]
    assert 0 < drive["pictures"] <= 14
    assert {"gain", "widening", "tells", "is_bad"} <= set(drive)


def test_library_check_looks_the_pictures_of_a_drive_up(small_session, tmp_path):
    """As a table, a plot and JSON, by each channel, those in use together, and those that are not used."""
    survey, figure = small_session.parent / "survey.log", tmp_path / "curves.svg"
    shown, _ = maurice("library", "check", survey, "--drive", small_session, "-o", figure)
    assert "a right reference is found" in shown
    assert "not used: " in shown
    assert max(map(len, shown.splitlines())) <= 80
    assert figure.read_bytes().startswith(b"<?xml")
    out, _ = maurice("library", "check", survey, "--drive", small_session, "--json")
    told = json.loads(out)["retrieval"]
    assert told["pictures"] == told["with_a_right_reference"] == 14
    ways = {way["name"]: way for way in told["ways"]}
    assert set(ways) == {"together", *OUR_NAMES}
    assert [name for name, way in ways.items() if way["used"]] == ["together", "color", "edges"]
    for way in ways.values():
        first, *more = (way[f"recall_at_{count}"] for count in (1, 5, 10))
        assert 0 <= first["low"] <= first["value"] <= first["high"] <= 1
        assert first["value"] <= more[0]["value"] <= more[1]["value"]
        assert way["curve"]["recall"][-1] == pytest.approx(first["value"])
        assert 0 <= way["area"]["value"] <= first["value"]
    assert set(told["gain_without"]) == {"color", "edges"}
    with pytest.raises(InputError, match="found no drive to look up"):
        mv.check_library(survey, curves=tmp_path / "none.svg")


def test_the_channel_that_hurts_is_named():
    """One that is wrong everywhere, and outweighs one that is always right."""
    right = Ranking(np.ones(60, np.int32), np.arange(60.0))
    wrong = Ranking(np.full(60, 40, np.int32), np.arange(60.0))
    mixed = Ranking(np.where(np.arange(60) % 3, 40, 1).astype(np.int32), np.arange(60.0))
    alone, without = {"color": right, "edges": wrong}, {"color": wrong, "edges": right}
    found = PlaceRecognition.of(
        Retrieval(alone, mixed, without, np.arange(60) // 3, 60, 0.5), ["color", "edges"]
    )
    assert (found.worst, found.hurting) == ("edges", ("edges",))
    (line,) = say_recognition(found)
    assert line.startswith(
        "edges hurts: without it 100% of the pictures find a right reference first instead"
    )
    few = Retrieval(alone, mixed, without, np.arange(60) // 30, 60, 0.5)
    (line,) = say_recognition(PlaceRecognition.of(few, ["color", "edges"]))
    assert "may hurt" in line, "two stretches are two pictures"
    helps = Retrieval(alone, right, {"color": wrong, "edges": right}, np.arange(60), 60, 0.5)
    assert list(say_recognition(PlaceRecognition.of(helps, ["color", "edges"]))) == []


def test_what_verification_gains_is_told_as_it_has_no_row_of_its_own():
    right, wrong = (Ranking(np.full(60, rank, np.int32), np.arange(60.0)) for rank in (1, 40))
    for together, without, says in (
        (right, wrong, "keypoints help: without them 0% of the pictures find a right reference first"),
        (wrong, right, "keypoints hurt: without them 100% of the pictures find a right reference first"),
        (right, right, "keypoints make no difference here: without them 100% of the pictures"),
    ):
        retrieval = Retrieval({"color": wrong}, together, {"keypoints": without}, np.arange(60), 60, 0.5)
        (line,) = say_recognition(PlaceRecognition.of(retrieval, ["color", "keypoints"]))
        assert line.startswith(says)


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
    pictures = [
        DrivePicture(lambda each=each: each.frame.image, each.truth, each.frame.motions) for each in moments
    ]
    configuration = configure([Layer("preset robust", PRESETS["robust"])])
    nearest = nearest_reference(library.poses, library.arena)
    scaled, places = adapted(configuration, library, nearest)
    session = SimpleNamespace(info=SessionInfo("olin"))
    localizer = build_localizer(library, session, scaled.parameters, reference=nearest)
    start = moments[0].truth
    _, widened, score = suited(scaled, localizer, places.widening, start, pictures)
    assert score.widening > 1
    rows = TableRows(start=start, localizer=widened)
    records = mcl.run(widened, SimpleNamespace(info=session.info, moments=lambda: iter(moments)), start)
    for moment, record in records:
        rows.add(moment, record)
    alone = odometry_alone(rows.table(), widened)
    assert not alone.is_better
    assert alone.against.mean < 0.05  # meters more than odometry alone
