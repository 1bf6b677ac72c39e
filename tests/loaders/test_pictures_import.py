"""A folder of pictures and a table become two logs that stand alone and say what they are."""

from __future__ import annotations

import itertools
import math
import os
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from helpers.dialect_files import moving
from maurice_loaders.doctor.inspection import inspect_file
from maurice_loaders.errors import InputError
from maurice_loaders.files.pictures import encode_jpeg
from maurice_loaders.formats.registry import open_session
from maurice_loaders.importing import (
    import_pictures,
    nearest_m,
    split_rows,
    spread,
)
from maurice_loaders.libraries.landmarks import with_landmarks
from maurice_loaders.libraries.store import build_library
from maurice_loaders.reading.options import Reading
from maurice_loaders.session_log.reader import SurveyLog
from maurice_loaders.session_log.records import read_header
from maurice_mcl.sensor.landmarks.sensor import Landmarks
from maurice_mcl.values.arrays import F64
from maurice_mcl.values.geometry import angle_between, compose

POSES = [(0.3 * k, 0.1 * k, 45 * (k % 3)) for k in range(24) for _ in range(2 + k % 2)]
EVERY = 4


@pytest.fixture
def source(tmp_path: Path) -> Path:
    """Two dozen places along a line, two or three pictures each, every picture of another shade."""
    folder = tmp_path / "Büro"
    (folder / "images").mkdir(parents=True)
    lines = ["image,x_m,y_m,heading_deg"]
    for number, (x, y, heading) in enumerate(POSES):
        name = f"images/x{x:.1f}y{y:.1f}_{number}.JPG"
        shade = np.full((6, 8, 3), 4 * number, np.uint8)
        (folder / name).write_bytes(encode_jpeg(shade))
        lines.append(f"{name},{x},{y},{heading}")
    (folder / "poses.csv").write_text("\n".join(lines) + "\n")
    return folder


def test_logs_stand_alone(source: Path, tmp_path: Path) -> None:
    summary = import_pictures(source, source / "poses.csv", tmp_path / "out", every=EVERY)
    shutil.rmtree(source)
    session, library = open_session(summary.session), build_library(summary.survey)
    moments = list(session.moments())
    assert (len(moments), library.size) == (summary.session_pictures, summary.library_pictures) == (12, 7)
    assert (summary.rows, summary.runs, summary.session_runs, summary.guarded_runs) == (60, 24, 6, 11)
    assert session.info.survey == summary.survey.resolve()
    assert session.info.name == "Büro (odometry made from the truth)"
    for log in (summary.session, summary.survey):
        assert inspect_file(log, Reading()).problem_count == 0


@pytest.mark.parametrize(
    ("places", "apart_m", "every", "facts"),
    [
        (40, 0.3, 4, ["10 steps", "11 references", "19 places are within", "40 places are too few for both"]),
        (78, 0.3, 4, ["19 references", "a larger --every than 4 gives the library more"]),
        (30, 1.0, 10, ["3 steps", "a smaller --every than 10 gives the drive more"]),
        (50, 1.0, 2, []),
    ],
)
def test_a_division_that_is_too_small_says_so_and_what_to_do(
    source: Path, tmp_path: Path, places: int, apart_m: float, every: int, facts: list[str]
) -> None:
    for k in range(places):
        (source / "images" / f"{k}.JPG").write_bytes(encode_jpeg(np.full((6, 8, 3), 3 * k, np.uint8)))
    rows = "".join(f"images/{k}.JPG,{apart_m * k:.1f},0,0\n" for k in range(places))
    (source / "line.csv").write_text(f"image,x_m,y_m,heading_deg\n{rows}")
    warnings = import_pictures(source, source / "line.csv", tmp_path / "out", every=every).warnings
    assert [fact for fact in facts if fact not in "; ".join(warnings)] == []
    assert bool(warnings) == bool(facts)


def test_pictures_have_their_own_labels_and_names_that_tell_no_pose(source: Path, tmp_path: Path) -> None:
    summary = import_pictures(source, source / "poses.csv", tmp_path / "out", every=EVERY)
    for moment in open_session(summary.session).moments():
        row = round(float(moment.frame.image.mean()) / 4)
        x, y, heading = POSES[row]
        assert moment.truth == pytest.approx([x, y, np.deg2rad(heading)])
        assert moment.frame.time_s == row
    for picture in SurveyLog(summary.survey).survey_pictures():
        x, y, heading = POSES[round(float(picture.image.mean()) / 4)]
        assert picture.pose == pytest.approx([x, y, np.deg2rad(heading)])
    assert all("x0" not in m.frame.picture for m in open_session(summary.session).moments())
    assert {p.suffix for p in (tmp_path / "out").glob("*pictures/*")} == {".png"}


def test_odometry_leads_along_all_rows(source: Path, tmp_path: Path) -> None:
    summary = import_pictures(source, source / "poses.csv", tmp_path / "out", every=EVERY)
    log = open_session(summary.session)
    pose = log.info.start
    assert pose is not None
    for moment in log.moments():
        for motion in moment.frame.motions:
            pose = compose(pose, motion)
        assert moment.truth is not None
        assert np.hypot(*(pose[:2] - moment.truth[:2])) < 0.3 * 6.3  # with noise, over 6.3 m
        assert abs(angle_between(pose[2], moment.truth[2])) < 0.5


def test_the_headers_say_what_is_synthetic(source: Path, tmp_path: Path) -> None:
    summary = import_pictures(
        source, source / "poses.csv", tmp_path / "out", Reading(odometry_seed=9), every=EVERY
    )
    for log in (summary.session, summary.survey):
        notes = " ".join(read_header(log)[0].notes)
        assert "ODOMETRY IS NOT MEASURED" in notes
        assert "seed 9" in notes
        assert "times are synthetic" in notes
        assert "at least 0.5 m from every session pose" in notes


def test_a_camera_that_is_stated_is_that_of_session_and_library(source: Path, tmp_path: Path) -> None:
    options = Reading(camera_fov_rad=1.2)
    summary = import_pictures(source, source / "poses.csv", tmp_path / "out", options)
    assert [one.horizontal_fov_rad for one in open_session(summary.session).info.cameras] == [1.2]
    camera = build_library(summary.survey).camera
    assert camera is not None
    assert camera.horizontal_fov_rad == 1.2
    with pytest.raises(InputError, match="field of view of 180 degrees, expected 1 to 170"):
        import_pictures(source, source / "poses.csv", tmp_path / "none", Reading(camera_fov_rad=math.pi))


def test_the_same_seed_gives_the_same_files(source: Path, tmp_path: Path) -> None:
    logs = [
        import_pictures(
            source, source / "poses.csv", tmp_path / out, Reading(odometry_seed=seed), every=EVERY
        ).session
        for out, seed in (("a", 1), ("b", 1), ("c", 2))
    ]
    first, again, other = (log.read_text() for log in logs)
    assert first == again != other


def test_a_map_of_walls(source: Path, tmp_path: Path) -> None:
    (tmp_path / "walls.txt").write_text("0 0 3000 0\n")
    map_lines = tmp_path / "walls.txt"
    summary = import_pictures(source, source / "poses.csv", tmp_path / "out", map_lines=map_lines)
    arena = open_session(summary.session).info.arena
    assert arena is not None
    assert arena.walls.tolist() == [[0, 0, 3, 0]]


def cut(file: Path) -> None:
    file.write_bytes(file.read_bytes()[:-9])


def add_far(file: Path) -> None:
    file.write_text(file.read_text() + "images/far.JPG,12000,0,0\n")


def keep_one_place(file: Path) -> None:
    file.write_text("".join(file.read_text().splitlines(keepends=True)[:3]))


BAD: dict[str, tuple[str, Callable[[Path], None], str]] = {
    "missing": ("images/*_0.JPG", Path.unlink, r"Büro: .*_0\.JPG: found no such picture, expected a file"),
    "cut": ("images/*_0.JPG", cut, r"Büro: .*_0\.JPG: found a cut JPEG"),
    "far": ("*.csv", add_far, r"poses\.csv: found poses 12000 m apart, .* at \(12000, 0\), .* in meters\?"),
    "guard": ("*.csv", keep_one_place, "found no picture 0.5 m off the session's"),
}


@pytest.mark.parametrize("name", BAD)
def test_what_cannot_be_imported_leaves_nothing(source: Path, name: str) -> None:
    pattern, change, message = BAD[name]
    change(next(source.glob(pattern)))
    with pytest.raises(InputError, match=message) as caught:
        import_pictures(source, source / "poses.csv", source.parent / "out", every=EVERY)
    assert "\n" not in str(caught.value)
    assert [p.name for p in source.parent.iterdir()] == [source.name]


@pytest.mark.parametrize("folder", ["", "nothere", Path("nothere"), None])
def test_a_folder_that_does_not_exist_or_is_a_file(source: Path, folder: Path | str | None) -> None:
    table = source / "poses.csv"
    folder = table if folder is None else folder
    with pytest.raises(InputError, match=r"found no such folder '.*, expected the one"):
        import_pictures(folder, table, source.parent / "out")
    assert not (source.parent / "out").exists()


def test_only_an_earlier_import_is_replaced_when_asked(source: Path, tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out/mine").touch()
    for force in (False, True):
        with pytest.raises(InputError, match="out: "):
            import_pictures(source, source / "poses.csv", tmp_path / "out", force=force)
        import_pictures(source, source / "poses.csv", tmp_path / "new", force=force)
    assert (tmp_path / "out/mine").exists()
    assert (tmp_path / "new/session.log").exists()


ROOT = Path(__file__).parents[2]
OLIN = (ROOT / os.environ.get("MAURICE_DATA", "../shared/data")).resolve() / "olin"


@pytest.mark.skipif(not OLIN.is_dir(), reason="the olin recording is not here; MAURICE_DATA says where")
def test_a_real_recording(tmp_path: Path) -> None:
    map_lines = OLIN / "map_lines_mm.txt"
    summary = import_pictures(OLIN, OLIN / "poses.csv", tmp_path / "olin", map_lines=map_lines)
    assert (summary.rows, summary.runs, summary.session_runs) == (1398, 105, 11)
    assert summary.nearest_reference_median_m == pytest.approx(0.63, abs=0.005)
    assert (summary.session_pictures, summary.library_pictures) == (53, 29)
    assert len(list(open_session(summary.session).moments())) == 53
    library = build_library(summary.survey)
    assert library.size == 29
    assert library.index["color"].references.any(axis=1).all()
    told: list[str] = []
    landmarks = with_landmarks(library, warn=told.append).sensors["landmarks"]
    assert isinstance(landmarks, Landmarks)
    assert landmarks.summary.endswith("(assumed)")
    assert len(told) == 1
    assert "landmarks assume 60 degrees" in told[0]


def along(count: int, step_m: float, copies: int = 1) -> F64:
    return np.array([[step_m * (k // copies), 0.0, 0.0] for k in range(count * copies)])


def test_every_third_run_is_the_session_and_the_guard_takes_what_is_near_seen_or_unseen() -> None:
    split = split_rows(along(8, 1.0), 3, 0.0)
    assert split.session == [0, 3, 6]
    assert split.library == [1, 2, 4, 5, 7]
    assert (split.runs, split.session_runs, split.guarded_runs) == (8, 3, 0)
    split = split_rows(along(9, 0.4), 4, 0.5)
    assert split.session == [0, 4, 8]
    assert split.library == [2, 6]
    assert split.guarded_runs == 4
    back_again = np.array([[0, 0, 0], [3, 0, 0], [6, 0, 0], [9, 0, 0], [2.8, 0, 0]])
    assert split_rows(back_again, 4, 0.5).library == [2, 3]
    assert split_rows(np.array([[0, 0, 0], [0.1, 0, np.pi]]), 2, 0.5).library == []


def test_the_nearest_reference_is_of_every_session_picture_and_of_none_infinitely_far() -> None:
    poses = along(5, 1.0, copies=3)
    split = split_rows(poses, 4, 0.5)
    assert len(split.session) == 6
    assert nearest_m(poses[split.session, :2], poses[split.library, :2]).tolist() == [1] * 6
    assert nearest_m(np.zeros((2, 2)), np.zeros((0, 2))).tolist() == [np.inf, np.inf]


@given(
    st.lists(st.tuples(st.integers(0, 9), st.integers(0, 3)), min_size=1, max_size=40),
    st.integers(2, 6),
    st.floats(0, 3),
)
def test_runs_are_maximal_and_nothing_of_the_library_is_within_the_guard(
    places: list[tuple[int, int]], every: int, guard_m: float
) -> None:
    poses = np.array([[0.7 * x, y, 0.0] for x, y in places])
    split = split_rows(poses, every, guard_m)
    assert split.runs == 1 + sum(a != b for a, b in itertools.pairwise(places))
    assert not set(split.session) & set(split.library)
    assert split.session_runs + len(split.library) + split.guarded_runs == split.runs
    assert all(nearest_m(poses[split.library, :2], poses[split.session, :2]) >= guard_m)


@pytest.mark.parametrize(
    ("length", "most", "chosen"),
    [(1, 1, [0]), (5, 1, [2]), (6, 1, [3]), (3, 5, [0, 1, 2]), (10, 2, [2, 7]), (9, 3, [1, 4, 7])],
)
def test_spread(length: int, most: int, chosen: list[int]) -> None:
    assert spread(range(length), most) == chosen


def test_a_video_gives_the_pictures_of_a_tables_rows(tmp_path: Path) -> None:
    """A row a frame, or those that a column names."""
    shades = [5 * k for k in range(40)]
    video, table = moving(tmp_path / "drive.avi", values=shades), tmp_path / "poses.csv"
    rows = [f"{k},{0.6 * k},0,0" for k in range(39, -1, -1)]
    table.write_text("\n".join(["frame,x_m,y_m,heading_deg", *rows]))
    summary = import_pictures(video, table, tmp_path / "out", every=EVERY)
    assert (summary.session_pictures, summary.library_pictures) == (10, 30)
    for moment in open_session(summary.session).moments():
        assert moment.truth is not None
        assert moment.frame.image.mean() == pytest.approx(5 * moment.truth[0] / 0.6, abs=3)


def test_a_video_that_cannot_be_decoded_and_what_is_none_are_one_line(tmp_path: Path) -> None:
    table = tmp_path / "poses.csv"
    table.write_text("x_m,y_m,heading_deg\n" + "".join(f"{0.6 * k},0,0\n" for k in range(40)))
    foreign = moving(tmp_path / "drive.avi", values=[5 * k for k in range(40)])
    foreign.write_bytes(foreign.read_bytes().replace(b"MJPG", b"QQQQ"))  # a codec that nobody has
    with pytest.raises(InputError, match=r"drive.avi: cannot be opened as a video.*codec.*ffmpeg"):
        import_pictures(foreign, table, tmp_path / "out", every=EVERY)
    with pytest.raises(InputError, match=r"poses.csv: found no such folder .* or a video"):
        import_pictures(table, table, tmp_path / "out", every=EVERY)
    assert not (tmp_path / "out").exists()
