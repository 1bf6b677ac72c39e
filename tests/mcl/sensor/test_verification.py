"""References that fit best are verified by keypoints: costs by hand, and what filters make of them."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

import maurice_mcl as mcl
from helpers.filter_world import make_world
from maurice_mcl.library.drive_score import DrivePicture
from maurice_mcl.library.retrieval import look_up
from maurice_mcl.sensor.descriptors.registry import CHANNELS, weights_of
from maurice_mcl.sensor.landmarks.features import keypoints_of
from maurice_mcl.sensor.model import SensorModel, SensorParameters
from maurice_mcl.sensor.references import nearest_reference
from maurice_mcl.sensor.verification import BESIDE, MOST_MATCHES, VERIFIED, KeypointMatches
from maurice_mcl.values import ChannelIndex, Frame

SIZE = 240, 320
REFERENCES = 40
NONE = mcl.PoseSpread()


def _picture(seed):
    """A picture with some hundred corners, all of one color: no channel tells two of them apart."""
    rng, image = np.random.default_rng(seed), np.full((*SIZE, 3), 128, np.uint8)
    for x, y, w, h, shade in rng.integers([0, 0, 6, 6, 0], [310, 230, 40, 40, 256], (90, 5)).tolist():
        cv2.rectangle(image, (x, y), (x + w, y + h), (shade,) * 3, -1)
    return image


def _frame(image):
    return Frame(1, 0.0, np.zeros((0, 3)), image, "")


@pytest.fixture(scope="module")
def world():
    """A library of 40 pictures, and a color channel that knows nothing: all references are alike to it."""
    library = make_world().library
    library = replace(library, poses=library.poses[:REFERENCES], pictures=library.pictures[:REFERENCES])
    images = [_picture(seed) for seed in range(library.size)]
    row = CHANNELS["color"].describe(images[0])
    index = {"color": ChannelIndex(np.tile(row, (library.size, 1)), np.zeros_like(row), row)}
    matches = KeypointMatches.of(library.poses, [keypoints_of(image) for image in images])
    return replace(library, index=index, sensors={"keypoints": matches}), images


def _sensor(library, weight=0.1, sharpness=1.0):
    parameters = SensorParameters({"color": 1.0, "keypoints": weight}, sharpness)
    nearest = nearest_reference(library.poses, library.arena)
    return SensorModel(library, nearest, parameters, sensors=dict(library.sensors))


def test_the_same_picture_lacks_nothing_and_all_others_as_much_as_the_worst(world):
    library, images = world
    sensor = library.sensors["keypoints"]
    entry, likely = 17, np.zeros(library.size, np.float32)
    verified = np.r_[entry, 0 : VERIFIED - 1]
    likely[verified] = 1
    lacks = sensor.verify(sensor.read(_frame(images[entry])), likely)
    assert lacks[entry] == 0
    assert (lacks[verified[1:]] > MOST_MATCHES / 3).all()
    others = np.setdiff1d(np.arange(library.size), verified)
    assert (lacks[others] == lacks.max()).all(), "what is not verified is no better than what was"
    assert lacks.max() <= MOST_MATCHES


def test_a_reference_that_no_channel_finds_is_not_verified(world):
    library, images = world
    sensor = library.sensors["keypoints"]
    likely = -np.arange(library.size, dtype=np.float32)
    lacks = sensor.verify(sensor.read(_frame(images[VERIFIED])), likely)
    assert lacks[VERIFIED] == lacks.max()


def test_a_blank_picture_lacks_nothing(world):
    library, _ = world
    sensor = library.sensors["keypoints"]
    blank = np.full((*SIZE, 3), 90, np.uint8)
    assert not sensor.verify(sensor.read(_frame(blank)), np.zeros(library.size, np.float32)).any()
    none = KeypointMatches.of(library.poses[:3], [keypoints_of(blank)] * 3)
    assert not none.verify(sensor.read(_frame(_picture(1))), np.zeros(3, np.float32)).any()


def test_nats_are_the_weight_times_the_matches_that_lack_in_all_that_weighs(world):
    library, images = world
    frame, entry = _frame(images[4]), 4
    plain = _sensor(library).only("color").see(frame)
    for weight, sharpness in ((0.1, 1.0), (0.05, 2.0)):
        seen = _sensor(library, weight, sharpness).see(frame)
        (part,) = seen.verified
        assert seen.sensed == ()
        assert part.name == "keypoints"
        assert seen.cost == pytest.approx(plain.cost + weight * part.cost, abs=1e-5)
        fell = plain.log_likelihood * sharpness - seen.log_likelihood
        assert fell == pytest.approx(sharpness * weight * part.cost, abs=1e-4)
        assert seen.by_channels is seen, "recovery and the lost signal read what was verified"
        assert seen.of_references.argmax() == entry


def test_a_particle_is_weighed_by_the_reference_that_was_verified(world):
    library, images = world
    sensor, entry = _sensor(library), 9
    poses = library.poses.copy()
    poses[:, :2] -= library.origin
    sighting = sensor.at(sensor.see(_frame(images[entry])), poses.astype(np.float32))
    assert sighting.log_likelihood.argmax() == entry
    assert np.ptp(sighting.log_likelihood) > 2, "color alone tells nothing"


def test_a_virtual_reference_has_the_mean_of_its_sources(world):
    library, images = world
    settings = {"sensor.weights": {"color": 1.0, "keypoints": 0.1}}
    sensor = mcl.make_localizer(library, preset="robust", settings=settings).sensor
    plain = replace(sensor, sensors={})
    seen, before = sensor.see(_frame(images[20])), plain.see(_frame(images[20]))
    (part,) = seen.verified
    lost = before.virtual - seen.virtual
    assert len(lost)
    assert lost == pytest.approx(0.1 * part.cost[sensor.sources].mean(axis=1), abs=1e-4)


def test_with_landmarks_or_another_pose_sensor_both_count(world):
    library, images = world

    class Compass(mcl.PoseSensor):
        name = "compass"

        def read(self, frame):
            return 0.0

        def log_likelihood(self, reading, poses, origin, spread=None):
            return -np.abs(poses[:, 2]).astype(np.float32)

    settings = {"sensor.weights": {"color": 1.0, "keypoints": 0.1}}
    localizer = mcl.make_localizer(library, settings=settings, sensors=[Compass()])
    seen = localizer.sensor.see(_frame(images[20]))
    assert [part.name for part in seen.read] == ["keypoints", "compass"]
    assert [part.name for part in seen.sensed] == ["compass"], "keypoints say nothing of a pose"
    verified = _sensor(library).see(_frame(images[20]))
    assert seen.of_channels == pytest.approx(verified.log_likelihood, abs=1e-5)
    assert seen.by_channels.cost == pytest.approx(verified.cost, abs=1e-4)


def test_the_picture_is_shown_beside_the_reference_at_the_estimate(world):
    library, images = world
    sensor, entry = library.sensors["keypoints"], 12
    shown = sensor.shown(sensor.read(_frame(images[entry])), {"estimate": library.poses[entry]})
    (marks,) = shown.marks
    assert shown.pictures[BESIDE].reference == entry
    assert f"{len(marks.strips)} of " in shown.words
    assert len(marks.strips) > MOST_MATCHES
    left, right = marks.strips[:, 0], marks.strips[:, 1]
    assert right - left == pytest.approx(
        np.tile([shown.pictures[BESIDE].right_px, 0], (len(left), 1)), abs=1e-3
    )


def test_it_is_the_same_from_a_file(world):
    library, images = world
    sensor = library.sensors["keypoints"]
    again = KeypointMatches.from_arrays(sensor.to_arrays())
    reading, likely = sensor.read(_frame(images[2])), np.zeros(library.size, np.float32)
    assert (again.verify(reading, likely) == sensor.verify(reading, likely)).all()
    with pytest.raises(ValueError, match="other references"):
        KeypointMatches.from_arrays({**sensor.to_arrays(), "poses": library.poses[:-1]})


def test_what_verification_finds_is_told_beside_the_channels(world):
    """Color finds what comes first; with keypoints the right reference is first wherever it is verified."""
    library, images = world
    pictures = [DrivePicture(lambda k=k: images[k], library.poses[k]) for k in range(VERIFIED)]
    found = look_up(_sensor(library), pictures, 0.01)
    assert found.together.among(1).all()
    assert set(found.alone) == {"color"}
    assert set(found.without) == {"color", "keypoints"}
    assert found.without["keypoints"].among(1).tolist() == [True] + [False] * (VERIFIED - 1)


def test_without_a_channel_nothing_is_found_that_could_be_verified(world):
    library, _ = world
    with pytest.raises(mcl.InputError, match="found keypoints, expected a channel, too: keypoints verify"):
        mcl.make_localizer(library, settings={"sensor.weights": {"keypoints": 1.0}})


def test_the_feature_is_best_with_keypoints():
    assert weights_of("verified") == {**weights_of("best"), "keypoints": 0.1}
