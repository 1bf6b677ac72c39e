"""Landmarks of a synthetic room: what is read by them, how likely poses are, and what is shown."""

from __future__ import annotations

from dataclasses import fields, replace

import cv2
import numpy as np
import pytest

from helpers import expect_facts
from maurice_mcl.sensor.landmarks.camera import linearize
from maurice_mcl.sensor.landmarks.picture import BESIDE, PICTURE
from maurice_mcl.sensor.landmarks.sensor import Landmarks
from maurice_mcl.sensor.landmarks.things import besides_one_thing, things_of
from maurice_mcl.values.map import Region
from maurice_mcl.values.pose_sensor import EXACT, PoseSpread, Sensed
from maurice_mcl.values.session import Frame

from .conftest import KNOWN, built

POSE = np.array([1.3, 1.6, 0.4])
ORIGIN = np.array([1.5, 1.5])


def near(poses):
    return (np.atleast_2d(poses) - [*ORIGIN, 0.0]).astype(np.float32)


def frame_of(image):
    return Frame(1, 0.0, np.zeros((0, 3)), image, "")


@pytest.fixture(scope="module")
def reading(landmarks, room):
    found = landmarks.matched(room.keypoints(POSE, 0.5, 99))
    assert found is not None
    return found


def joined_by(known, rng, copies, off_m, noise):
    """Return landmarks with copies of each, up to a distance away, that look nearly like it."""
    points = known.points[:, None] + rng.uniform(-0.05, 0.05, (known.size, copies, 3)) + off_m
    looks = known.descriptors[:, None] + noise * rng.random((known.size, copies, 128), np.float32)
    looks /= np.linalg.norm(looks, axis=2, keepdims=True)
    same = np.append(np.arange(known.size), np.repeat(np.arange(known.size), copies))
    return replace(
        known,
        **{name: getattr(known, name)[same] for name in ("sd_m", "nearest_m", "farthest_m")},
        points=np.concatenate([known.points, points.reshape(-1, 3)]),
        descriptors=np.concatenate([known.descriptors, looks.reshape(-1, 128)]),
    )


@pytest.mark.parametrize("copies", [1, 3, 4, 12])
def test_landmarks_that_stand_together_count_as_one_thing(landmarks, room, copies):
    """However many they are, what is elsewhere decides how sure a match is."""
    seen, rng = room.keypoints(POSE, 0.5, 99), np.random.default_rng(7)
    twins = joined_by(landmarks.map, rng, 1, np.array([1.0, 0.0, 0.0]), 0.005)
    crowded = joined_by(twins, rng, copies, np.zeros(3), 0.001)
    few, many = (replace(landmarks, map=known).matched(seen) for known in (twins, crowded))
    assert few.inlier.max() < 0.5, "a twin elsewhere: no match is sure"
    assert many is None or many.inlier.max() < 0.5


def test_without_anything_elsewhere_no_match_is_sure(landmarks, room):
    known = landmarks.map
    one_place = replace(known, points=known.points[:1] + 0.001 * known.points)
    assert replace(landmarks, map=one_place).matched(room.keypoints(POSE, 0.5, 99)) is None


def test_where_the_map_lies_does_not_matter(landmarks, room, references):
    """At UTM coordinates float32 has steps of half a meter."""
    off, seen = np.array([500_000.0, 5_400_000.0, 0.0]), room.keypoints(POSE, 0.5, 99)
    moved = Landmarks(built(room, references, KNOWN, off))
    assert moved.map.points - off == pytest.approx(landmarks.map.points, abs=1e-4)
    here, there = (sensor.propose(sensor.matched(seen)) for sensor in (landmarks, moved))
    assert there.poses - off == pytest.approx(here.poses, abs=1e-3)
    assert there.covariances == pytest.approx(here.covariances, rel=0.01)
    reading = landmarks.matched(seen)
    here = landmarks.shown(reading, {"estimate": POSE})
    there = moved.shown(moved.matched(seen), {"estimate": POSE + off})
    assert there.words == here.words
    for one, other in zip(here.marks, there.marks, strict=True):
        if one.view in ("map", "space"):
            assert other.strips - off[: one.strips.shape[-1]] == pytest.approx(one.strips, abs=1e-3)


def test_likelihood_is_zero_at_perfect_agreement_and_bounded(landmarks, room):
    # keypoints exactly where the landmarks fall
    reading = landmarks.matched(room.keypoints(POSE))
    fallen = landmarks.shown(reading, {"estimate": POSE}).marks[0].strips[:, 1]
    reading = replace(reading, pixels=fallen)
    poses = np.array([POSE, [1.4, 1.6, 0.4], [1.3, 1.6, 0.4 - np.pi], [90.0, -90.0, 1.0]])
    nats = landmarks.log_likelihood(reading, near(poses), ORIGIN)
    assert nats.dtype == np.float32
    assert nats[0] == pytest.approx(0, abs=0.02)
    assert (nats[1:] < -5).all()
    assert np.isfinite(nats).all()
    assert nats[2] == pytest.approx(nats[3], rel=0.05)


@pytest.mark.parametrize("spread", [EXACT, PoseSpread(0.1, 0.2)], ids=["exact", "spread"])
def test_likelihood_is_the_sum_that_the_page_gives(landmarks, reading, spread):
    poses = POSE + np.random.default_rng(6).normal(0, 1, (40, 3)) * [0.2, 0.2, 0.1]
    poses[0] = [POSE[0], POSE[1], POSE[2] + np.pi]  # most landmarks are behind the camera
    map_of, camera = landmarks.map, landmarks.map.fit.camera
    points, facing = map_of.points[reading.landmark], map_of.facing_rad[reading.landmark]
    wanted = []
    for pose in poses:
        seen = linearize(camera, np.broadcast_to(pose, points.shape), points)
        sight = pose[:2] - points[:, :2]
        agrees = (seen.depth > 0.05) & (sight[:, 0] * np.cos(facing) + sight[:, 1] * np.sin(facing) > 0)
        squared = ((seen.pixels - reading.pixels) ** 2).sum(axis=1)
        widening = spread.heading_rad**2
        if spread.position_m:
            widening = widening + (spread.position_m / np.maximum(seen.depth, landmarks._nearest_m)) ** 2
        variance = landmarks._variance_px[reading.landmark] + camera.focal_px**2 * widening
        right = agrees * np.exp(-squared / (2 * variance))
        odds = (1 - reading.inlier) / reading.inlier
        wrong = odds * 2 * np.pi * variance / (camera.width_px * camera.height_px)
        nats = np.log((right + wrong) / (1 + wrong)).sum()
        wanted.append(nats * 4 / max(4, reading.inlier.sum()))
    nats = landmarks.log_likelihood(reading, near(poses), ORIGIN, spread)
    np.testing.assert_allclose(nats, wanted, rtol=2e-3, atol=0.01)


def test_likelihood_is_highest_near_the_truth(landmarks, reading):
    rng = np.random.default_rng(3)
    poses = np.concatenate([POSE[None], POSE + rng.normal(0, 1, (300, 3)) * [0.3, 0.3, 0.3]])
    nats = landmarks.log_likelihood(reading, near(poses), ORIGIN)
    best = poses[nats.argmax()] - POSE
    assert np.hypot(*best[:2]) < 0.05
    assert (nats <= 0).all()


def test_the_origin_does_not_matter(landmarks, reading):
    one = landmarks.log_likelihood(reading, near(POSE), ORIGIN)
    other = landmarks.log_likelihood(
        reading, (POSE - [9.0, -7.0, 0])[None].astype(np.float32), np.array([9.0, -7.0])
    )
    assert one == pytest.approx(other, abs=0.01)


@pytest.mark.parametrize("kind", ["position_m", "heading_rad"])
def test_a_wider_spread_forgives_more(landmarks, reading, kind):
    poses = near(POSE + np.random.default_rng(4).normal(0, 0.1, (50, 3)))
    last = landmarks.log_likelihood(reading, poses, ORIGIN, EXACT)
    for width in (0.01, 0.05, 0.2, 1.0):
        now = landmarks.log_likelihood(reading, poses, ORIGIN, PoseSpread(**{kind: width}))
        assert (now >= last - 1e-4).all()
        last = now
    assert (last > -6).all()


def test_a_picture_proposes_where_it_was_taken(landmarks, reading):
    proposal = landmarks.propose(reading)
    assert proposal.weights.sum() == pytest.approx(1)
    off = proposal.poses[0] - POSE
    assert np.hypot(*off[:2]) < 0.05
    assert abs(off[2]) < 0.02
    assert off @ np.linalg.solve(proposal.covariances[0], off) < 25


def square(name, low, high):
    (x1, y1), (x2, y2) = low, high
    return Region(name, np.array([[x1, y1], [x2, y1], [x2, y2], [x1, y2]], np.float64))


def test_a_pose_that_one_thing_alone_speaks_for_is_marked(landmarks, reading):
    points = landmarks.map.points[reading.landmark]
    low, high = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
    all_of_them = replace(landmarks, obstacles=(square("bookcase", low, high),))
    assert all_of_them.propose(reading).from_one_object.all()
    middle = np.array([high[0], np.median(points[:, 1])])
    half = replace(landmarks, obstacles=(square("bookcase", low, middle),))
    assert not half.propose(reading).from_one_object.any()
    for sensor, said in ((all_of_them, True), (half, False)):
        assert ("Only the bookcase says so" in sensor.shown(reading, {"estimate": POSE}).words) == said
    assert not landmarks.propose(reading).from_one_object.any()


def test_landmarks_are_on_the_obstacle_that_they_are_in_or_near():
    box, table = square("box", (0, 0), (1, 1)), square("table", (3, 0), (4, 1))
    points = np.array([[0.5, 0.5, 0.2], [1.1, 0.5, 0.2], [1.2, 0.5, 0.2], [2.95, 0.9, 1.0], [9, 9, 0]])
    assert things_of(points, (box, table)).tolist() == [0, 0, -1, 1, -1]
    assert things_of(points, ()).tolist() == [-1] * 5
    right = np.array([0.9, 0.8, 0.7, 0.6, 0.5])
    assert besides_one_thing(right, things_of(points, (box, table))) == pytest.approx(1.8)
    assert besides_one_thing(right, things_of(points, ())) == pytest.approx(3.5)


def test_matches_by_chance_propose_nothing(landmarks, room):
    keypoints = room.keypoints(POSE, 0.5, 5)
    rng = np.random.default_rng(6)
    keypoints.pixels[:] = rng.uniform(0, 1, keypoints.pixels.shape) * [176, 144]
    assert landmarks.propose(landmarks.matched(keypoints)) is None


def test_a_blank_picture_says_nothing(landmarks):
    assert landmarks.read(frame_of(np.full((144, 176, 3), 90, np.uint8))) is None


def test_a_flat_picture_with_noise_says_nothing(landmarks):
    noise = np.random.default_rng(0).normal(90, 2, (144, 176, 3)).clip(0, 255).astype(np.uint8)
    assert landmarks.read(frame_of(noise)) is None


def test_a_blurred_picture_proposes_nothing(landmarks):
    noise = np.random.default_rng(0).integers(0, 255, (144, 176, 3), np.uint8)
    blurred = cv2.GaussianBlur(noise, (0, 0), 9)
    reading = landmarks.read(frame_of(blurred))
    assert reading is None or landmarks.propose(reading) is None


def test_a_picture_of_another_shape_says_nothing(landmarks):
    noise = np.random.default_rng(0).integers(0, 255, (144, 144, 3), np.uint8)
    assert landmarks.read(frame_of(noise)) is None


def test_a_larger_picture_of_the_same_shape_is_read_as_one_of_the_librarys_size(landmarks):
    noise = np.random.default_rng(0).integers(0, 255, (72, 88, 3), np.uint8)
    small = cv2.resize(noise, (176, 144), interpolation=cv2.INTER_CUBIC)
    large = cv2.resize(small, (352, 288), interpolation=cv2.INTER_CUBIC)
    one, other = (landmarks.read(frame_of(image)) for image in (small, large))
    assert other.image.shape == (144, 176, 3)
    apart = np.hypot(*(one.pixels[:, None] - other.pixels).transpose(2, 0, 1))
    assert np.median(apart.min(axis=1)) < 0.3


def test_arrays_hold_everything(landmarks, reading):
    again = Landmarks.from_arrays(landmarks.to_arrays())
    assert again.map.fit.camera == landmarks.map.fit.camera
    poses = near(POSE + np.random.default_rng(4).normal(0, 0.1, (50, 3)))
    np.testing.assert_array_equal(
        again.log_likelihood(reading, poses, ORIGIN), landmarks.log_likelihood(reading, poses, ORIGIN)
    )
    np.testing.assert_array_equal(again.map.descriptors, landmarks.map.descriptors)


def test_a_reading_kept_as_numbers_is_the_same_to_the_last_bit(landmarks, room):
    image = np.random.default_rng(0).integers(0, 255, (144, 176, 3), np.uint8)
    reading = landmarks.matched(room.keypoints(POSE, 0.5, 99), image)
    again = landmarks.of_numbers(landmarks.to_numbers(reading), frame_of(image))
    assert len(again.modes) == len(reading.modes) > 0
    for one, other in ((again, reading), *zip(again.modes, reading.modes, strict=True)):
        for field in fields(one):
            if field.name != "modes":
                here, there = (np.asarray(getattr(each, field.name)) for each in (one, other))
                assert (here.dtype, here.tobytes()) == (there.dtype, there.tobytes())
    assert landmarks.of_numbers(landmarks.to_numbers(None), frame_of(image)) is None
    assert landmarks.checksum == Landmarks.from_arrays(landmarks.to_arrays()).checksum
    moved = replace(landmarks.map, points=landmarks.map.points + 1e-9)
    assert landmarks.checksum != replace(landmarks, map=moved).checksum


@pytest.mark.parametrize("name", ["points", "camera", "seen"])
def test_arrays_that_do_not_fit_are_named(landmarks, name):
    arrays = landmarks.to_arrays()
    del arrays[name]
    with pytest.raises(ValueError, match=name):
        Landmarks.from_arrays(arrays)
    short = {**landmarks.to_arrays(), "seen": np.zeros(3, np.int32)}
    with pytest.raises(ValueError, match="3 rows of 'seen'"):
        Landmarks.from_arrays(short)


def marks_of(shown):
    return {(mark.view, mark.name): mark for mark in shown.marks}


def test_what_is_shown_counts_those_that_agree(landmarks, room):
    reading = landmarks.matched(room.keypoints(POSE, 0.5, 99), np.zeros((144, 176, 3), np.uint8))
    shown = landmarks.shown(reading, {"estimate": POSE, "truth": POSE})
    marks, count = marks_of(shown), len(reading.landmark)
    agreeing = int(marks["map", "matched landmarks"].agrees.sum())
    assert agreeing > 0.8 * count
    words = shown.text(lambda length: f"{length:.2f} m")
    expect_facts(words, f"{agreeing} of {count}", "agree", "0.")
    assert "nats at the estimate, " in words
    assert "By themselves they put the robot 0.0" in words
    assert {mark.view for mark in shown.marks} == {*landmarks.pictures, "map", "space"}
    assert marks[PICTURE, "where the truth has them"].of == "truth"
    assert not shown.moved


def test_where_no_landmark_agrees_a_reference_is_shown_all_the_same(landmarks, room):
    reading = landmarks.matched(room.keypoints(POSE, 0.5, 99), np.zeros((144, 176, 3), np.uint8))
    shown = landmarks.shown(reading, {"estimate": np.add(POSE, [0, 0, np.pi])})
    lines = marks_of(shown)[BESIDE, "to the reference"]
    assert len(lines.strips)
    assert not lines.agrees.any()
    assert BESIDE in shown.pictures


def test_few_that_agree_are_said_to_be_usual_where_they_still_tell_the_place(landmarks, room):
    seen = room.keypoints(POSE, 0.5, 99)
    wrong = np.random.default_rng(0).permutation(len(seen.pixels))[: int(0.7 * len(seen.pixels))]
    seen.pixels[wrong] = seen.pixels[np.roll(wrong, 1)]
    reading = landmarks.matched(seen, np.zeros((144, 176, 3), np.uint8))
    words = landmarks.shown(reading, {"estimate": POSE}).words
    assert "(in a picture with little to see most matches are wrong)." in words
    elsewhere = landmarks.shown_with(reading, {"estimate": POSE}, None).words
    assert "most matches are wrong" not in elsewhere


def test_what_is_shown_does_not_find_the_proposal_again(landmarks, reading, monkeypatch):
    poses, found = {"estimate": POSE, "truth": POSE + 0.01}, []
    propose = Landmarks.propose
    monkeypatch.setattr(Landmarks, "propose", lambda *of: found.append(of) or propose(*of))
    sensed = Sensed(landmarks, reading, 1.0, np.zeros(0, np.float32))
    assert sensed.proposal is not None
    shown = sensed.shown(poses)
    assert len(found) == 1
    assert shown.words == landmarks.shown(reading, poses).words


def test_lines_lead_to_the_reference_that_saw_the_same(landmarks, room, references):
    reading = landmarks.matched(room.keypoints(POSE, 0.5, 99), np.zeros((144, 176, 3), np.uint8))
    shown = landmarks.shown(reading, {"estimate": POSE})
    beside, lines = shown.pictures[BESIDE], marks_of(shown)[BESIDE, "to the reference"]
    near = references[0][beside.reference]
    assert abs(near[2] - POSE[2]) < 0.6  # it looks the same way
    assert len(lines.strips) >= 8
    assert lines.agrees.mean() > 0.9
    ends = lines.strips[:, 1] - [beside.right_px, 0]
    saw = room.keypoints(references[1][beside.reference], 0.5, beside.reference).pixels
    assert np.hypot(*(ends[:, None] - saw).transpose(2, 0, 1)).min(axis=1).max() < 0.01


def test_a_thing_that_moved_is_told_with_its_shift(landmarks, room):
    shifted = room.points.copy()
    thing = (room.points[:, 0] > 2.9) & (np.abs(room.points[:, 1] - 2.0) < 0.9)
    shifted[thing] += [-0.3, 0.2, 0.0]
    seen = replace(room, points=shifted).keypoints(POSE, 0.3, 7)
    shown = landmarks.shown(landmarks.matched(seen), {"estimate": POSE})
    [moved] = shown.moved
    assert moved.shift_m == pytest.approx([-0.3, 0.2], abs=0.06)
    assert len(moved.places) >= 5
    assert (moved.places[:, 0] > 2.7).all()
