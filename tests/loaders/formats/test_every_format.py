"""What holds for every format of recordings, on a small drive that is written in each of them."""

from __future__ import annotations

import gc
import json
import random
import shutil
import tracemalloc
from contextlib import suppress
from pathlib import Path

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from helpers.format_samples import SAMPLES, SMALL, sample
from helpers.recordings import read
from maurice_loaders.errors import InputError, PictureError, ReadingNotes
from maurice_loaders.formats.registry import formats, guess, open_recording, open_session
from maurice_loaders.reading.options import Reading
from maurice_loaders.reading.recording import (
    Motion,
    Note,
    OdometryPose,
    Picture,
    Readings,
    Record,
    Recording,
    TruthPose,
)
from maurice_viz.cli.app import app

every = pytest.mark.parametrize("name", SAMPLES)


def content(record: Record) -> object:
    """What two readings must agree in."""
    if isinstance(record, Picture):
        return record.t_s, record.name, record.read().tobytes()
    if isinstance(record, Note | Readings):
        return record
    values = record.motion if isinstance(record, Motion) else record.pose
    return type(record), record.t_s, values.tolist()


def use(path: Path, options: Reading | None = None) -> int:
    """Do all that a replay does with a session, and count its updates."""
    session = open_session(path, options)
    session.overview()
    return sum(1 for _ in session.moments())


def test_every_format_has_a_sample() -> None:
    assert set(SAMPLES) == set(formats())


@every
def test_is_recognized_by_content_and_by_name_when_told(name: str, tmp_path: Path) -> None:
    path = sample(name, tmp_path / "made")
    assert guess(path).name == name
    assert open_recording(path, Reading(format=name)).path == path
    if path.is_file() and name not in ("rosbag2", "mcap"):  # a wrong ending does not matter
        other = path.with_name("drive.xyz")
        shutil.copy(path, other)
        assert guess(other).name == name


@every
def test_can_be_read_again_from_its_beginning(name: str, tmp_path: Path) -> None:
    recording = open_recording(sample(name, tmp_path / "made"))
    first = recording.records(ReadingNotes(keep_going=False))
    next(first)  # a reading that was begun and left does no harm
    readings = [[content(r) for r in recording.records(ReadingNotes(keep_going=False))] for _ in range(2)]
    assert readings[0] == readings[1]
    assert readings[0]


@every
def test_pictures_over_the_limit_are_refused_and_not_decoded(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = sample(name, tmp_path / "made")
    monkeypatch.setenv("MAURICE_MAX_MEGAPIXELS", "0.0001")  # 100 pixels; the samples have 192
    monkeypatch.setattr(cv2, "imdecode", None)
    if name == "video":  # its size is known before any frame
        with pytest.raises(InputError, match="megapixels"):
            list(open_recording(path).records(ReadingNotes(True)))
        return
    records = open_recording(path).records(ReadingNotes(True))
    for picture in [one for one in records if isinstance(one, Picture)]:
        if name == "cmucam":  # frames of at most 255 x 143 pixels, which no picture format holds
            continue
        with pytest.raises(PictureError, match="megapixels"):
            picture.read()


NAMING = {  # formats whose files name pictures: how a name is changed
    "session-log": ("session.log", "pictures/session-00001.jpg"),
    "tum": ("rgb.txt", "rgb/000000.png"),
    "openloris": ("color.txt", "color/000000.png"),
}


@pytest.mark.parametrize("name", NAMING)
@pytest.mark.parametrize("place", ["{outside}", "../../outside.png", "x/../../../outside.png"])
def test_pictures_outside_of_the_folder_are_read_only_when_allowed(
    name: str, place: str, tmp_path: Path
) -> None:
    (tmp_path / "deep").mkdir()
    path = sample(name, tmp_path / "deep" / "made")
    (tmp_path / "deep" / "made" / "x").mkdir()
    table, named = NAMING[name]
    folder = path if path.is_dir() else path.parent
    outside = tmp_path / "outside.png"
    shutil.copy(folder / named, outside)
    text = (folder / table).read_text()
    assert named in text
    (folder / table).write_text(text.replace(named, place.format(outside=outside)))
    if name == "session-log" and place == "{outside}":  # which no log may name
        with pytest.raises(InputError, match="expected a path relative to the log"):
            use(path, Reading(pictures_outside=True))
        return
    with pytest.raises(InputError, match=r"outside of the folder .*--reading pictures_outside=true"):
        use(path)
    assert use(path, Reading(pictures_outside=True)) == SMALL


@every
def test_times_do_not_fall_and_units_are_plausible(name: str, tmp_path: Path) -> None:
    found, _ = read(sample(name, tmp_path / "made"))
    times = [record.t_s for record in found]
    assert times == sorted(times)
    assert 0.2 <= times[-1] - times[0] <= 10
    poses = np.array([r.pose for r in found if isinstance(r, OdometryPose | TruthPose)]).reshape(-1, 3)
    motions = np.array([r.motion for r in found if isinstance(r, Motion)]).reshape(-1, 3)
    assert (np.abs(poses) <= [5, 5, np.pi]).all()
    assert (np.abs(motions) <= [0.1, 0.1, 0.1]).all()


@every
def test_all_pictures_become_updates(name: str, tmp_path: Path) -> None:
    session = open_session(sample(name, tmp_path / "made"))
    moments = list(session.moments())
    assert len(moments) == (SMALL if SAMPLES[name].pictures or SAMPLES[name].readings else 0)
    assert session.overview() == (
        len(moments),
        any(m.truth is not None for m in moments) or not SAMPLES[name].pictures,
    )
    assert session.count_pictures() == len(moments)
    assert [m.frame.step for m in moments] == list(range(1, len(moments) + 1))
    assert all(m.frame.image.dtype == np.uint8 and m.frame.image.shape[2] == 3 for m in moments)
    assert session.problem_count == 0


@pytest.mark.parametrize("name", [name for name, one in SAMPLES.items() if one.truth and one.pictures])
def test_motion_and_truth_are_there_and_truth_is_none_when_absent(name: str, tmp_path: Path) -> None:
    known = list(open_session(sample(name, tmp_path / "with", truth=True)).moments())
    assert all(m.truth is not None for m in known)
    unknown = open_session(sample(name, tmp_path / "without", truth=False))
    assert [m.truth for m in unknown.moments()] == [None] * SMALL
    assert not unknown.overview()[1]
    if name != "kitti":  # which has no odometry
        moved = sum(float(m.frame.motions[:, 0].sum()) for m in known[1:])
        assert moved == pytest.approx(0.05 * (SMALL - 1), rel=1.1)


@pytest.mark.slow
@every
def test_memory_does_not_grow_with_the_recording(name: str, tmp_path: Path) -> None:
    one = SAMPLES[name]
    peaks = []
    for updates in (one.long // 5, one.long):
        recording = open_recording(sample(name, tmp_path / str(updates), updates))
        for _ in recording.records(ReadingNotes(keep_going=False)):
            pass  # what is imported and kept on first use is not the recording's
        peaks.append(min(peak_of_reading(recording, updates) for _ in range(2)))
    assert peaks[1] < peaks[0] + one.growth


def peak_of_reading(recording: Recording, updates: int) -> int:
    """Give the most memory held; other threads of this process can only add to it, so read more than once."""
    gc.collect()
    tracemalloc.start()
    count = sum(1 for _ in recording.records(ReadingNotes(keep_going=False)))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert count >= updates
    return peak


def damaged(data: bytes, chance: random.Random, trial: int) -> bytes:
    if trial % 3 == 0:
        return data[: chance.randrange(len(data))]
    changed = bytearray(data)
    for _ in range(chance.choice([1, 4, 40])):
        changed[chance.randrange(len(data))] ^= 1 << chance.randrange(8)
    return bytes(changed)


@every
def test_damage_is_one_line(name: str, tmp_path: Path) -> None:
    path = sample(name, tmp_path / "made")
    files = [path] if path.is_file() else sorted(one for one in path.rglob("*") if one.is_file())
    chance = random.Random(name)
    for file in files[:6]:
        data = file.read_bytes()
        for trial in range(12):
            file.write_bytes(damaged(data, chance, trial))
            for keep_going in (False, True):
                with suppress(InputError):  # which is one line; anything else fails
                    use(path, Reading(keep_going=keep_going, format=name if trial % 2 else None))
        file.write_bytes(data)


@every
def test_what_is_empty_or_of_another_kind_is_refused(name: str, tmp_path: Path) -> None:
    path = sample(name, tmp_path / "made")
    if not path.is_file():
        shutil.rmtree(path)
        path.mkdir()
    else:
        path.write_bytes(b"")
    (tmp_path / "folder").mkdir()
    (tmp_path / "noise").write_bytes(random.Random(1).randbytes(3000))
    told = Reading(format=name)
    others = [(tmp_path / other, told) for other in ("folder", "noise", "nowhere")]
    for refused, options in [(path, Reading()), (path, told), *others]:
        with pytest.raises(InputError):
            use(refused, options)


@every
def test_the_command_line_tells_in_one_line_and_status_1(name: str, tmp_path: Path) -> None:
    path = sample(name, tmp_path / "made")
    shown = CliRunner().invoke(app, ["inspect", str(path), "--json"])
    assert shown.exit_code == 0, shown.output
    found = json.loads(shown.stdout)
    assert found["format"] == name
    assert found["records"]["image"] == (SMALL if SAMPLES[name].pictures else 0)
    noise = tmp_path / "noise"
    noise.write_bytes(random.Random(2).randbytes(3000))
    refused = CliRunner().invoke(app, ["inspect", str(noise), "--reading", f"format={name}"])
    assert refused.exit_code == 1
    assert refused.stdout == ""
    assert refused.stderr.count("\n") == 1
