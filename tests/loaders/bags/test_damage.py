"""Damaged and cut bags, whole or in parts, are refused in one line with the command that repairs them."""

from __future__ import annotations

import json
import random
import shutil
import sqlite3
import subprocess
import sys
from collections.abc import Callable
from contextlib import closing, suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ruamel.yaml import YAML

from helpers import bags as making
from helpers.bags import Ros, Said
from maurice_loaders.bags.containers import open_ros2
from maurice_loaders.errors import InputError, ReadingNotes
from maurice_loaders.formats.registry import open_recording, open_session
from maurice_loaders.reading.options import Reading
from maurice_loaders.reading.recording import OdometryPose


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
REPAIRS = {
    ".bag": "`rosbag reindex {name}`",
    ".db3": "`sqlite3 {name} .recover | sqlite3 repaired.db3`",
    ".mcap": "`mcap recover {name} -o repaired.mcap`",
}
CAMERA = Reading(image_topic="/camera/image/compressed")


def _read(path: Path, options: Reading | None = None) -> int:
    return len(list(open_session(path, options).moments()))


def _refusal(path: Path, options: Reading | None = None) -> str:
    with pytest.raises(InputError) as told:
        _read(path, options)
    return str(told.value)


@pytest.mark.parametrize("name", WRITERS)
def test_damage_is_one_line(name: str, tmp_path: Path) -> None:
    whole = WRITERS[name](tmp_path)
    data = whole.read_bytes()
    chance, in_folder = random.Random(name), (whole.parent / "metadata.yaml").exists()
    for trial in range(12):
        path = whole.parent if in_folder and trial % 4 < 2 else tmp_path / name
        damaged = bytearray(data)
        if trial % 3 == 0:
            damaged = damaged[: chance.randrange(len(data))]
        for _ in range(0 if trial % 3 == 0 else chance.choice([1, 4, 40])):
            damaged[chance.randrange(len(data))] ^= 1 << chance.randrange(8)
        (whole if path.is_dir() else path).write_bytes(damaged)
        with suppress(InputError):  # which is one line; anything else fails
            _read(path, Reading(keep_going=trial % 2 == 0))


@pytest.mark.parametrize("name", WRITERS)
def test_a_cut_file_is_refused_with_the_command_that_repairs_it(name: str, tmp_path: Path) -> None:
    data = WRITERS[name](tmp_path).read_bytes()
    path = tmp_path / name
    sizes = [len(data) // 2, int(0.97 * len(data)), len(data) - 40]
    for size in sizes[: 2 if path.suffix == ".db3" else 3]:  # SQLite reads on without its last bytes
        path.write_bytes(data[:size])
        text = _refusal(path)
        assert "found a damaged or incomplete file" in text
        assert REPAIRS[path.suffix].format(name=name) in text
        assert "\n" not in text


@pytest.mark.parametrize(("name", "byte"), [("cdr.mcap", 4200), ("json.mcap", 900)])
def test_a_cut_mcap_file_says_where_it_ends(name: str, byte: int, tmp_path: Path) -> None:
    path = tmp_path / name
    path.write_bytes(WRITERS[name](tmp_path).read_bytes()[:byte])
    assert f"it ends at byte {byte} without its footer" in _refusal(path)


@pytest.mark.parametrize("name", ["x.bag", "x.mcap", "x.db3"])
def test_other_files_and_folders_with_our_names_are_refused(name: str, tmp_path: Path) -> None:
    for content in (b"", b"hello", bytes(1000)):
        (tmp_path / name).write_bytes(content)
        assert "expected" in _refusal(tmp_path / name)
    (tmp_path / name).unlink()
    (tmp_path / name).mkdir()
    _refusal(tmp_path / name)
    (tmp_path / name / "metadata.yaml").write_text("nothing: here\n")
    assert f"`ros2 bag reindex {name}`" in _refusal(tmp_path / name)


def test_a_chunk_that_claims_too_much_is_not_unpacked(tmp_path: Path) -> None:
    """In the chunk's own header and in its index."""
    whole = WRITERS["json.mcap"](tmp_path).read_bytes()
    size_at = whole.index(b"\x06", 8 + 9) + 9 + 16  # the first chunk: kind, length, two times, then its size
    size = whole[size_at : size_at + 8]
    path = tmp_path / "bomb.mcap"
    path.write_bytes(whole[:size_at] + whole[size_at:].replace(size, (2**50).to_bytes(8, "little")))
    assert "found a chunk that takes more than 268 MB unpacked" in _refusal(path)


def test_a_bag_that_was_never_closed(tmp_path: Path) -> None:
    """As `rosbag record` leaves it when it is killed: no index, and its place in the header is zero."""
    data = bytearray(WRITERS["plain.bag"](tmp_path).read_bytes())
    at = data.index(b"index_pos=") + len(b"index_pos=")
    index_at = int.from_bytes(data[at : at + 8], "little")
    data[at : at + 8] = bytes(8)
    path = tmp_path / "killed.bag.active"
    path.write_bytes(data[:index_at])
    assert "Bag is not indexed" in (text := _refusal(path))
    assert "`rosbag reindex killed.bag.active`" in text


def test_chunks_may_overlap_in_time(tmp_path: Path) -> None:
    """Publishers that are late make chunks overlap; what comes out is in order all the same."""
    said = making.drive(Ros(1), 40)
    mixed = [one for start in range(3) for one in said[start::3]]
    pictures = [
        Said("/pad", "sensor_msgs/Image", one.log_ns, noise(Ros(1), one.log_ns)) for one in mixed[::4]
    ]
    path = making.write_ros1(tmp_path / "mixed.bag", [*mixed, *pictures])
    session = open_session(path, CAMERA)
    assert len(list(session.moments())) == 40
    assert not any("left out" in warning for warning in session.warnings)


def _database(folder: Path) -> Path:
    return next(making.write_ros2(folder / "bag", making.drive(Ros(2), 100)).glob("*.db3"))


@pytest.mark.parametrize("alone", [True, False])
def test_a_database_with_a_broken_page_is_refused(alone: bool, tmp_path: Path) -> None:
    file = _database(tmp_path)
    data = bytearray(file.read_bytes())
    data[20 * 4096 : 21 * 4096] = bytes(4096)
    file.write_bytes(data)
    text = _refusal(file if alone else file.parent)
    assert "malformed" in text
    assert "`sqlite3 bag.db3 .recover | sqlite3 repaired.db3`" in text


@pytest.mark.parametrize("mode", ["WAL", "DELETE"])
@pytest.mark.parametrize("alone", [True, False])
def test_what_a_killed_writer_left_beside_its_database_is_not_ignored(
    mode: str, alone: bool, tmp_path: Path
) -> None:
    """As `ros2 bag record --storage-preset-profile resilient` leaves it; repaired as the message says."""
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
    text = _refusal(path)
    assert "bytes of it in bag.db3-" in text
    assert "`sqlite3 bag.db3 'PRAGMA quick_check'`" in text
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
    assert "bag.db3: " in _refusal(file)


PACKED = {"bz2.bag": b"BZh9", "file.mcap": b"\x28\xb5\x2f\xfd", "folder": b"\x28\xb5\x2f\xfd"}


def _large_and_damaged(folder: Path, name: str) -> Path:
    """A bag of forty pictures in several packed chunks, one of which in the middle begins wrongly."""
    ros = Ros(1 if name == "bz2.bag" else 2)
    drive = making.drive(ros, 40)
    pads = [Said("/pad", "sensor_msgs/Image", one.log_ns, noise(ros, one.log_ns)) for one in drive[::8]]
    said = sorted([*drive, *pads], key=lambda one: one.log_ns)
    if name == "bz2.bag":
        path = file = making.write_ros1(folder / "made.bag", said, "bz2")
    else:
        path = making.write_ros2(folder / "made", said, storage="mcap", compression="storage")
        file = next(path.glob("*.mcap"))
    data = bytearray(file.read_bytes())
    data[data.index(PACKED[name], len(data) // 2)] ^= 1
    file.write_bytes(data)
    return path if name == "folder" else file


def noise(ros: Ros, t_ns: int) -> object:
    """A picture that no compression makes small."""
    pixels = np.random.default_rng(t_ns % 2**32).integers(0, 256, (300, 600), np.uint8)
    return ros.image(t_ns, pixels, "rgb8", width=200)


@pytest.mark.parametrize("name", PACKED)
def test_a_damaged_chunk_is_refused(name: str, tmp_path: Path) -> None:
    path = _large_and_damaged(tmp_path, name)
    for keep_going in (False, True):
        text = _refusal(path, Reading(image_topic=CAMERA.image_topic, keep_going=keep_going))
        assert "found a damaged or incomplete file" in text
        kind, file = (".bag", "made.bag") if name == "bz2.bag" else (".mcap", "made.mcap")
        assert REPAIRS[kind].format(name=file) in text


def test_one_wrong_bit_is_seen_by_the_checksum(tmp_path: Path) -> None:
    path = making.write_json_mcap(tmp_path / "made.mcap", making.foxglove_drive(12), chunks=4)
    data = bytearray(path.read_bytes())
    data[data.index(b'"translation": {"x": 0.5')] ^= 1
    path.write_bytes(data)
    assert "crc validation failed in Chunk" in _refusal(path)


@pytest.mark.parametrize("name", ["plain.bag", "cdr.mcap"])
def test_a_damaged_index_is_refused(name: str, tmp_path: Path) -> None:
    path = WRITERS[name](tmp_path)
    data = bytearray(path.read_bytes())
    if path.suffix == ".bag":
        data[data.rindex(b"op=\x06")] ^= 1  # the last record of the index
    else:
        start = int.from_bytes(data[-28:-20], "little")  # where the summary begins
        data[-28:-20] = (start + 5).to_bytes(8, "little")
    path.write_bytes(data)
    assert REPAIRS[path.suffix].format(name=path.name) in _refusal(path)


UPDATES = 90
PARTS = 3
FIRST = 9  # so that the order of the names is not that of their numbers
ENDINGS = {"sqlite3": "db3", "mcap": "mcap"}
PACKING = {"sqlite3": None, "mcap": "storage"}
ZSTD = b"\x28\xb5\x2f\xfd"
INFORMATION = "rosbag2_bagfile_information"


@pytest.fixture(params=ENDINGS)
def storage(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def bag(storage: str, tmp_path: Path) -> Path:
    """A drive in three files, as `ros2 bag record --max-bag-duration` splits it."""
    said = making.drive(Ros(2), UPDATES)
    share = len(said) // PARTS
    folder = tmp_path / "bag"
    folder.mkdir()
    written: list[dict[str, Any]] = []
    for part in range(PARTS):
        now = said[part * share : (part + 1) * share]
        made = making.write_ros2(tmp_path / str(part), now, storage=storage, compression=PACKING[storage])
        written.append(YAML(typ="safe").load(made / "metadata.yaml")[INFORMATION])
        (file,) = made.glob(f"*.{ENDINGS[storage]}")
        shutil.move(file, folder / f"bag_{FIRST + part}.{ENDINGS[storage]}")
    (folder / "metadata.yaml").write_text(json.dumps({INFORMATION: _joined(written, folder)}))
    return folder


def _joined(parts: list[dict[str, Any]], folder: Path) -> dict[str, Any]:
    """The metadata of all parts; JSON is YAML too."""
    names = [file.name for file in files_of(folder)]
    joined = {**parts[0], "relative_file_paths": names}
    joined["message_count"] = sum(part["message_count"] for part in parts)
    joined["duration"] = {"nanoseconds": sum(part["duration"]["nanoseconds"] for part in parts)}
    joined["files"] = [{**part["files"][0], "path": name} for part, name in zip(parts, names, strict=True)]
    for number, topic in enumerate(joined["topics_with_message_count"]):
        topics = [part["topics_with_message_count"][number] for part in parts]
        topic["message_count"] = sum(one["message_count"] for one in topics)
    return joined


def files_of(folder: Path) -> list[Path]:
    return sorted(folder.glob("bag_*"), key=lambda file: int(file.stem.partition("_")[2]))


def break_middle_of(file: Path) -> None:
    """Overwrite a page of the database, or the beginning of what a chunk is packed to."""
    data = bytearray(file.read_bytes())
    at = len(data) // 2 // 4096 * 4096 if file.suffix == ".db3" else data.index(ZSTD)
    data[at : at + 4096] = bytes(4096)
    file.write_bytes(data)


def test_a_whole_one_is_read_in_order(bag: Path) -> None:
    times = [moment.frame.time_s for moment in open_session(bag).moments()]
    assert len(times) == UPDATES
    assert times == sorted(times)


def test_messages_of_all_parts_are_counted_whatever_the_metadata_says(bag: Path) -> None:
    with open_ros2(bag) as source:
        counts = {topic.name: topic.count for topic in source.topics}
    metadata = json.loads((bag / "metadata.yaml").read_text())
    for topic in metadata[INFORMATION]["topics_with_message_count"]:
        topic["message_count"] = 1  # as of one part
    (bag / "metadata.yaml").write_text(json.dumps(metadata))
    with open_ros2(bag) as source:
        assert {topic.name: topic.count for topic in source.topics} == counts
    assert sum(counts.values()) == metadata[INFORMATION]["message_count"]


def test_one_of_several_files_says_so(bag: Path) -> None:
    told = f"this is one of {PARTS} files of the recording in {bag}: name that folder to read all"
    assert [told in open_recording(file).info.notes[0] for file in files_of(bag)] == [True] * PARTS
    assert told not in open_recording(bag).info.notes[0]
    lone = Path(shutil.copy(files_of(bag)[1], bag.parent))
    assert told not in open_recording(lone).info.notes[0]


def test_a_part_that_is_damaged_no_bag_or_gone_is_named(bag: Path, storage: str) -> None:
    first, middle, last = files_of(bag)
    whole = middle.read_bytes()
    break_middle_of(middle)
    command = {"sqlite3": "`sqlite3 FILE .recover |", "mcap": "`mcap recover FILE"}[storage]
    assert command in _refusal(bag)
    middle.write_bytes(whole)
    whole = last.read_bytes()
    last.write_bytes(b"overwritten")
    assert "found a damaged or incomplete file" in _refusal(bag)
    last.write_bytes(whole)
    first.unlink()
    assert first.name in (text := _refusal(bag))
    assert "`ros2 bag reindex bag`" in text


def test_metadata_that_is_missing_or_makes_no_sense_is_refused(bag: Path) -> None:
    for text in ("", "a: [", "rosbag2_bagfile_information: 3", "\0"):
        (bag / "metadata.yaml").write_text(text)
        assert "rebuild metadata.yaml with `ros2 bag reindex bag`" in _refusal(bag)
    (bag / "metadata.yaml").unlink()
    text = _refusal(bag)
    assert "found 3 files of a bag and no metadata.yaml, expected it" in text
    assert "`ros2 bag reindex bag`" in text


def test_of_a_damaged_compressed_message_the_others_are_read(tmp_path: Path) -> None:
    """Each message of such a bag is packed by itself; one may even be not packed at all."""
    folder = making.write_ros2(tmp_path / "bag", making.laser_drive(Ros(2)), compression="message")
    (file,) = folder.glob("*.db3")
    with closing(sqlite3.connect(file)) as database, database:
        topic = "(select id from topics where name = '/odom')"
        rows = database.execute(f"select id, data from messages where topic_id = {topic}")
        number, data = rows.fetchall()[3]
        database.execute("update messages set data = ? where id = ?", (data[: len(data) // 2], number))
    with pytest.raises(InputError, match="a compressed chunk is cut"):
        list(open_recording(folder, Reading()).records(ReadingNotes(keep_going=False)))
    notes = ReadingNotes(keep_going=True)
    records = list(open_recording(folder, Reading()).records(notes))
    assert notes.count == 1
    assert sum(isinstance(record, OdometryPose) for record in records) == 9
