"""Another localizer's run of a robot with a laser: saved as it is, and what commands say of it."""

from __future__ import annotations

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import maurice_viz as mv
from helpers import bags as making
from helpers.bags import Ros
from helpers.commands import run
from maurice_datasets.sessions import write_simulation
from maurice_datasets.simulation import SimulationPlan
from maurice_datasets.tasks import TASKS
from maurice_loaders.errors import InputError
from maurice_loaders.files.ros_maps import write_ros_map
from maurice_loaders.reading.options import Reading
from maurice_loaders.runs.store import open_run
from maurice_loaders.runs.writer import rows_of
from maurice_mcl.reasons.diagnosis import DiagnosisBuilder
from maurice_mcl.values import OccupancyMap
from maurice_mcl.values.library import Radii
from maurice_viz.app.check.check import check
from maurice_viz.app.convert import export
from maurice_viz.app.diagnose import diagnose, draw
from maurice_viz.app.explain import explain
from maurice_viz.app.inspect import events
from maurice_viz.app.replay import replay
from maurice_viz.errors import OptionError
from maurice_viz.reports.make import report
from maurice_viz.running.recorded import open_recorded, together
from maurice_viz.running.saved import open_saved
from maurice_viz.running.verify import verify
from maurice_viz.style import Scale, units_named
from maurice_viz.text.side_by_side import step_words

CAMERA = re.compile(r"\b(camera|picture|image|reference|library|channel)", re.I)


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return making.write_ros2(tmp_path_factory.mktemp("bag") / "amcl", making.laser_amcl_drive(Ros(2)))


@pytest.fixture(scope="module")
def saved(bag: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("runs") / "run"
    replay(bag, as_recorded=True, save_run=folder)
    return folder


def test_frames_carry_the_scan_that_the_pose_is_of(bag: Path) -> None:
    (recorded,) = open_recorded(bag, Reading())
    frames = [moment.frame for step in together([recorded]) for moment, _ in step.values()]
    assert len(frames) == 24
    for number, frame in enumerate(frames):
        assert frame.scan is not None
        np.testing.assert_allclose(frame.scan.ranges_m, 1.0 + 0.1 * number, rtol=1e-6)
        np.testing.assert_allclose(frame.scan.mount, making.LASER_AT)
    assert recorded.overview.arena.occupancy is not None
    assert recorded.overview.arena.occupancy.cells.shape == (80, 120)
    assert recorded.overview.arena.bounds == pytest.approx((0, 0, 12, 8))


def test_a_saved_run_comes_back_step_by_step(bag: Path, saved: Path) -> None:
    again = open_saved(saved)
    shown = [step["particle_cloud"] for step in together(open_recorded(bag, Reading()))]
    for (moment, records), (_, record), rows in zip(
        again.updates(), shown, open_run(saved).steps(), strict=True
    ):
        restored = records["particle_cloud"]
        np.testing.assert_array_equal(restored.weighted.poses, record.weighted.poses)
        np.testing.assert_array_equal(restored.estimate.pose, record.estimate.pose)
        np.testing.assert_array_equal(restored.belief.poses, record.belief.poses)  # no lines between clouds
        assert moment.frame.scan is not None
        assert rows_of(moment, restored).step["picture_sha256"] == rows.step["picture_sha256"]
    assert not again.scene.has_pictures
    assert again.scene.library.occupancy is not None
    scores = replay(saved)
    assert scores.runs[0].score == replay(bag, as_recorded=True).runs[0].score


@pytest.mark.parametrize("kind", ["ROS 1", "no truth", "only poses"])
def test_other_bags_are_saved_as_well(kind: str, tmp_path: Path) -> None:
    drive = making.laser_amcl_drive(
        Ros(1 if kind == "ROS 1" else 2), weighted=kind != "ROS 1", truth=kind != "no truth"
    )
    if kind == "only poses":
        drive = [one for one in drive if "particle" not in one.topic]
    write = making.write_ros1 if kind == "ROS 1" else making.write_ros2
    bag = write(tmp_path / "drive.bag", drive)
    replay(bag, as_recorded=True, save_run=tmp_path / "run")
    verdict = diagnose(tmp_path / "run").text
    assert ("was carried" in verdict) == (kind != "no truth")
    assert not CAMERA.search(verdict.replace(str(tmp_path), ""))


def test_particles_and_scans_at_the_true_place_are_known(bag: Path) -> None:
    (recorded,) = open_recorded(bag, Reading())
    builder = DiagnosisBuilder(occupancy=recorded.overview.arena.occupancy)
    for step in together([recorded]):
        builder.add(*step["particle_cloud"])
    (story,) = builder.stories()
    shares = [update.share_near for update in story.updates]
    assert min(shares[:12]) > 0.9
    assert max(shares[12:]) == 0
    assert all(update.scan is not None for update in story.updates[:-1])  # no truth follows the last


def test_beside_each_other_nothing_is_said_of_what_weighed_their_particles(bag: Path) -> None:
    both = Reading(localizer_topic="/amcl_pose,/particle_cloud")
    for steps in together(open_recorded(bag, both)):
        text = step_words(steps, Scale(units_named("m")), Radii())
        assert "amcl_pose" in text
        assert "dots within" not in text
        assert not CAMERA.search(text)


def test_nothing_speaks_of_cameras(saved: Path, tmp_path: Path) -> None:
    texts = [event.text for run in events(saved, routine=True).runs for event in run.events]
    found = diagnose(saved)
    texts.append(found.text)
    assert "carried" in found.text
    assert "maurice-replay explain" not in found.text  # which would be refused
    with pytest.raises(InputError, match=r"another localizer's run.*no step is explained"):
        explain(saved, 3)
    with pytest.raises(InputError, match=r"another localizer's run.*cannot be run again"):
        verify(saved)
    page = report(saved, to=tmp_path / "page.html").read_text()
    body = re.sub(r"<(script|style|svg)\b.*?</\1>", "", page, flags=re.DOTALL)
    body = re.sub(r"<[^>]+>", " ", body).split("Session notes")[0]
    assert "camera" not in body
    assert "picture is not available" not in body
    assert "the settings that it ran with are not in the recording" in body
    for text in texts:
        assert not CAMERA.search(text), text


def test_demands_apply_and_nothing_else(saved: Path, tmp_path: Path) -> None:
    result = check(saved, demands=mv.Demands(max_error_m=0.5, localized_by=10), to=tmp_path / "why")
    (drive,) = result.drives
    assert not result.passed
    assert drive.failure is not None
    assert drive.failure.step == 13
    assert "carried" in (tmp_path / "why" / "amcl" / "diagnosis.txt").read_text()
    assert check(saved, demands=mv.Demands(converged_by=10)).passed
    assert not any("seeds" in doubt for doubt in drive.doubts)
    with pytest.raises(OptionError, match="only demands apply"):
        check(saved, filter=mv.Filter(particles=10), demands=mv.Demands(max_error_m=0.5))


def test_other_programs_get_its_poses_without_gray_pictures(saved: Path, tmp_path: Path) -> None:
    files = [tmp_path / "run.tum", tmp_path / "run.csv", tmp_path / "run.mcap"]
    assert export(saved, files).updates == 24
    first = float((tmp_path / "run.tum").read_text().split()[0])
    assert first == pytest.approx(making.BEGIN_NS / 1e9 + 0.02, abs=1e-3)
    assert b"CompressedImage" not in (tmp_path / "run.mcap").read_bytes()


def test_without_its_bag_a_run_is_still_there(bag: Path, tmp_path: Path) -> None:
    copy = Path(shutil.copytree(bag, tmp_path / "copy"))
    replay(copy, as_recorded=True, save_run=tmp_path / "run")
    shutil.rmtree(copy)
    opened = open_saved(tmp_path / "run")
    assert opened.session is None
    assert len(list(opened.updates())) == 24
    assert len(opened.scene.arena.walls)


@pytest.mark.slow
def test_failures_are_drawn(saved: Path, tmp_path: Path) -> None:
    pictures = draw(diagnose(saved), tmp_path / "drawn")
    assert [picture.suffix for picture in pictures] == [".png"]


def test_what_amcl_itself_did_without_truth_is_suspected_by_its_scans(tmp_path):
    """A run that was carried off, published as AMCL would, and recorded without any true pose."""
    plan = SimulationPlan(TASKS["kidnapped"], world="office", arena_seed=0, seed=1, updates=40, laser=True)
    written = write_simulation(tmp_path / "s", plan)
    lines = written.session.read_text(encoding="utf-8").splitlines()
    records = [json.loads(line) for line in lines]
    hidden = [r for r in records if "truth" not in r and "kidnapped" not in str(r.get("event", ""))]
    written.session.write_text("\n".join(map(json.dumps, hidden)) + "\n", encoding="utf-8")
    settings = ("--set", "recovery.strategy=none", "--particles", "300")
    run("replay", written.session, *settings, "-o", "none", "--save-run", tmp_path / "own")
    run("export", tmp_path / "own", "-o", tmp_path / "amcl.mcap")
    run("replay", tmp_path / "amcl.mcap", "--as-recorded", "-o", "none", "--save-run", tmp_path / "recorded")
    said = run("diagnose", tmp_path / "recorded").stdout
    words = " ".join(said.split())
    assert "of the beams disagree with the map at the estimate; the cause is not known" in words
    assert "carried away" not in words
    assert "picture" not in words


def test_a_map_beside_a_bag_without_one_is_drawn_and_kept(bag: Path, tmp_path: Path) -> None:
    """It is the map of the run, as one in the bag would be, also of the saved run."""
    without = [said for said in making.laser_amcl_drive(Ros(2)) if said.topic != "/map"]
    drive = making.write_ros2(tmp_path / "drive", without)
    map_file, kept = tmp_path / "map.yaml", tmp_path / "kept"
    write_ros_map(OccupancyMap(np.array([[1, 0], [0, 1]], np.uint8), 2.5, np.array([-3.0, 4.0])), map_file)
    run(drive, "--as-recorded", "--map", map_file, "-o", "none", "--save-run", kept)
    for arena in (open_run(kept).arena(), open_saved(kept).scene.library.arena):
        assert arena.bounds == pytest.approx((-3, 4, 2, 9))
        assert arena.occupancy is None or arena.occupancy.cells.tolist() == [[1, 0], [0, 1]]
    assert open_saved(kept).scene.library.occupancy is not None
    refused = run(drive, "--as-recorded", "--map", tmp_path / "none.yaml", "-o", "none", expect=1)
    assert "none.yaml" in refused.stderr


def test_of_amcls_parameters_for_several_robots_those_of_the_recordings_are_used(tmp_path: Path) -> None:
    def of_second(said: making.Said) -> making.Said:
        return said if said.topic == "/tf_static" else replace(said, topic=f"/r2{said.topic}")

    drive = making.write_ros2(tmp_path / "bag", [*map(of_second, making.laser_amcl_drive(Ros(2)))])
    map_file, file = tmp_path / "map.yaml", tmp_path / "nav2.yaml"
    cells = np.zeros((80, 120), np.uint8)
    cells[[0, -1]] = 1
    write_ros_map(OccupancyMap(cells, 0.1, np.zeros(2)), map_file)
    nodes = [
        f"/r{k}/amcl:\n ros__parameters: {{alpha1: 0.1, max_beams: 60, max_particles: 60{k}}}" for k in (1, 2)
    ]
    file.write_text("\n".join(nodes))
    kept = tmp_path / "kept"
    args = ["--map", map_file, "--amcl", file, "--start", "truth", "--set", "resampling.kld.least=500"]
    said = run(drive, *args, "-o", "none", "--save-run", kept).stderr
    assert "/r2/amcl is used, as the recording is of r2" in said
    assert open_run(kept).configuration.parameters.particles == 602
