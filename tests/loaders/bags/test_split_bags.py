"""ROS 2 bags of several files: whole, damaged in one, and as a recording that was killed leaves them."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest
from ruamel.yaml import YAML

from helpers import bags as making
from helpers.bags import Ros
from maurice_loaders.errors import InputError
from maurice_loaders.formats.registry import open_session

UPDATES = 90
PARTS = 3
FIRST = 9  # so that the order of the names is not that of their numbers
ENDINGS = {"sqlite3": "db3", "mcap": "mcap"}
PACKED = {"sqlite3": None, "mcap": "storage"}
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
        made = making.write_ros2(tmp_path / str(part), now, storage=storage, compression=PACKED[storage])
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


def refusal(bag: Path) -> str:
    with pytest.raises(InputError) as told:
        list(open_session(bag).moments())
    return str(told.value)


def test_a_damaged_part_is_refused(bag: Path, storage: str) -> None:
    break_middle_of(files_of(bag)[1])
    command = {"sqlite3": "`sqlite3 FILE .recover |", "mcap": "`mcap recover FILE"}[storage]
    assert command in refusal(bag)


def test_one_that_is_no_bag_is_refused(bag: Path) -> None:
    files_of(bag)[2].write_bytes(b"overwritten")
    assert "found a damaged or incomplete file" in refusal(bag)


def test_metadata_may_be_missing(bag: Path) -> None:
    (bag / "metadata.yaml").unlink()
    assert "found 3 files of a bag and no metadata.yaml, expected it" in (text := refusal(bag))
    assert "`ros2 bag reindex bag`" in text


def test_a_part_that_is_gone_is_named(bag: Path) -> None:
    gone = files_of(bag)[0]
    gone.unlink()
    assert gone.name in (text := refusal(bag))
    assert "`ros2 bag reindex bag`" in text


@pytest.mark.parametrize("text", ["", "a: [", "rosbag2_bagfile_information: 3", "\0"])
def test_metadata_that_makes_no_sense_is_refused(text: str, bag: Path) -> None:
    (bag / "metadata.yaml").write_text(text)
    assert "rebuild metadata.yaml with `ros2 bag reindex bag`" in refusal(bag)
