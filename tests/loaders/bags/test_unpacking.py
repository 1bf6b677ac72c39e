"""What takes little compressed and much unpacked is refused in one line, and nothing of it stays."""

from __future__ import annotations

import bz2
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import lz4.frame
import pytest
from rosbags.rosbag1 import reader as ros1

from helpers import bags as making
from helpers.bags import Ros
from maurice_loaders.bags import unpacking
from maurice_loaders.bags.containers import METADATA, open_ros2
from maurice_loaders.bags.unpacking import TooLarge, limit_libraries, own_folder
from maurice_loaders.errors import InputError

zstd = unpacking._zstd()
PACK = {"bz2": bz2.compress, "lz4": lz4.frame.compress, "zstd": zstd.compress}
UNPACK = {"bz2": unpacking.unpack_bz2, "lz4": unpacking.unpack_lz4, "zstd": unpacking.unpack_zstd}


@pytest.mark.parametrize("kind", PACK)
def test_as_much_as_the_limit_is_unpacked_and_no_byte_more(kind, monkeypatch):
    monkeypatch.setattr(unpacking, "MOST_BYTES", 10_000)
    assert UNPACK[kind](PACK[kind](b"x" * 10_000)) == b"x" * 10_000
    with pytest.raises(TooLarge, match="a chunk that takes more than"):
        UNPACK[kind](PACK[kind](b"x" * 10_001))


@pytest.mark.parametrize("kind", PACK)
def test_two_streams_are_one_and_a_cut_one_is_refused(kind):
    data = os.urandom(5000)
    assert UNPACK[kind](PACK[kind](data) * 2) == data * 2
    with pytest.raises(ValueError, match="cut"):
        UNPACK[kind](PACK[kind](data)[:-100])


def test_the_libraries_unpack_within_the_limit(monkeypatch):
    limit_libraries()
    monkeypatch.setattr(unpacking, "MOST_BYTES", 1000)
    with pytest.raises(TooLarge):
        ros1.decompressors["bz2"](bz2.compress(b"x" * 1001))
    with pytest.raises(TooLarge):
        unpacking.unpack_zstd(zstd.compress(b"x" * 1001))  # of a message, when it is decoded


@pytest.fixture
def packed(tmp_path):
    """A bag whose one file is compressed as a whole."""
    return making.write_ros2(tmp_path / "packed", making.drive(Ros(2), 5), compression="file")


def test_a_compressed_file_is_unpacked_up_to_the_limit_and_leaves_nothing(packed, monkeypatch, tmp_path):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    (tmp_path / "temporary").mkdir()
    with open_ros2(packed) as bag:
        assert bag.topics
    monkeypatch.setenv(unpacking.LIMIT, "1e-6")
    with (
        pytest.raises(InputError, match="takes more than 1e-06 GB unpacked; MAURICE_MAX_UNPACKED_GB"),
        open_ros2(packed),
    ):
        pass
    monkeypatch.setenv(unpacking.LIMIT, "much")
    with pytest.raises(InputError, match="'much', expected a number of gigabytes"), open_ros2(packed):
        pass
    assert not list((tmp_path / "temporary").iterdir())


def test_what_a_killed_process_left_is_removed_and_nothing_else(monkeypatch, tmp_path):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    left = tmp_path / f"{unpacking.FOLDER}{ended.pid}-abc"
    others = [tmp_path / f"{unpacking.FOLDER}{os.getpid()}-abc", tmp_path / f"{unpacking.FOLDER}mine"]
    for folder in (left, *others):
        folder.mkdir()
        (folder / "bag.db3").write_bytes(b"x")
    with own_folder() as folder:
        assert Path(folder).parent == tmp_path
        assert not left.exists()
        assert all(other.exists() for other in others)


def test_a_cut_compressed_file_is_named_with_what_can_be_done(packed):
    (file,) = packed.glob("*.zstd")
    file.write_bytes(file.read_bytes()[:-200])
    with (
        pytest.raises(InputError, match=rf"zstd -dc {file.name} > part.db3.*sqlite3 part.db3 .recover"),
        open_ros2(packed),
    ):
        pass


def test_long_metadata_is_refused_before_it_is_parsed(packed):
    (packed / METADATA).write_text((packed / METADATA).read_text() + "#" * 3_000_000)
    with pytest.raises(InputError, match="more than 2 MB, expected the metadata of a bag"), open_ros2(packed):
        pass
