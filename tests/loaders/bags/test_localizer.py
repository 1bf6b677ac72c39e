"""Another localizer's particles in our views, and occupancy grids as walls."""

from __future__ import annotations

import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import rerun.blueprint as rrb
from typer.testing import CliRunner

from helpers import bags as making
from helpers.bags import BEGIN_NS, Ros, Said
from maurice_loaders.bags.localizer import (
    STAND_INS,
    RecordedLocalizer,
    RecordedUpdate,
    stand_ins,
)
from maurice_loaders.bags.recording import BAGS
from maurice_loaders.errors import InputError, ReadingNotes
from maurice_loaders.files.maps import MOST_WALLS, arena_of_message
from maurice_loaders.formats.registry import guess, open_session
from maurice_loaders.reading.options import Reading
from maurice_mcl.filter.estimate import modes, share_within
from maurice_mcl.values.library import USUAL
from maurice_mcl.values.map import open_arena
from maurice_mcl.values.records import Belief, StepRecord, uniform_log_weights
from maurice_mcl.values.session import Moment
from maurice_viz.app.replay import replay
from maurice_viz.cli.app import app
from maurice_viz.panels.belief import ellipse_of
from maurice_viz.running.output import Output, layout_of
from maurice_viz.running.recorded import (
    AFTER_RESAMPLING,
    WITHOUT_CLOUD,
    open_recorded,
    playback_of_recorded,
    together,
)
from maurice_viz.style import scale_for
from maurice_viz.text import phases as narrate

ARENA = open_arena(np.array([[0.0, 0.0], [5.0, 4.0]]))


def updates(path: Path) -> list[RecordedUpdate]:
    localizer = RecordedLocalizer(path, BAGS[guess(path).name], Reading())
    return list(localizer.updates(ReadingNotes(keep_going=False)))


def updates_shown(path: Path) -> list[tuple[Moment, StepRecord]]:
    return [one for step in together(open_recorded(path, Reading())) for one in step.values()]


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


def test_weights_are_kept_and_the_first_update_says_what_they_mean(nav2: Path) -> None:
    shown = updates_shown(nav2)
    for (_, record), update in zip(shown, updates(nav2), strict=True):
        assert update.weights is not None
        want = update.weights / update.weights.sum()
        np.testing.assert_allclose(record.weighted.weights, want, atol=1e-12)
    assert [AFTER_RESAMPLING in moment.events for moment, _ in shown] == [True, False, False, False]
    assert not any(moment.events for moment, _ in shown[1:])


def test_poses_in_the_maps_frame(amcl: Path) -> None:
    for (_, record), update in zip(updates_shown(amcl), updates(amcl), strict=True):
        np.testing.assert_allclose(record.weighted.world_poses, update.poses, atol=1e-5)
        assert update.pose is not None
        np.testing.assert_allclose(record.estimate.pose, update.pose.pose)


@pytest.mark.parametrize("weights", [0.0, float("nan"), -1.0])
def test_weights_that_make_no_sense_count_as_equal(weights: float, tmp_path: Path) -> None:
    ros = Ros(2)
    cloud = ros.particles(BEGIN_NS, np.zeros((3, 3)), np.full(3, weights))
    said = [Said("/particle_cloud", "nav2_msgs/ParticleCloud", BEGIN_NS, cloud)]
    recorded = open_recorded(making.write_ros2(tmp_path / "bag", said), Reading())
    ((_, record),) = (pair for step in together(recorded) for pair in step.values())
    np.testing.assert_allclose(record.weighted.weights, 1 / 3)
    assert recorded[0].unweighted == 1


def test_a_far_pose_is_not_the_clouds(tmp_path: Path) -> None:
    ros, late_ns = Ros(1), BEGIN_NS + 2 * 10**9
    cloud, pose = ros.pose_array(BEGIN_NS, np.zeros((4, 3))), ros.unsure(late_ns, (5.0, 5.0, 0.0))
    said = [Said("/particlecloud", "geometry_msgs/PoseArray", BEGIN_NS, cloud)]
    said.append(Said("/amcl_pose", "geometry_msgs/PoseWithCovarianceStamped", late_ns, pose))
    (update,) = updates(making.write_ros1(tmp_path / "a.bag", said))
    assert update.pose is None


def test_poses_with_covariance_are_shown_without_a_cloud(tmp_path: Path) -> None:
    said = [one for one in making.amcl_drive(Ros(2)) if one.topic != "/particle_cloud"]
    path = making.write_ros2(tmp_path / "bag", said)
    shown = updates_shown(path)
    assert len(shown) == 4
    assert WITHOUT_CLOUD in shown[0][0].events
    for number, (_, record) in enumerate(shown):
        np.testing.assert_allclose(record.estimate.pose, [1.0 + 0.1 * number, 2.0, 0.5], atol=1e-6)
        assert record.estimate.sd_m == pytest.approx((0.2, 0.3))
        np.testing.assert_allclose(record.mean_estimate.sd_m, (0.2, 0.3), rtol=1e-5)
        ellipse = ellipse_of(record.weighted, scale_for("m", ARENA))
        np.testing.assert_allclose(np.ptp(ellipse, axis=0), (0.8, 1.2), rtol=1e-3)
    file = tmp_path / "out.rrd"
    replay(path, to=file, as_recorded=True)
    assert file.stat().st_size > 10_000


@pytest.mark.parametrize("unstamped", [False, True])
@pytest.mark.parametrize("weighted", [False, True])
def test_poses_that_somebody_gave_are_events_of_their_steps(
    weighted: bool, unstamped: bool, tmp_path: Path
) -> None:
    ros = Ros(2)
    said = making.amcl_drive(ros, weighted=weighted)
    for after_ms in (0, 350):
        t_ns = BEGIN_NS + after_ms * 10**6
        pose = ros.unsure(0 if unstamped else t_ns, (1.0, 2.0, 0.5))
        said.append(Said("/initialpose", "geometry_msgs/PoseWithCovarianceStamped", t_ns, pose))
    bag = making.write_ros2(tmp_path / "b", sorted(said, key=lambda one: one.log_ns))
    told = ("given a pose: 1.00, 2.00 m, 29 deg (/initialpose)",)
    assert [moment.told("given") for moment, _ in updates_shown(bag)] == [told, (), told, ()]
    assert len(updates(bag)) == 4


def test_several_localizers_are_shown_against_the_truth(tmp_path: Path) -> None:
    ros = Ros(2)
    said = making.amcl_drive(ros)
    for k in range(8):
        t_ns = BEGIN_NS + k * 10**8 + 3 * 10**6
        aside = ros.pose_stamped(t_ns, [1.3 + 0.05 * k, 2.0, 0.5])
        said.append(Said("/orb_slam/pose", "geometry_msgs/PoseStamped", t_ns, aside))
    path = making.write_ros2(tmp_path / "bag", sorted(said, key=lambda one: one.log_ns))
    asked = Reading(localizer_topic="/amcl_pose, /orb_slam/pose,/particle_cloud")
    file = tmp_path / "out.rrd"
    scores = replay(path, to=file, reading=asked, as_recorded=True)
    assert [run.label for run in scores.runs] == ["amcl_pose", "orb_slam-pose", "particle_cloud"]
    assert [run.score.updates for run in scores.runs] == [4, 4, 4]
    off = [run.score.error_mean_m for run in scores.runs]
    assert off == pytest.approx([0.0, 0.3, 0.0], abs=0.01)
    [first, *_] = together(open_recorded(path, asked))
    assert {record.frame.step for _, record in first.values()} == {1}
    with pytest.raises(InputError, match="expected one to 4 topics"):
        open_recorded(path, Reading(localizer_topic="/amcl_pose,/amcl_pose"))
    with pytest.raises(InputError, match="found no topic /nowhere"):
        open_recorded(path, Reading(localizer_topic="/amcl_pose,/nowhere"))


def test_stand_ins_have_the_covariance() -> None:
    turned = np.array([[2.0, 0.6, 0.1], [0.6, 1.0, 0.2], [0.1, 0.2, 0.3]])
    points = stand_ins(np.array([1.0, 2.0, 3.0]), turned)
    np.testing.assert_allclose(points.mean(axis=0), [1, 2, 3])
    np.testing.assert_allclose(np.cov(points.T, bias=True), turned, atol=1e-12)
    assert (stand_ins(np.ones(3), np.full((3, 3), np.nan)) == 1).all()


@pytest.mark.parametrize("sd_m", [0.1, 0.3, 0.6])
def test_a_pose_without_a_cloud_has_the_shares_of_its_covariance(sd_m: float) -> None:
    """Shares within a radius are those of the normal distribution; the heaviest mode is at its mean."""
    belief = Belief(
        stand_ins(np.zeros(3), np.diag([sd_m**2, sd_m**2, 0.01])).astype(np.float32),
        uniform_log_weights(STAND_INS),
        np.zeros(2),
    )
    for radius_m in (0.3, 0.46, 0.61):
        share = 1 - np.exp(-(radius_m**2) / (2 * sd_m**2))
        margin = 4 * np.sqrt(share * (1 - share) / STAND_INS)
        assert share_within(belief, np.zeros(3), radius_m) == pytest.approx(share, abs=margin)
    np.testing.assert_allclose(modes(belief, USUAL)[0].pose[:2], 0, atol=0.3)


@pytest.mark.parametrize("camera", ["none", "slow"])
@pytest.mark.parametrize("cloud", [True, False])
def test_a_localizer_is_not_lost_by_a_camera_that_it_does_not_use(
    camera: str, cloud: bool, tmp_path: Path
) -> None:
    """Without pictures, or with one picture for many clouds, no verdict speaks of a camera."""
    left_out = {"/ground_truth"} if cloud else {"/ground_truth", "/particle_cloud"}
    said = [one for one in making.amcl_drive(Ros(2), 12) if one.topic not in left_out]
    pictures = [one for one in said if "camera" in one.topic]
    kept = pictures[:1] if camera == "slow" else []
    path = making.write_ros2(tmp_path / "bag", [one for one in said if one not in pictures or one in kept])
    [run] = replay(path, as_recorded=True).runs
    assert run.score.updates == 12
    assert run.verdict.failures == ()
    assert not run.verdict.incidents


def test_bags_without_particles_are_refused(tmp_path: Path) -> None:
    path = making.write_ros1(tmp_path / "a.bag", making.drive(Ros(1)))
    with pytest.raises(InputError, match="found no cloud"):
        open_recorded(path, Reading())
    log = tmp_path / "session.log"
    log.write_text('{"format": "maurice-session-log", "version": 1, "kind": "session"}\n')
    with pytest.raises(InputError, match="expected one of rosbag1, rosbag2, mcap"):
        open_recorded(log, Reading())


@pytest.mark.parametrize("detail", ["full", "events", "light"])
def test_all_views_are_drawn(detail: str, nav2: Path, tmp_path: Path) -> None:
    file = tmp_path / "out.rrd"
    replay(nav2, output=Output(detail=detail, to=file), as_recorded=True)
    assert file.stat().st_size > 10_000


@pytest.mark.parametrize("pictures", [True, False])
def test_no_view_is_of_what_a_bag_does_not_hold(pictures: bool, tmp_path: Path) -> None:
    """References, histograms and likelihoods are our own filter's; a robot may have no camera."""
    said = [one for one in making.amcl_drive(Ros(2)) if pictures or "camera" not in one.topic]
    path = making.write_ros2(tmp_path / "bag", said)
    playing = playback_of_recorded(open_recorded(path, Reading()))
    titles = _titles(layout_of(playing.views, playing.scene).root_container)
    assert ("The robot sees" in titles) == pictures
    assert {"Cloud close up", "What this step did"} <= titles
    ours = re.compile("Match|reference|histogram|picture blue|Likelihood|Edges|vidence|urvivors")
    assert not any(ours.search(title) for title in titles)


def _titles(part: rrb.Container | rrb.View) -> set[str]:
    if isinstance(part, rrb.View):
        return {str(part.name)}
    return set().union(*(_titles(inner) for inner in part.contents))


def test_words_are_only_of_what_a_bag_holds(nav2: Path, tmp_path: Path) -> None:
    scale = scale_for("m", ARENA)
    for moment, record in updates_shown(nav2):
        said = narrate.summary(moment, record, scale)
        assert "The published cloud spreads over" in said
        assert not re.search("ot resampled|ot reseeded|was compared|Every particle|nan|not available", said)
    without_odometry = [one for one in making.amcl_drive(Ros(2)) if one.topic != "/odom"]
    for moment, record in updates_shown(making.write_ros2(tmp_path / "bag", without_odometry)):
        assert "The robot" not in narrate.summary(moment, record, scale)


@pytest.mark.parametrize(
    ("source", "more", "told"),
    [
        ("", ["--follow"], "not a live source"),
        ("", ["--layout", "explain"], "has the layouts overview and traces"),
        ("", ["--particles", "10"], "runs no filter"),
        *((live, [], "not a live source") for live in ("-", "tcp://127.0.0.1:1", "ws://127.0.0.1:1")),
    ],
)
def test_options_and_sources_that_do_not_go_with_it(
    source: str, more: list[str], told: str, nav2: Path
) -> None:
    result = CliRunner().invoke(app, ["replay", source or str(nav2), "--as-recorded", "-o", "auto", *more])
    assert result.exit_code == 2
    assert told in " ".join(result.output.split())


@pytest.mark.parametrize(
    ("topic", "is_estimate"), [("/amcl_pose", True), ("/ground_truth", False), ("/odom", False)]
)
def test_a_truth_that_is_a_localizer_s_estimate_is_called_so(
    topic: str, is_estimate: bool, nav2: Path
) -> None:
    session = open_session(nav2, truth_topic=topic)
    list(session.moments())
    for text in (*session.info.notes, *session.warnings):
        assert ("own estimate, not the truth" in text) == (is_estimate and text.startswith(topic))
    told = " ".join(session.warnings)
    assert (f"{topic} is a localizer's own estimate, not the truth" in told) == is_estimate
    assert session.info.name == (f"nav2 (truth: the estimate of {topic})" if is_estimate else "nav2")


def grid(
    cells: np.ndarray, side_m: float = 0.5, at: tuple[float, float, float] = (0, 0, 0)
) -> SimpleNamespace:
    q = SimpleNamespace(x=0.0, y=0.0, z=np.sin(at[2] / 2), w=np.cos(at[2] / 2))
    origin = SimpleNamespace(position=SimpleNamespace(x=at[0], y=at[1], z=0.0), orientation=q)
    info = SimpleNamespace(width=cells.shape[1], height=cells.shape[0], resolution=side_m, origin=origin)
    return SimpleNamespace(info=info, data=cells.reshape(-1).astype(np.int8))


def test_one_cell_has_four_walls() -> None:
    cells = np.zeros((4, 6), int)
    cells[1, 2] = 100
    cells[3, 3] = -1  # unknown is no wall
    arena = arena_of_message(grid(cells, at=(10.0, 20.0, 0.0)))
    assert arena.bounds == (10.0, 20.0, 13.0, 22.0)
    walls = {tuple(wall) for wall in arena.walls.tolist()}
    assert walls == {
        (11.0, 20.5, 11.5, 20.5),
        (11.0, 21.0, 11.5, 21.0),
        (11.0, 20.5, 11.0, 21.0),
        (11.5, 20.5, 11.5, 21.0),
    }


def test_long_turned_and_fine_maps() -> None:
    cells = np.zeros((3, 9), int)
    cells[1] = 100
    assert len(arena_of_message(grid(cells)).walls) == 4
    arena = arena_of_message(grid(np.full((2, 4), 100), at=(0.0, 0.0, np.pi / 2)))
    np.testing.assert_allclose(arena.bounds, (-1.0, 0.0, 0.0, 2.0), atol=1e-12)
    cells = np.indices((300, 300)).sum(axis=0) % 2 * 100
    arena = arena_of_message(grid(cells, side_m=0.1))
    assert len(arena.walls) <= MOST_WALLS
    np.testing.assert_allclose(arena.bounds, (0, 0, 30, 30))


@pytest.mark.parametrize(
    "change", [{"width": 3}, {"resolution": 0.0}, {"resolution": float("nan")}, {"height": 0}]
)
def test_maps_that_cannot_be(change: dict[str, float]) -> None:
    wrong = grid(np.zeros((4, 6), int))
    vars(wrong.info).update(change)
    with pytest.raises(ValueError, match="found"):
        arena_of_message(wrong)
