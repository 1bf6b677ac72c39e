"""Another localizer's particles in our views."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import rerun.blueprint as rrb
from typer.testing import CliRunner

from helpers import bags as making
from helpers.bags import BEGIN_NS, Ros, Said
from maurice_loaders.bags.localizer import RecordedLocalizer, RecordedUpdate
from maurice_loaders.bags.recording import BAGS
from maurice_loaders.errors import InputError, ReadingNotes
from maurice_loaders.formats.registry import guess
from maurice_loaders.reading import ReadingOptions
from maurice_mcl.map import open_arena
from maurice_viz.app.drive import AFTER_RESAMPLING, open_as_recorded, playback_as_recorded
from maurice_viz.app.open import RunSpec
from maurice_viz.app.output import OutputOptions, layout_of
from maurice_viz.app.replay import replay_any
from maurice_viz.cli.app import app
from maurice_viz.entities import Phase
from maurice_viz.style import scale_for
from maurice_viz.text import narration as narrate

ARENA = open_arena(np.array([[0.0, 0.0], [5.0, 4.0]]))


def updates(path: Path) -> list[RecordedUpdate]:
    localizer = RecordedLocalizer(path, BAGS[guess(path).name], ReadingOptions())
    return list(localizer.updates(ReadingNotes(keep_going=False)))


@pytest.fixture
def amcl(tmp_path: Path) -> Path:
    return making.write_ros1(tmp_path / "amcl.bag", making.amcl_drive(Ros(1), weighted=False))


@pytest.fixture
def nav2(tmp_path: Path) -> Path:
    return making.write_ros2(tmp_path / "nav2", making.amcl_drive(Ros(2)))


def test_each_cloud_is_an_update_with_its_pose(amcl: Path) -> None:
    found = updates(amcl)
    assert [len(update.poses) for update in found] == [200, 160, 120, 80]
    for number, update in enumerate(found):
        assert update.weights is None
        assert update.pose is not None
        np.testing.assert_allclose(update.pose.pose, [1 + 0.1 * number, 2, 0.5], atol=1e-9)
        np.testing.assert_allclose(update.pose.sd, [0.2, 0.3, 0.1], atol=1e-9)
        assert update.read is not None
        assert np.array_equal(update.read(), making.picture(number))
        assert update.truth is not None
        np.testing.assert_allclose(update.truth[:2], [1.005 + 0.1 * number, 2], atol=1e-6)
    np.testing.assert_allclose([u.motions[:, 0].sum() for u in found[1:]], 0.1, atol=1e-3)


def test_weights_are_kept(nav2: Path) -> None:
    recorded = open_as_recorded(nav2, ReadingOptions())
    records = [record for step in recorded.updates() for _, record in step.values()]
    want = [u.weights for u in updates(nav2)]
    for record, weights in zip(records, want, strict=True):
        assert weights is not None
        np.testing.assert_allclose(record.weighted.weights, weights / weights.sum(), atol=1e-12)


def test_the_first_update_says_what_weights_mean(nav2: Path) -> None:
    moments = [
        moment for step in open_as_recorded(nav2, ReadingOptions()).updates() for moment, _ in step.values()
    ]
    assert AFTER_RESAMPLING in moments[0].events
    assert not any(moment.events for moment in moments[1:])


def test_poses_in_the_maps_frame(amcl: Path) -> None:
    records = [r for step in open_as_recorded(amcl, ReadingOptions()).updates() for _, r in step.values()]
    for record, update in zip(records, updates(amcl), strict=True):
        np.testing.assert_allclose(record.weighted.world_poses, update.poses, atol=1e-5)
        assert update.pose is not None
        np.testing.assert_allclose(record.estimate.pose, update.pose.pose)


@pytest.mark.parametrize("weights", [0.0, float("nan"), -1.0])
def test_weights_that_make_no_sense_count_as_equal(weights: float, tmp_path: Path) -> None:
    ros = Ros(2)
    cloud = ros.particles(BEGIN_NS, np.zeros((3, 3)), np.full(3, weights))
    said = [Said("/particle_cloud", "nav2_msgs/ParticleCloud", BEGIN_NS, cloud)]
    recorded = open_as_recorded(making.write_ros2(tmp_path / "bag", said), ReadingOptions())
    ((_, record),) = (one for step in recorded.updates() for one in step.values())
    np.testing.assert_allclose(record.weighted.weights, 1 / 3)
    assert recorded.unweighted == 1


def test_a_far_pose_is_not_the_clouds(tmp_path: Path) -> None:
    ros = Ros(1)
    late_ns = BEGIN_NS + 2 * 10**9
    said = [
        Said(
            "/particlecloud", "geometry_msgs/PoseArray", BEGIN_NS, ros.pose_array(BEGIN_NS, np.zeros((4, 3)))
        ),
        Said(
            "/amcl_pose",
            "geometry_msgs/PoseWithCovarianceStamped",
            late_ns,
            ros.unsure(late_ns, (5.0, 5.0, 0.0)),
        ),
    ]
    (update,) = updates(making.write_ros1(tmp_path / "a.bag", said))
    assert update.pose is None


def test_bags_without_particles_are_refused(tmp_path: Path) -> None:
    path = making.write_ros1(tmp_path / "a.bag", making.drive(Ros(1)))
    with pytest.raises(InputError, match="found no cloud"):
        open_as_recorded(path, ReadingOptions())
    log = tmp_path / "session.log"
    log.write_text('{"format": "maurice-session-log", "version": 1, "kind": "session"}\n')
    with pytest.raises(InputError, match="expected one of rosbag1, rosbag2, mcap"):
        open_as_recorded(log, ReadingOptions())


@pytest.mark.parametrize("detail", ["full", "events", "light"])
def test_all_views_are_drawn(detail: str, nav2: Path, tmp_path: Path) -> None:
    file = tmp_path / "out.rrd"
    replay_any(nav2, None, RunSpec(), OutputOptions("out", file, detail=detail), as_recorded=True)
    assert file.stat().st_size > 10_000


@pytest.mark.parametrize("pictures", [True, False])
def test_no_view_is_of_what_a_bag_does_not_hold(pictures: bool, tmp_path: Path) -> None:
    """References, histograms and likelihoods are our own filter's; a robot may have no camera."""
    said = [one for one in making.amcl_drive(Ros(2)) if pictures or "camera" not in one.topic]
    path = making.write_ros2(tmp_path / "bag", said)
    playing = playback_as_recorded(open_as_recorded(path, ReadingOptions()))
    titles = _titles(layout_of(playing.views, playing.scene).root_container)
    assert ("Camera (px)" in titles) == pictures
    assert {"Cloud close up", "What this step did"} <= titles
    for word in (
        "Match",
        "reference",
        "histogram",
        "picture blue",
        "Likelihood",
        "Edges",
        "vidence",
        "urvivors",
    ):
        assert not any(word in title for title in titles)


def _titles(part: rrb.Container | rrb.View) -> set[str]:
    if isinstance(part, rrb.View):
        return {str(part.name)}
    return set().union(*(_titles(inner) for inner in part.contents))


def test_words_are_only_of_what_a_bag_holds(nav2: Path) -> None:
    scale = scale_for("m", ARENA)
    for step in open_as_recorded(nav2, ReadingOptions()).updates():
        for moment, record in step.values():
            said = [narrate.phase(moment, record, slot, scale) for slot in tuple(Phase)[:5]]
            said.append(narrate.summary(moment, record, scale))
            assert "The published cloud spreads over" in said[-1]
            for text in said:
                for wrong in (
                    "ot resampled",
                    "ot reseeded",
                    "was compared",
                    "Every particle",
                    "nan",
                    "not available",
                ):
                    assert wrong not in text


def test_without_odometry_nothing_is_said_of_how_the_robot_moved(tmp_path: Path) -> None:
    said = [one for one in making.amcl_drive(Ros(2)) if one.topic != "/odom"]
    path = making.write_ros2(tmp_path / "bag", said)
    for step in open_as_recorded(path, ReadingOptions()).updates():
        for moment, record in step.values():
            assert "The robot" not in narrate.summary(moment, record, scale_for("m", ARENA))


@pytest.mark.parametrize(
    ("more", "told"),
    [
        (["--follow"], "not a live source"),
        (["--layout", "explain"], "has the layouts overview and traces"),
        (["--particles", "10"], "runs no filter"),
    ],
)
def test_options_that_do_not_go_with_it(more: list[str], told: str, nav2: Path) -> None:
    result = CliRunner().invoke(app, ["replay", str(nav2), "--as-recorded", "--headless", *more])
    assert result.exit_code == 2
    assert told in " ".join(result.output.split())


@pytest.mark.parametrize("source", ["-", "tcp://127.0.0.1:1", "ws://127.0.0.1:1"])
def test_live_sources_are_refused(source: str) -> None:
    result = CliRunner().invoke(app, ["replay", source, "--as-recorded", "--headless"])
    assert result.exit_code == 2
    assert "not a live source" in " ".join(result.output.split())
