"""ROS 2 bags of several files: whole, damaged in one, and as a recording that was killed leaves them."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import bag_making as making
import pytest
from bag_making import Ros
from ruamel.yaml import YAML

from maurice_loaders.errors import InputError
from maurice_loaders.formats.registry import open_session
from maurice_loaders.reading import ReadingOptions
from maurice_loaders.recorded_session import RecordedSession

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


def going(bag: Path) -> tuple[list[float], RecordedSession]:
    session = open_session(bag, ReadingOptions(keep_going=True))
    assert isinstance(session, RecordedSession)
    return [moment.frame.time_s for moment in session.moments()], session


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
    assert going(bag)[0] == times


def test_what_is_behind_damage_is_read(bag: Path, storage: str) -> None:
    whole = going(bag)[0]
    break_middle_of(files_of(bag)[1])
    with pytest.raises(InputError, match="--keep-going"):
        list(open_session(bag).moments())
    times, session = going(bag)
    missing = {"sqlite3": 12, "mcap": UPDATES // PARTS}[storage]  # an MCAP part is one chunk here
    assert UPDATES - missing <= len(times) < UPDATES
    assert set(times) <= set(whole)
    assert times[-1] == whole[-1]
    assert session.problem_count == 1
    assert files_of(bag)[1].name in str(session.problems[0])


def test_one_that_is_no_bag_is_named_and_the_others_are_read(bag: Path) -> None:
    files_of(bag)[2].write_bytes(b"overwritten")
    times, session = going(bag)
    assert len(times) == 2 * UPDATES // PARTS
    assert any(files_of(bag)[2].name in str(problem) for problem in session.problems)


def test_metadata_may_be_missing(bag: Path) -> None:
    whole = going(bag)[0]
    (bag / "metadata.yaml").unlink()
    with pytest.raises(InputError, match=r"found 3 files .*ros2 bag reindex bag.*--keep-going does without"):
        open_session(bag)
    times, session = going(bag)
    assert times == whole
    assert session.problem_count == 0


@pytest.mark.parametrize("renamed", [True, False])
def test_a_part_that_is_gone_is_named(renamed: bool, bag: Path) -> None:
    gone = files_of(bag)[0]
    if renamed:
        gone.rename(bag / f"other{gone.suffix}")
    else:
        gone.unlink()
    with pytest.raises(InputError, match="--keep-going"):
        open_session(bag)
    times, session = going(bag)
    assert len(times) == (UPDATES if renamed else 2 * UPDATES // PARTS)
    assert session.problem_count == 1
    assert f"{gone.name} is not there, though metadata.yaml lists it" in str(session.problems[0])


@pytest.mark.parametrize("text", ["", "a: [", "rosbag2_bagfile_information: 3", "\0"])
def test_metadata_that_makes_no_sense_is_done_without(text: str, bag: Path) -> None:
    whole = going(bag)[0]
    (bag / "metadata.yaml").write_text(text)
    with pytest.raises(InputError, match="--keep-going"):
        open_session(bag)
    assert going(bag)[0] == whole


def test_none_that_is_a_bag_is_refused(bag: Path) -> None:
    for file in files_of(bag):
        file.write_bytes(b"overwritten")
    with pytest.raises(InputError, match=r"bag_\d+"):
        going(bag)


def test_a_packed_part_without_metadata_says_how_to_unpack(bag: Path) -> None:
    (bag / "metadata.yaml").unlink()
    files_of(bag)[0].rename(bag / f"{files_of(bag)[0].name}.zstd")
    times, session = going(bag)
    assert len(times) == 2 * UPDATES // PARTS
    assert any("zstd -d" in str(problem) for problem in session.problems)
