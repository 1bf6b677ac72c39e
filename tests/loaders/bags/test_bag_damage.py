"""Damaged bags give one line, never a traceback; a cut MCAP file is read as far as it goes."""

from __future__ import annotations

import random
import sqlite3
import subprocess
import sys
from collections.abc import Callable
from contextlib import closing, suppress
from dataclasses import replace
from pathlib import Path

import bag_making as making
import numpy as np
import pytest
from bag_making import Ros, Said

from maurice_loaders.errors import InputError
from maurice_loaders.formats.registry import open_session
from maurice_loaders.reading import ReadingOptions


def _in_folder(folder: Path, name: str, **how: str) -> Path:
    return next(making.write_ros2(folder / "made", making.drive(Ros(2), 3), **how).glob(name))  # type: ignore[arg-type]  # as named


WRITERS: dict[str, Callable[[Path], Path]] = {
    "plain.bag": lambda folder: making.write_ros1(folder / "made.bag", making.drive(Ros(1), 3)),
    "lz4.bag": lambda folder: making.write_ros1(folder / "made.bag", making.drive(Ros(1), 3), "lz4"),
    "sqlite.db3": lambda folder: _in_folder(folder, "*.db3"),
    "cdr.mcap": lambda folder: _in_folder(folder, "*.mcap", storage="mcap"),
    "zstd.mcap": lambda folder: _in_folder(folder, "*.mcap", storage="mcap", compression="storage"),
    "json.mcap": lambda folder: making.write_json_mcap(
        folder / "made.mcap", making.foxglove_drive(3), chunks=2
    ),
    "unindexed.mcap": lambda folder: making.write_json_mcap(folder / "made.mcap", making.foxglove_drive(3)),
}


def _read(path: Path, *, keep_going: bool = False) -> int:
    return len(list(open_session(path, ReadingOptions(keep_going=keep_going)).moments()))


@pytest.mark.parametrize("name", WRITERS)
def test_damage_is_one_line(name: str, tmp_path: Path) -> None:
    data = WRITERS[name](tmp_path).read_bytes()
    chance = random.Random(name)
    path = tmp_path / name
    for trial in range(24):
        damaged = bytearray(data)
        if trial % 3 == 0:
            damaged = damaged[: chance.randrange(len(data))]
        for _ in range(0 if trial % 3 == 0 else chance.choice([1, 4, 40])):
            damaged[chance.randrange(len(data))] ^= 1 << chance.randrange(8)
        path.write_bytes(damaged)
        for keep_going in (False, True):
            with suppress(InputError):  # which is one line; anything else fails
                _read(path, keep_going=keep_going)


@pytest.mark.parametrize("name", WRITERS)
def test_a_cut_file_is_refused(name: str, tmp_path: Path) -> None:
    data = WRITERS[name](tmp_path).read_bytes()
    path = tmp_path / name
    for share in (0.1, 0.5, 0.97):
        path.write_bytes(data[: int(share * len(data))])
        with pytest.raises(InputError):
            _read(path)


@pytest.mark.parametrize("name", ["x.bag", "x.mcap", "x.db3"])
@pytest.mark.parametrize("content", [b"", b"hello", bytes(1000)])
def test_other_files_with_our_names_are_refused(name: str, content: bytes, tmp_path: Path) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError):
        _read(tmp_path / name)


@pytest.mark.parametrize("name", ["x.bag", "x.mcap", "x.db3"])
def test_folders_with_our_names_are_refused(name: str, tmp_path: Path) -> None:
    (tmp_path / name).mkdir()
    with pytest.raises(InputError):
        _read(tmp_path / name)
    (tmp_path / name / "metadata.yaml").write_text("nothing: here\n")
    with pytest.raises(InputError):
        _read(tmp_path / name)


@pytest.mark.parametrize("name", ["cdr.mcap", "plain.bag"])
def test_a_file_that_is_cut_before_its_first_message_is_called_cut(name: str, tmp_path: Path) -> None:
    path = tmp_path / name
    path.write_bytes(WRITERS[name](tmp_path).read_bytes()[:4200])
    with pytest.raises(InputError, match=r"ends at byte 4200.*it holds no topic"):
        _read(path, keep_going=True)


@pytest.mark.parametrize("name", ["unindexed.mcap", "cdr.mcap", "plain.bag", "lz4.bag"])
def test_a_cut_file_is_read_as_far_as_it_goes(name: str, tmp_path: Path) -> None:
    whole = WRITERS[name](tmp_path)
    data = whole.read_bytes()
    path = tmp_path / name
    path.write_bytes(data[:-40])  # the footer or the index's end is gone, all messages are there
    with pytest.raises(InputError, match="--keep-going reads it as far as it goes"):
        _read(path)
    assert _read(path, keep_going=True) == _read(whole) == 3


def test_a_chunk_that_claims_too_much_is_not_unpacked(tmp_path: Path) -> None:
    data = bytearray(WRITERS["json.mcap"](tmp_path).read_bytes())
    at = data.index(b"\x06", 8 + 9)  # the first chunk: kind, length, two times, then its unpacked size
    data[at + 9 + 16 : at + 9 + 24] = (2**50).to_bytes(8, "little")
    path = tmp_path / "bomb.mcap"
    path.write_bytes(data)
    with pytest.raises(InputError, match=r"chunk|bytes"):
        _read(path)


def test_a_bag_that_was_never_closed(tmp_path: Path) -> None:
    """As `rosbag record` leaves it when it is killed: no index, and its place in the header is zero."""
    whole = WRITERS["plain.bag"](tmp_path)
    data = bytearray(whole.read_bytes())
    at = data.index(b"index_pos=") + len(b"index_pos=")
    index_at = int.from_bytes(data[at : at + 8], "little")
    data[at : at + 8] = bytes(8)
    path = tmp_path / "killed.bag.active"
    path.write_bytes(data[:index_at])
    with pytest.raises(InputError, match="rosbag reindex"):
        _read(path)
    assert _read(path, keep_going=True) == _read(whole) == 3


def test_chunks_may_overlap_in_time(tmp_path: Path) -> None:
    """Publishers that are late make chunks overlap; what comes out is in order all the same."""
    said = making.drive(Ros(1), 40)
    mixed = [one for start in range(3) for one in said[start::3]]
    pictures = [Said("/pad", "sensor_msgs/Image", one.log_ns, pad(one.log_ns)) for one in mixed[::4]]
    path = making.write_ros1(tmp_path / "mixed.bag", [*mixed, *pictures])
    session = open_session(path, ReadingOptions(image_topic="/camera/image/compressed"))
    assert len(list(session.moments())) == 40
    assert not any("left out" in warning for warning in session.warnings)


def pad(t_ns: int) -> object:
    """A picture large enough to fill chunks."""
    return Ros(1).image(t_ns, np.zeros((300, 600), np.uint8), "rgb8", width=200)


def _database(folder: Path) -> Path:
    return next(making.write_ros2(folder / "bag", making.drive(Ros(2), 100)).glob("*.db3"))


def _said(path: Path) -> tuple[int, tuple[str, ...]]:
    session = open_session(path, ReadingOptions(keep_going=True))
    return len(list(session.moments())), session.warnings


@pytest.mark.parametrize("alone", [True, False])
def test_a_cut_database_is_read_until_it_breaks(alone: bool, tmp_path: Path) -> None:
    file = _database(tmp_path)
    data = file.read_bytes()
    file.write_bytes(data[: len(data) // 2])
    path = file if alone else file.parent
    with pytest.raises(InputError, match="--keep-going reads what can be read"):
        _read(path)
    count, said = _said(path)
    assert 30 <= count <= 60  # of 100, as half of the file is there
    assert any("breaks off after" in text for text in said)


@pytest.mark.parametrize("alone", [True, False])
def test_a_broken_page_of_a_database_hides_only_its_own_rows(alone: bool, tmp_path: Path) -> None:
    file = _database(tmp_path)
    data = bytearray(file.read_bytes())
    for page in (20, 21, 45):
        data[page * 4096 : (page + 1) * 4096] = bytes(4096)
    file.write_bytes(data)
    session = open_session(file if alone else file.parent, ReadingOptions(keep_going=True))
    assert 90 <= len(list(session.moments())) < 100
    assert session.problem_count == 2, session.problems
    assert "cannot be read" in str(session.problems[0])
    assert not any("as far as it goes" in text for text in session.warnings)


def test_numbers_of_rows_that_lead_back_do_not_go_on_forever(tmp_path: Path) -> None:
    """As a broken page may have them; rows come by their place in the file, numbered anyhow."""
    file = _database(tmp_path)
    with closing(sqlite3.connect(file)) as base:
        base.execute("UPDATE messages SET id = 1000000 + id WHERE id > 400")
        base.execute("UPDATE messages SET id = 3000000000 WHERE id = 300")
        base.commit()
    data = bytearray(file.read_bytes())
    data[-4096 * 20 : -4096 * 19] = bytes(4096)
    file.write_bytes(data)
    assert _said(file)[0] >= 60


@pytest.mark.parametrize("mode", ["WAL", "DELETE"])
@pytest.mark.parametrize("alone", [True, False])
def test_what_a_killed_writer_left_beside_its_database_is_not_passed_over(
    mode: str, alone: bool, tmp_path: Path
) -> None:
    """As `ros2 bag record --storage-preset-profile resilient` leaves it; mended as the message says."""
    file = _database(tmp_path)
    script = (
        "import os, sqlite3, sys\n"
        "base = sqlite3.connect(sys.argv[1], isolation_level=None)\n"
        "base.execute(f'PRAGMA journal_mode = {sys.argv[2]}')\n"
        "base.execute('PRAGMA cache_size = 1')\n"
        "base.execute('BEGIN')\n"
        "base.execute('DELETE FROM messages WHERE id > 250')\n"
        "base.execute('COMMIT') if sys.argv[2] == 'WAL' else None\n"
        "os.kill(os.getpid(), 9)\n"
    )
    subprocess.run([sys.executable, "-c", script, file, mode], check=False)
    path = file if alone else file.parent
    with pytest.raises(InputError, match=r"belong into bag\.db3 are still in bag\.db3-.*`sqlite3 bag\.db3"):
        _read(path)
    session = open_session(path, ReadingOptions(keep_going=True))
    list(session.moments())
    assert any("are still in bag.db3-" in str(problem) for problem in session.problems)
    with closing(sqlite3.connect(file)) as base:
        assert base.execute("PRAGMA quick_check").fetchone() == ("ok",)
    assert _read(path) == (50 if mode == "WAL" else 100)


@pytest.mark.parametrize("value", ["NULL", "7", "'text'", "3000000000"])
def test_a_row_that_holds_no_bytes_is_one_line(value: str, tmp_path: Path) -> None:
    file = _database(tmp_path)
    with closing(sqlite3.connect(file)) as base:
        base.execute("CREATE TABLE loose AS SELECT * FROM messages")  # which may hold anything
        base.execute("DROP TABLE messages")
        base.execute("ALTER TABLE loose RENAME TO messages")
        base.execute(f"UPDATE messages SET data = {value} WHERE id = 250")
        base.commit()
    with pytest.raises(InputError):
        _read(file)
    session = open_session(file, ReadingOptions(keep_going=True))
    assert len(list(session.moments())) >= 99  # the row is left out, or one record of it
    assert session.problem_count == 1


def test_a_database_without_readable_topics_is_refused_all_the_same(tmp_path: Path) -> None:
    file = _database(tmp_path)
    file.write_bytes(file.read_bytes()[:4096])
    with pytest.raises(InputError):
        _read(file, keep_going=True)


def test_a_cut_file_says_so(tmp_path: Path) -> None:
    path = WRITERS["plain.bag"](tmp_path)
    path.write_bytes(path.read_bytes()[:-40])
    session = open_session(path, ReadingOptions(keep_going=True))
    assert len(list(session.moments())) == 3
    assert any("read as far as it goes" in text for text in session.warnings)


PACKED = {"bz2.bag": b"BZh9", "file.mcap": b"\x28\xb5\x2f\xfd", "folder": b"\x28\xb5\x2f\xfd"}


def _large(folder: Path, name: str) -> tuple[Path, Path]:
    """A bag of forty pictures in several packed chunks: what is opened, and its file."""
    ros = Ros(1 if name == "bz2.bag" else 2)
    drive = making.drive(ros, 40)
    pads = [Said("/pad", "sensor_msgs/Image", one.log_ns, noise(ros, one.log_ns)) for one in drive[::8]]
    said = sorted([*drive, *pads], key=lambda one: one.log_ns)
    if name == "bz2.bag":
        file = making.write_ros1(folder / "made.bag", said, "bz2")
        return file, file
    bag = making.write_ros2(folder / "made", said, storage="mcap", compression="storage")
    file = next(bag.glob("*.mcap"))
    return (bag if name == "folder" else file), file


def noise(ros: Ros, t_ns: int) -> object:
    """A picture that no packing makes small."""
    pixels = np.random.default_rng(t_ns % 2**32).integers(0, 256, (300, 600), np.uint8)
    return ros.image(t_ns, pixels, "rgb8", width=200)


def _large_and_damaged(folder: Path, name: str) -> Path:
    """The same with what a chunk in the middle is packed to begin in another way."""
    path, file = _large(folder, name)
    data = bytearray(file.read_bytes())
    data[data.index(PACKED[name], len(data) // 2)] ^= 1
    file.write_bytes(data)
    return path


@pytest.mark.parametrize("name", PACKED)
@pytest.mark.parametrize("offset_s", [0.0, 0.001])
def test_a_damaged_chunk_is_left_out_and_counted_once(name: str, offset_s: float, tmp_path: Path) -> None:
    """With an offset the file is read in three passes, which all find it."""
    going = ReadingOptions(
        image_topic="/camera/image/compressed", odometry_offset_s=offset_s, keep_going=True
    )
    session = open_session(_large_and_damaged(tmp_path, name), going)
    times = [moment.frame.time_s for moment in session.moments()]
    assert 20 <= len(times) < 40  # one chunk of several is gone
    assert times[0] < 1
    assert times[-1] > 7  # of 8 s: it was read on
    assert session.problem_count == 1
    assert "the chunk at byte" in str(session.problems[0])
    assert not any("as far as it goes" in text for text in session.warnings)


@pytest.mark.parametrize("name", PACKED)
def test_a_damaged_chunk_is_refused_with_where_and_what_to_do(name: str, tmp_path: Path) -> None:
    path = _large_and_damaged(tmp_path, name)
    with pytest.raises(InputError, match=r"the chunk at byte \d+ is damaged .*--keep-going leaves it out"):
        list(open_session(path, ReadingOptions(image_topic="/camera/image/compressed")).moments())


def test_one_wrong_bit_is_seen_by_the_checksum(tmp_path: Path) -> None:
    path = making.write_json_mcap(tmp_path / "made.mcap", making.foxglove_drive(12), chunks=4)
    data = bytearray(path.read_bytes())
    data[data.index(b'"translation": {"x": 0.5')] ^= 1
    path.write_bytes(data)
    with pytest.raises(InputError, match=r"the chunk at byte \d+ is damaged \(found .*checksum"):
        _read(path)
    session = open_session(path, ReadingOptions(keep_going=True))
    assert len(list(session.moments())) == 9  # of 12 in four chunks
    assert session.problem_count == 1


@pytest.mark.parametrize("name", ["bz2.bag", "file.mcap"])
def test_a_damaged_index_is_done_without(name: str, tmp_path: Path) -> None:
    _, file = _large(tmp_path, name)
    data = bytearray(file.read_bytes())
    if name == "bz2.bag":
        data[data.rindex(b"op=\x06")] ^= 1  # the last record of the index
    else:
        footer = int.from_bytes(data[-28:-20], "little")  # where the summary begins
        data[-28:-20] = (footer + 5).to_bytes(8, "little")
    file.write_bytes(data)
    options = ReadingOptions(image_topic="/camera/image/compressed")
    with pytest.raises(InputError):
        list(open_session(file, options).moments())
    session = open_session(file, replace(options, keep_going=True))
    assert len(list(session.moments())) == 40
