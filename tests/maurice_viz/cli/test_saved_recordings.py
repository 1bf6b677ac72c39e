"""`--save-run` of recordings that are no session logs: what is saved is shown and verified as it was read."""

from __future__ import annotations

import json
import shutil
from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace

import cv2
import pytest

from helpers import format_samples
from helpers.commands import failure, maurice
from maurice_loaders.errors import FieldError, InputError
from maurice_loaders.formats.registry import open_session
from maurice_loaders.reading.options import Reading, reading_from_json, reading_to_json
from maurice_loaders.runs.manifest import read_manifest, source_hash
from maurice_mcl.values.geometry import compose
from maurice_viz.app import compare as side_by_side

COMMON = ("-o", "none", "--json", "--particles", 100, "--start", "global")


def views(session: Path, folder: Path) -> tuple[Path, Path]:
    """Write a drive's pictures to a folder, and a table with odd names beside it."""
    folder.mkdir()
    rows, pose = ["ms;px;py;yaw"], None
    for number, moment in enumerate(open_session(session).moments()):
        cv2.imwrite(str(folder / f"v{number}.png"), moment.frame.image[..., ::-1])
        for motion in moment.frame.motions:
            pose = motion * 0 if pose is None else compose(pose, motion)
        rows.append(f"{500 * number};{pose[0]};{pose[1]};{pose[2]}")
    table = folder.with_name("beside.csv")
    table.write_text("\n".join(rows))
    return folder, table


def kept_and_shown(run: Path, recording: Path, survey: Path, options: Sequence[object]) -> None:
    """Save a run, and have it shown, verified and drawn again."""
    saved, _ = maurice(recording, "--library", survey, *COMMON, *options, "--save-run", run)
    assert json.loads(saved)["runs"][0]["updates"] > 0
    shown, said = maurice(run, "-o", "none", "--json")
    assert shown == saved
    assert "stay empty" not in said
    assert "to the last bit" in maurice("verify", run)[0]


@pytest.mark.parametrize("name", ["tum", "rosbag1", "rosbag2", "euroc", "cmucam"])
def test_a_run_of_a_recording_is_shown_and_verified(name, small_session, tmp_path):
    recording = format_samples.sample(name, tmp_path / "made")
    kept_and_shown(
        tmp_path / "kept", recording, small_session.with_name("survey.log"), ("--reading", "max_dt_s=0.2")
    )
    manifest = read_manifest(tmp_path / "kept")
    assert (manifest.reading.format, manifest.reading.max_dt_s) == (name, 0.2)


def test_a_run_of_pictures_with_a_table_holds_columns_units_and_gating(small_session, tmp_path):
    folder, table = views(small_session, tmp_path / "views")
    columns = "time=ms:ms,odometry_x=px,odometry_y=py,odometry_heading=yaw:rad"
    options = f"--reading table={table} --reading columns={columns} --reading min_distance_m=0.2".split()
    survey = small_session.with_name("survey.log")
    kept_and_shown(tmp_path / "kept", folder, survey, options)
    assert read_manifest(tmp_path / "kept").pictures == 7
    for command in (("explain",), ("inspect",), ("export", "-o", tmp_path / "path.tum")):
        maurice(command[0], tmp_path / "kept", *command[1:])
    table.write_text(table.read_text().replace("0.12", "0.13"))
    assert "beside.csv: the table was changed after the run was made" in failure("verify", tmp_path / "kept")


def test_a_run_inside_the_recordings_folder_leaves_it_as_it_was(small_session, tmp_path):
    recording = format_samples.sample("tum", tmp_path / "made")
    survey = small_session.with_name("survey.log")
    kept_and_shown(recording / "kept", recording, survey, ())
    (recording / "odometry.txt").write_text((recording / "odometry.txt").read_text() + "\n# more")
    assert "the session was changed" in failure("verify", recording / "kept")


def test_poses_beside_a_kitti_sequence_belong_to_it(small_session, tmp_path):
    (tmp_path / "made").mkdir()
    recording = format_samples.sample("kitti", tmp_path / "made")
    (poses,) = tmp_path.rglob("poses/*.txt")
    assert not poses.is_relative_to(recording)
    survey = small_session.with_name("survey.log")
    kept_and_shown(tmp_path / "kept", recording, survey, ("--reading", "odometry_from_truth=true"))
    poses.write_text(poses.read_text() + "\n")
    assert "the session was changed" in failure("verify", tmp_path / "kept")


def test_recording_and_run_may_be_moved_together(small_session, tmp_path):
    (tmp_path / "a").mkdir()
    recording = format_samples.sample("tum", tmp_path / "a" / "made")
    for name in ("survey.log", "pictures"):
        shutil.move(small_session.with_name(name), tmp_path / "a" / name)
    kept_and_shown(tmp_path / "a" / "kept", recording, tmp_path / "a" / "survey.log", ())
    (tmp_path / "a").rename(tmp_path / "b")
    assert "to the last bit" in maurice("verify", tmp_path / "b" / "kept")[0]


def test_another_camera_of_a_session_log_is_saved(small_session, tmp_path):
    """Pictures that name no camera are everybody's."""
    kept_and_shown(
        tmp_path / "kept", small_session, small_session.with_name("survey.log"), ("--reading", "camera=left")
    )
    assert read_manifest(tmp_path / "kept").reading.camera == "left"


def test_manifests_of_other_versions_are_refused(small_session, tmp_path):
    maurice(small_session, *COMMON, "--save-run", tmp_path / "kept")
    file = tmp_path / "kept" / "manifest.json"
    found = json.loads(file.read_text())
    assert found["version"] == 2
    for version in (1, 3):
        file.write_text(json.dumps(found | {"version": version}))
        with pytest.raises(InputError, match=f"found version {version} .*replay the session again"):
            read_manifest(tmp_path / "kept")


def test_options_of_reading_are_kept_and_strange_ones_refused():
    options = Reading(
        "table", "left", columns={"x": "px:mm"}, time_unit="ms", min_angle_rad=0.25, odometry_seed=7
    )
    assert reading_from_json(json.loads(json.dumps(reading_to_json(options)))) == options
    for bad in (
        {"speed": 1},
        {"format": 3},
        {"columns": {"x": 3}},
        {"max_dt_s": "a"},
        {"odometry_seed": 0.5},
        [],
    ):
        with pytest.raises(FieldError):
            reading_from_json(bad)
    with pytest.raises(FieldError, match="expected one of s, ms, us, ns"):
        reading_from_json({"time_unit": "days"})


def test_the_hash_of_a_folder_sees_tables_and_pictures_and_nothing_else(tmp_path):
    (tmp_path / "rgb").mkdir()
    (tmp_path / "rgb.txt").write_text("1 a.png")
    (tmp_path / "rgb" / "a.png").write_bytes(b"123")
    before = source_hash(tmp_path)
    (tmp_path / "out.rrd").write_bytes(b"drawn")
    (tmp_path / ".hidden.txt").write_text("x")
    assert source_hash(tmp_path) == before
    (tmp_path / "rgb" / "a.png").write_bytes(b"1234")
    assert (other := source_hash(tmp_path)) != before
    (tmp_path / "rgb.txt").write_text("2 a.png")
    assert source_hash(tmp_path) not in (before, other)


def test_a_session_read_with_another_table_is_another_drive():
    def drive(table: str | None, reading: Reading) -> str:
        source = None if table is None else SimpleNamespace(sha256=table)
        manifest = SimpleNamespace(session=SimpleNamespace(sha256="s"), reading=reading, table=source)
        return side_by_side._drive(SimpleNamespace(runs=[SimpleNamespace(manifest=manifest)]))  # type: ignore[arg-type]  # all that is looked at

    usual = Reading()
    assert drive("a", usual) == drive("a", usual)
    others = (drive("b", usual), drive(None, usual), drive("a", Reading("tum")))
    assert len({drive("a", usual), *others}) == 4
