"""MCAP with ROS 2 messages, read back by an independent reader, and without the extra."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from maurice_loaders.bags.containers import open_mcap
from maurice_loaders.bags.localizer import RecordedLocalizer
from maurice_loaders.bags.messages import matrix_of
from maurice_loaders.bags.readers import HEADER, MOTIONS, READINGS
from maurice_loaders.errors import InputError, ReadingNotes
from maurice_loaders.export import mcap as export_mcap
from maurice_loaders.export.mcap import (
    CLOUD,
    IMAGE,
    ODOMETRY,
    ONCE,
    POSES,
    TF,
    TYPES,
    mcap_file,
    mcap_sink,
    scene_of,
)
from maurice_loaders.export.tables import export_steps
from maurice_loaders.files.pictures import decode_picture
from maurice_loaders.formats.registry import open_recording, open_session
from maurice_loaders.reading.options import Reading
from maurice_loaders.runs.store import open_runs
from maurice_mcl.values.session import Camera, SessionInfo

from ..conftest import Save

pytest.importorskip("rosbags")

from rosbags.highlevel import AnyReader

from maurice_loaders.export.ros_messages import Messages, message_types, pose_rows, spread_out

STORE = message_types()


def messages(file: Path) -> list[tuple[str, int, Any]]:
    """All messages by the bag's own type definitions."""
    with AnyReader([file]) as reader:
        found = reader.messages()
        return [(c.topic, t, reader.deserialize(raw, c.msgtype)) for c, t, raw in found]


def heading(turn: Any) -> float:
    assert (turn.x, turn.y) == (0, 0)
    return float(2 * np.arctan2(turn.z, turn.w))


def pose_of(pose: Any) -> list[float]:
    return [pose.position.x, pose.position.y, heading(pose.orientation)]


@pytest.fixture
def exported(
    save_run: Save, small_session: Path, tmp_path: Path
) -> tuple[list[Any], dict[str, list[tuple[int, Any]]]]:
    """What a run was, and what its MCAP holds, by topic."""
    folder, played = save_run()
    (run,) = open_runs(folder)
    info = open_session(small_session).info
    camera = Camera("eye", horizontal_fov_rad=0.8, yaw_rad=0.5, height_m=0.25)
    scene = scene_of(replace(info, arena=run.arena(), cameras=(camera,)))
    with mcap_sink(tmp_path / "run.mcap", np.array(run.manifest.origin_m), scene) as sink:
        for step, (moment, _) in zip(export_steps(run, begin_s=1e9), played, strict=True):
            sink.add(step, moment.frame.image)
    by_topic: dict[str, list[tuple[int, Any]]] = {}
    for topic, t_ns, message in messages(tmp_path / "run.mcap"):
        by_topic.setdefault(topic, []).append((t_ns, message))
    return played, by_topic


def test_every_update_has_every_message_map_and_camera_and_is_shown_as_it_was(
    exported, tmp_path: Path
) -> None:
    played, by_topic = exported
    counts = Counter({topic: len(found) for topic, found in by_topic.items() if topic != export_mcap.EVENTS})
    assert set(counts) == set(TYPES) - {export_mcap.EVENTS, READINGS, export_mcap.SCAN}  # it has none
    motions = sum(len(moment.frame.motions) for moment, _ in played)
    assert counts == {t: 1 if t in ONCE else motions if t == MOTIONS else len(played) for t in counts}
    texts = [message.data for _, message in by_topic.get(export_mcap.EVENTS, [])]
    assert texts == [text for moment, record in played for text in (*moment.events, *record.events)]
    first_ns = by_topic[ODOMETRY][0][0]
    assert {t_ns for topic in ONCE for t_ns, _ in by_topic[topic]} == {first_ns}
    path = by_topic[export_mcap.TRUE_PATH][0][1].poses
    assert [pose_of(one.pose) for one in path] == [
        pytest.approx(moment.truth.tolist()) for moment, _ in played
    ]
    grid = by_topic[export_mcap.GRID][0][1]
    assert len(grid.data) == grid.info.width * grid.info.height
    assert set(grid.data.tolist()) <= {0, 100}
    _, by_topic = exported
    (mount,) = by_topic[export_mcap.MOUNT][0][1].transforms
    assert (mount.header.frame_id, mount.child_frame_id) == ("base_link", "camera")
    along, right = (matrix_of(mount)[:3, k] for k in (2, 0))
    assert along == pytest.approx([np.cos(0.5), np.sin(0.5), 0])
    assert right == pytest.approx([np.sin(0.5), -np.cos(0.5), 0])
    assert mount.transform.translation.z == 0.25
    _, view = by_topic[export_mcap.CAMERA_INFO][0]
    assert (view.width, view.height) == (40, 30)
    assert 2 * np.arctan2(20, view.k[0]) == pytest.approx(0.8)
    played, _ = exported
    recorded = RecordedLocalizer(tmp_path / "run.mcap", open_mcap, Reading())
    updates = list(recorded.updates(ReadingNotes(keep_going=False)))
    for update, (moment, _) in zip(updates, played, strict=True):
        np.testing.assert_array_equal(update.motions, moment.frame.motions)


def test_poses_and_stamps_are_the_runs(exported) -> None:
    played, by_topic = exported
    for number, (moment, record) in enumerate(played):
        t_ns, estimate = by_topic[export_mcap.ESTIMATE][number]
        assert t_ns == round((1e9 + moment.frame.time_s) * 1e9)
        assert estimate.header.stamp.sec * 10**9 + estimate.header.stamp.nanosec == t_ns
        assert estimate.header.frame_id == "map"
        assert pose_of(estimate.pose) == pytest.approx(record.estimate.pose.tolist(), abs=1e-9)
        truth = by_topic[export_mcap.TRUTH][number][1]
        assert pose_of(truth.pose) == pytest.approx(moment.truth.tolist(), abs=1e-9)
        covered = by_topic[export_mcap.WITH_COVARIANCE][number][1].pose
        deviations = np.sqrt(covered.covariance[[0, 7, 35]])
        assert deviations == pytest.approx([*record.estimate.sd_m, record.estimate.heading_sd_rad])
        assert not np.delete(covered.covariance, [0, 7, 35]).any()


def test_a_header_without_sense_is_one_line_and_a_fisheye_has_no_pinhole(tmp_path: Path) -> None:
    for text in ("[" * 100_000, "[1", "3"):
        with mcap_file(tmp_path / "a.mcap", force=True) as mcap:
            mcap.write(HEADER, 0.0, mcap.at(0.0).text(text))
            mcap.write(export_mcap.TRUTH, 0.0, mcap.at(0.0).pose("map", np.zeros(3)))
        with pytest.raises(InputError, match=r"/session/header: .* is it damaged"):
            open_recording(tmp_path / "a.mcap")
    image = np.zeros((3, 4, 3), np.uint8)
    with mcap_file(tmp_path / "b.mcap") as mcap:
        scene_of(SessionInfo("a", cameras=(Camera("wide", horizontal_fov_rad=3.4),))).write_picture(
            mcap, 0.0, image, "png"
        )
    assert [topic for topic, *_ in messages(tmp_path / "b.mcap")] == [IMAGE]


def test_clouds_are_whole_and_pictures_are_jpeg_of_the_same_size(exported) -> None:
    played, by_topic = exported
    for number, (moment, record) in enumerate(played):
        cloud = by_topic[CLOUD][number][1].particles
        assert [p.weight for p in cloud] == pytest.approx(record.weighted.weights.tolist())
        assert [p.pose.position.x for p in cloud] == pytest.approx(record.weighted.world_poses[:, 0].tolist())
        found = np.array([pose_of(pose) for pose in by_topic[POSES][number][1].poses])
        assert found == pytest.approx(record.belief.world_poses, abs=1e-6)
        message = by_topic[IMAGE][number][1]
        assert message.format == "jpeg"
        decoded = decode_picture(message.data.tobytes())
        assert decoded.shape == moment.frame.image.shape
        assert np.abs(decoded.astype(int) - moment.frame.image).mean() < 4


def test_transforms_lead_from_the_map_over_odometry_to_the_estimate(exported) -> None:
    played, by_topic = exported
    for number, (_, record) in enumerate(played):
        correction, odometry = by_topic[TF][number][1].transforms
        links = [(link.header.frame_id, link.child_frame_id) for link in (correction, odometry)]
        assert links == [("map", "odom"), ("odom", "base_link")]
        x, y, turned = _planar(correction.transform)
        forward, left, turn = _planar(odometry.transform)
        assert pose_of(by_topic[ODOMETRY][number][1].pose.pose) == pytest.approx([forward, left, turn])
        cos, sin = np.cos(turned), np.sin(turned)
        found = [x + cos * forward - sin * left, y + sin * forward + cos * left]
        assert found == pytest.approx(record.estimate.pose[:2].tolist())
        assert np.cos(turned + turn - record.estimate.pose[2]) == pytest.approx(1)


def _planar(transform: Any) -> list[float]:
    return [transform.translation.x, transform.translation.y, heading(transform.rotation)]


@pytest.mark.parametrize("frame", ["m", "ma", "map", "mapp", "odom-odom"])
@pytest.mark.parametrize("count", [0, 1, 5])
def test_clouds_are_serialized_as_the_types_say_whatever_the_alignment(frame: str, count: int) -> None:
    rng = np.random.default_rng(count)
    poses, weights = rng.normal(size=(count, 3)), rng.random(count)
    make = Messages(STORE, 1_500_000_001)
    cloud = make.particle_cloud(frame, poses, weights)
    array = make.pose_array(frame, poses)
    for kind, data in (("geometry_msgs/msg/PoseArray", array), ("nav2_msgs/msg/ParticleCloud", cloud)):
        whole = STORE.deserialize_cdr(data, kind)
        assert whole.header.frame_id == frame
        assert bytes(STORE.serialize_cdr(whole, kind)) == data


def test_quaternions_and_covariances_stand_in_their_places() -> None:
    rows = pose_rows(np.array([[1.0, 2.0, 0.0], [3.0, 4.0, np.pi / 2], [5.0, 6.0, -np.pi]]))
    half = 0.5**0.5
    assert rows[:, 3:] == pytest.approx(
        np.array([[0, 0, 0, 1], [0, 0, half, half], [0, 0, -1, 0]]), abs=1e-12
    )
    full = spread_out(np.arange(1.0, 10).reshape(3, 3)).reshape(6, 6)
    assert full[[0, 0, 1, 5, 5], [0, 5, 1, 0, 5]].tolist() == [1, 3, 5, 7, 9]
    assert np.count_nonzero(full) == 9


def test_without_the_extra_one_line_says_how_to_get_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(export_mcap, "find_spec", lambda name: None)
    with pytest.raises(InputError) as caught, mcap_file(tmp_path / "a.mcap"):
        pytest.fail("was opened")
    assert "pip install 'maurice-replay[ros]'" in str(caught.value)


def test_impossible_times_other_endings_and_existing_files_are_refused(tmp_path: Path) -> None:
    for t_s in (-0.5, 2.0**31, float("nan")):
        with pytest.raises(InputError, match="picture_offset_s"), mcap_file(tmp_path / "a.mcap") as mcap:
            mcap.write(ODOMETRY, t_s, b"")
        assert not list(tmp_path.iterdir())
    (tmp_path / "a.mcap").write_bytes(b"mine")
    for name, said in (("a.bag", ".mcap"), ("a.mcap", "--force")):
        with pytest.raises(InputError, match=said), mcap_file(tmp_path / name):
            pytest.fail("was opened")
    assert (tmp_path / "a.mcap").read_bytes() == b"mine"
