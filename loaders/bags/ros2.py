"""ROS 2 bags: a folder with metadata.yaml, or one file of messages."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, closing, contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import InputError
from .mcap import open_mcap
from .mcap_container import MAGIC
from .ros_types import bag_errors, decode_cdr, require_ros
from .source import BagSource, Message, Topic, short_type, sorted_topics
from .sqlite import BrokenDatabase

if TYPE_CHECKING:
    from rosbags.interfaces import Connection

# Which file of a ROS 2 bag is opened: the folder by its metadata, or the one file that is there.

METADATA = "metadata.yaml"
PARTS = (".db3", ".mcap")
BESIDE = {"-wal": b"\x37\x7f\x06", "-journal": b"\xd9\xd5\x05\xf9"}  # of SQLite, and how they begin
PACKED = tuple(f"{part}.zstd" for part in PARTS)


def is_bag_folder(path: Path) -> bool:
    """Tell a folder with a bag's metadata, or, where recording was not ended, with nothing but its files."""
    if (path / METADATA).is_file():
        return True
    try:
        names = [entry.name for entry in path.iterdir()]
    except OSError:
        return False
    return bool(names) and all(any(part in name for part in PARTS) for name in names)


def opened_as(path: Path) -> Path:
    """Give the folder where it has metadata, else the file to open alone.

    InputError where that is not one.
    """
    if path.is_file():
        if path.name.endswith(PACKED):
            raise InputError(
                path, f"found a packed file, expected it unpacked; `zstd -d {path.name}` does that"
            )
        return path
    if (path / METADATA).is_file():
        return path
    files = message_files(path)
    if len(files) == 1:
        return opened_as(files[0])
    found = f"found {len(files)} files of a bag and no {METADATA}"
    mends = f"`ros2 bag reindex {path.name}` makes it anew, --keep-going does without"
    raise InputError(path, f"{found}, expected it; {mends}")


def message_files(path: Path) -> list[Path]:
    """Give the files that hold a bag's messages, by name; a file is its own."""
    if not path.is_dir():
        return [path]
    return sorted(file for file in path.iterdir() if file.name.endswith((*PARTS, *PACKED)))


def not_there(path: Path) -> list[str]:
    """Name the files that a bag's metadata lists and that are gone; none where it cannot be read."""
    from ruamel.yaml import YAML
    from ruamel.yaml.error import YAMLError

    try:
        found = YAML(typ="safe", pure=True).load(path / METADATA)["rosbag2_bagfile_information"]
        names = [str(name) for name in found["relative_file_paths"]]
    except (OSError, ValueError, TypeError, KeyError, YAMLError):
        return []
    gone = [name for name in names if not (path / name).exists()]
    return [f"{name} is not there, though {METADATA} lists it" for name in gone]


def not_merged(file: Path) -> str:
    """Say what of a database still lies beside it, where nobody finds it who only reads; "" for nothing."""
    for ending, magic in BESIDE.items():
        beside = file.with_name(f"{file.name}{ending}")
        if starts_with(beside, magic):
            found = f"{beside.stat().st_size} bytes that belong into {file.name} are still in {beside.name}"
            why = "as the recording was killed, or goes on"
            return f"{found}, {why}; `sqlite3 {file.name} 'PRAGMA quick_check'` puts them in"
    return ""


def is_mcap(path: Path) -> bool:
    """Tell whether a file begins as MCAP does."""
    return starts_with(path, MAGIC)


def starts_with(path: Path, magic: bytes) -> bool:
    """Tell whether a file begins with these bytes; False for what cannot be read."""
    try:
        if not path.is_file():
            return False
        with path.open("rb") as file:
            return file.read(len(magic)) == magic
    except OSError:
        return False


# What can be read of a damaged ROS 2 bag: its files one after the other, each past what is broken in it.


@contextmanager
def open_parts(files: Sequence[Path], lost: Sequence[str] = ()) -> Iterator[BagParts]:
    """Open the files of a bag, of which something may be `lost` already. InputError where none can be."""
    opened: list[tuple[Path, BagSource]] = []
    refused: list[InputError] = []
    with ExitStack() as stack:
        for file in files:
            try:
                opened.append((file, stack.enter_context(_part(file))))
            except InputError as problem:
                refused.append(problem)
        if not opened:
            raise refused[0]
        yield BagParts(opened, [*lost, *map(str, refused)])


def _part(file: Path) -> AbstractContextManager[BagSource]:
    opened_as(file)  # which a packed file is not
    return open_mcap(file, keep_going=True) if is_mcap(file) else closing(BrokenDatabase(file))


class BagParts:
    """Open files of one bag, in the order of time whatever their names are, as a `BagSource`."""

    def __init__(self, parts: Sequence[tuple[Path, BagSource]], lost: Sequence[str]) -> None:
        self._parts = sorted(parts, key=lambda part: _begin_ns(part[1]))
        self._lost = lost  # what could not be opened, and why
        counts = Counter[tuple[str, str, str]]()
        for topic in (topic for _, part in parts for topic in part.topics):
            counts[topic.name, topic.type, topic.unreadable] += topic.count
        self.topics = sorted_topics([Topic(name, kind, n, why) for (name, kind, why), n in counts.items()])

    @property
    def cut(self) -> str:
        """What is missing at the end of the last file."""
        return self._parts[-1][1].cut

    @property
    def damaged(self) -> tuple[str, ...]:
        """What is missing elsewhere."""
        found = [f"{file.name}: {text}" for file, part in self._parts for text in part.damaged]
        found += [f"{file.name}: {part.cut}" for file, part in self._parts[:-1] if part.cut]
        return (*self._lost, *found)

    def messages(self, names: Collection[str]) -> Iterator[Message]:
        """Give the messages of these topics, file by file."""
        for _, part in self._parts:
            yield from part.messages(names)


def _begin_ns(part: BagSource) -> float:
    """Give when the first message of a file was recorded; infinity for one without any."""
    messages = part.messages({topic.name for topic in part.topics})
    return next((message.log_ns for message in messages), math.inf)


# ROS 2 bags, a folder with metadata.yaml or one file of messages, through `rosbags`.

ADVICE = "--keep-going reads what can be read"


@contextmanager
def open_ros2(path: Path, *, keep_going: bool = False) -> Iterator[BagSource]:
    """Open a ROS 2 bag. InputError when it is damaged; with `keep_going` what can be read of it is read."""
    require_ros(path)
    with _opening(path, keep_going=keep_going) as bag:
        yield bag


def _opening(path: Path, *, keep_going: bool) -> AbstractContextManager[BagSource]:
    files = message_files(path)
    lost = [text for file in files if (text := not_merged(file))]
    if lost and not keep_going:
        raise InputError(path, f"found that {lost[0]}, --keep-going reads without them")
    try:
        opened = opened_as(path)
        if is_mcap(opened):
            return open_mcap(opened, keep_going=keep_going)
        bag = _Ros2Bag(opened)
    except InputError:
        if not keep_going or not files:
            raise
        return open_parts(files, [*not_there(path), *lost])
    if len(files) == 1 and is_mcap(files[0]) and not bag.packed:
        bag.close()  # `rosbags` ends at the first damaged chunk, and does not say where that is
        return open_mcap(files[0], keep_going=keep_going)
    return closing(_PastDamage(bag, [] if bag.packed else files, lost) if keep_going else bag)


def _reader(path: Path) -> Any:
    """Choose the reader by what is there, whatever its name ends with."""
    if path.is_dir():
        from rosbags.rosbag2.reader import DirectoryReader

        return DirectoryReader(path)
    from rosbags.rosbag2.storage_sqlite3 import Sqlite3Reader

    return Sqlite3Reader(path.absolute())


class _Ros2Bag:
    """A bag, opened by `rosbags`. InputError where it is damaged."""

    cut = ""
    damaged: tuple[str, ...] = ()

    def __init__(self, path: Path) -> None:
        self._path = path
        with bag_errors(path, ADVICE):
            self._reader = _reader(path)
            self._reader.open()
            found = [Topic(c.topic, short_type(c.msgtype), c.msgcount) for c in self._reader.connections]
            self.topics = sorted_topics(found)

    @property
    def packed(self) -> bool:
        """Tell whether messages or files are packed one by one."""
        return bool(self._reader.metadata.compression_mode)

    def close(self) -> None:
        """Close it."""
        with suppress(Exception):
            self._reader.close()

    def messages(self, names: Collection[str]) -> Iterator[Message]:
        """Give the messages of these topics by the time of recording."""
        wanted = [c for c in self._reader.connections if c.topic in names]
        if not wanted:  # of which it would make all
            return
        with bag_errors(self._path, ADVICE):
            for connection, log_ns, data in self._reader.messages(connections=wanted):
                held = bytes(memoryview(data))  # a damaged row may hold anything
                decode = partial(self._decode, connection, held)
                yield Message(connection.topic, short_type(connection.msgtype), int(log_ns), decode)

    def _decode(self, connection: Connection, data: bytes) -> Any:
        definition, form = connection.msgdef.data, connection.msgdef.format.name.lower()
        with bag_errors(self._path):
            return decode_cdr(data, connection.msgtype, definition, form)


class _PastDamage:
    """A bag that is read from its files, past what is broken in them, where `rosbags` cannot go on."""

    def __init__(self, bag: _Ros2Bag, files: Sequence[Path], lost: Sequence[str]) -> None:
        self._bag = bag
        self._files = files
        self._lost = lost
        self.topics = bag.topics
        self.cut = ""
        self.damaged = tuple(lost)

    def close(self) -> None:
        """Close it."""
        self._bag.close()

    def messages(self, names: Collection[str]) -> Iterator[Message]:
        """Give the messages of these topics by the time of recording, as far as they can be read."""
        given = _Given()
        try:
            for message in self._bag.messages(names):
                given.add(message)
                yield message
        except InputError:
            if not self._files:
                self.cut = f"breaks off after {given.messages} messages"
                return
            with open_parts(self._files, self._lost) as parts:
                yield from (message for message in parts.messages(names) if given.lacks(message))
                self.cut, self.damaged = parts.cut, parts.damaged


class _Given:
    """What has been given of messages in the order of time."""

    def __init__(self) -> None:
        self.messages = 0
        self._last_ns: float = -math.inf
        self._then = Counter[str]()  # messages of that time, by topic

    def add(self, message: Message) -> None:
        """Take note of the next one."""
        if message.log_ns != self._last_ns:
            self._then.clear()
        self.messages, self._last_ns = self.messages + 1, message.log_ns
        self._then[message.topic] += 1

    def lacks(self, message: Message) -> bool:
        """Tell whether one of those that are read once more was not given yet."""
        if message.log_ns != self._last_ns:
            return message.log_ns > self._last_ns
        self._then[message.topic] -= 1
        return self._then[message.topic] < 0
