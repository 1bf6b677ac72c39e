"""The containers of messages, through `rosbags` and `mcap`: MCAP files, ROS 1 and ROS 2 bags."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, TypeAlias

from ..errors import InputError
from ..files.text import read_bounded
from .source import (
    ENCODINGS,
    BagSource,
    Message,
    Topic,
    bag_errors,
    decode,
    decode_cdr,
    decode_ros1,
    require_ros,
    short_type,
    sorted_topics,
    starts_with,
)
from .unpacking import MOST_BYTES, TooLarge

if TYPE_CHECKING:
    from mcap.reader import McapReader
    from mcap.records import Channel, Schema
    from mcap.records import Message as McapMessage
    from mcap.summary import Summary
    from rosbags.interfaces import Connection
    from rosbags.rosbag1 import Reader
    from rosbags.rosbag2.reader import DirectoryReader
    from rosbags.rosbag2.storage_sqlite3 import Sqlite3Reader

    Record: TypeAlias = tuple[Schema | None, Channel, McapMessage]
    RosReader: TypeAlias = Reader | DirectoryReader | Sqlite3Reader

MCAP_MAGIC = b"\x89MCAP0\r\n"


def is_mcap(path: Path) -> bool:
    """Return whether a file begins as MCAP does."""
    return starts_with(path, MCAP_MAGIC)


def mcap_repair(name: str) -> str:
    """Return the command that repairs an MCAP file."""
    return f"repair it with `mcap recover {name} -o repaired.mcap`"


@contextmanager
def open_mcap(path: Path) -> Iterator[BagSource]:
    """Open an MCAP file. InputError when it is damaged or cut."""
    require_ros(path)
    if not is_mcap(path):
        raise InputError(path, "found no MCAP file, expected one; is it another format?")
    with path.open("rb") as file:
        with bag_errors(path, mcap_repair(path.name)):
            bag = _McapBag(path, file)
        yield bag


class _McapBag:
    """An open MCAP file. Without a chunk index it is read from its beginning, in the order of writing."""

    def __init__(self, path: Path, file: BinaryIO) -> None:
        self._path, self._file = path, file
        file.seek(-len(MCAP_MAGIC), 2)
        if file.read() != MCAP_MAGIC:
            raise ValueError(f"it ends at byte {file.tell()} without its footer")
        summary = self._reader().get_summary()
        if summary is not None and not _complete(summary):
            summary = None
        self._indexed = summary is not None and bool(summary.chunk_indexes)
        if summary is None or summary.statistics is None:
            topics = self._counted()
        else:
            counts = summary.statistics.channel_message_counts
            pairs = [
                (channel, summary.schemas.get(channel.schema_id)) for channel in summary.channels.values()
            ]
            topics = [_topic(schema, channel, counts.get(channel.id, 0)) for channel, schema in pairs]
        self.topics = sorted_topics(topics)

    def messages(self, names: Collection[str]) -> Iterator[Message]:
        if not names:
            return
        with bag_errors(self._path, mcap_repair(self._path.name)):
            for schema, channel, record in self._records(names):
                kind = "" if schema is None else schema.name
                decode_one = partial(self._decode, schema, channel, record.data)
                yield Message(channel.topic, short_type(kind), record.log_time, decode_one)

    def _reader(self) -> McapReader:
        from mcap.reader import SeekingReader

        self._file.seek(0)
        return SeekingReader(self._file, validate_crcs=True, record_size_limit=MOST_BYTES)

    def _records(self, names: Collection[str] | None) -> Iterator[Record]:
        """Yield messages; the library would read a file without an index whole to sort it."""
        from mcap.reader import NonSeekingReader

        if self._indexed:
            return self._reader().iter_messages(names)
        self._file.seek(0)
        reader = NonSeekingReader(self._file, validate_crcs=True, record_size_limit=MOST_BYTES)
        return reader.iter_messages(names, log_time_order=False)

    def _counted(self) -> list[Topic]:
        topics = dict[int, Topic]()
        counts = Counter[int]()
        for schema, channel, _ in self._records(None):
            counts[channel.id] += 1
            topics[channel.id] = _topic(schema, channel, counts[channel.id])
        return list(topics.values())

    def _decode(self, schema: Schema | None, channel: Channel, data: bytes) -> Any:
        named = ("", b"", "") if schema is None else (schema.name, schema.data, schema.encoding)
        with bag_errors(self._path):
            return decode(data, channel.message_encoding, *named)


def _complete(summary: Summary) -> bool:
    """Return whether a summary repeats all channels and schemas, which writers may leave out."""
    if any(chunk.uncompressed_size > MOST_BYTES for chunk in summary.chunk_indexes):
        raise TooLarge(f"found a chunk that takes more than {MOST_BYTES / 1e6:.0f} MB unpacked")
    used = {number for chunk in summary.chunk_indexes for number in chunk.message_index_offsets}
    if summary.statistics is not None:
        used |= summary.statistics.channel_message_counts.keys()
    schemas = {channel.schema_id for channel in summary.channels.values()} - {0}
    return bool(summary.channels) and used <= summary.channels.keys() and schemas <= summary.schemas.keys()


def _topic(schema: Schema | None, channel: Channel, count: int) -> Topic:
    known = channel.message_encoding in ENCODINGS
    unreadable = "" if known else f"its messages are encoded as {channel.message_encoding!r}"
    return Topic(channel.topic, short_type("" if schema is None else schema.name), count, unreadable)


ROS1_MAGIC = b"#ROSBAG V2.0\n"


@contextmanager
def open_ros1(path: Path) -> Iterator[BagSource]:
    """Open a ROS 1 bag. InputError when it is damaged, or was never closed."""
    require_ros(path)
    from rosbags.rosbag1 import Reader

    if not starts_with(path, ROS1_MAGIC):
        raise InputError(path, "found no ROS 1 bag of version 2.0, expected one; is it another format?")
    repair = f"repair it with `rosbag reindex {path.name}`"
    with _opened(path, lambda: Reader(path), repair, repair, ros1=True) as bag:
        yield bag


METADATA = "metadata.yaml"
MOST_METADATA = (
    2_000_000  # bytes: YAML is read slowly, and a bag of a thousand files has some hundred thousand
)
FILES = (".db3", ".mcap")
COMPRESSED = tuple(f"{ending}.zstd" for ending in FILES)
JOURNALS = {"-wal": b"\x37\x7f\x06", "-journal": b"\xd9\xd5\x05\xf9"}  # of SQLite, and how they begin


def is_bag_folder(path: Path) -> bool:
    """Return whether a folder has a bag's metadata or, as an interrupted recording, nothing but its files."""
    if (path / METADATA).is_file():
        return True
    try:
        names = [entry.name for entry in path.iterdir()]
    except OSError:
        return False
    return bool(names) and all(any(ending in name for ending in FILES) for name in names)


def open_ros2(path: Path) -> AbstractContextManager[BagSource]:
    """Open a ROS 2 bag. InputError when it is damaged, or its recording was interrupted."""
    require_ros(path)
    for file in _files_in(path):
        _refuse_journal(file)
    if path.is_dir() and (path / METADATA).is_file():
        read_bounded(path / METADATA, "the metadata of a bag", MOST_METADATA)
    opened = _folder_or_file(path)
    return open_mcap(opened) if is_mcap(opened) else _open_rosbag2(opened)


def _files_in(path: Path) -> list[Path]:
    """Return the files that hold a bag's messages, by name; a file is its own."""
    if not path.is_dir():
        return [path]
    return sorted(file for file in path.iterdir() if file.name.endswith((*FILES, *COMPRESSED)))


def part_of(path: Path) -> str:
    """Return a remark if a file is one of several of a recording; "" if not."""
    files = _files_in(path.parent) if (path.parent / METADATA).is_file() else []
    if path not in files or len(files) < 2:
        return ""
    return (
        f"this is one of {len(files)} files of the recording in {path.parent}: name that folder to read all"
    )


def _folder_or_file(path: Path) -> Path:
    """Return a folder with metadata, else its only file. InputError if that cannot be opened alone."""
    if path.is_file():
        if path.name.endswith(COMPRESSED):
            fault = "found a compressed file, expected a plain one"
            advice = f"name its folder, or decompress it with `zstd -d {path.name}`"
            raise InputError(path, f"{fault}; {advice}")
        return path
    if (path / METADATA).is_file():
        return path
    files = _files_in(path)
    if len(files) == 1:
        return _folder_or_file(files[0])
    fault = f"found {len(files)} files of a bag and no {METADATA}, expected it"
    raise InputError(path, f"{fault}; create it with `ros2 bag reindex {path.name}`")


def _refuse_journal(file: Path) -> None:
    """Refuse a database with pages still in a journal beside it, which readers would ignore silently."""
    for ending, magic in JOURNALS.items():
        beside = file.with_name(f"{file.name}{ending}")
        if starts_with(beside, magic):
            fault = f"found {beside.stat().st_size} bytes of it in {beside.name}, expected a closed file"
            merge = f"merge them with `sqlite3 {file.name} 'PRAGMA quick_check'`"
            raise InputError(file, f"{fault}; was the recording killed? {merge}")


def _open_rosbag2(path: Path) -> AbstractContextManager[BagSource]:
    from rosbags.rosbag2.reader import DirectoryReader
    from rosbags.rosbag2.storage_sqlite3 import Sqlite3Reader

    folder, repair = path.is_dir(), _ros2_repair(path)
    packed = any(file.name.endswith(COMPRESSED) for file in _files_in(path))  # which no reindexing reads
    rebuild = f"rebuild {METADATA} with `ros2 bag reindex {path.name}`, or " if folder and not packed else ""
    make = (lambda: DirectoryReader(path)) if folder else (lambda: Sqlite3Reader(path.absolute()))
    return _opened(path, make, rebuild + repair, repair, ros1=False)


def _ros2_repair(path: Path) -> str:
    names = [file.name for file in _files_in(path)]
    name = names[0] if len(names) == 1 else "FILE"
    unpack = ""
    if names and names[0].endswith(COMPRESSED):
        part = f"part{Path(names[0]).with_suffix('').suffix}"
        unpack, name = f"unpack what is left of it with `zstd -dc {name} > {part}`, then ", part
    if names and ".mcap" not in names[0]:
        return f"{unpack}repair it with `sqlite3 {name} .recover | sqlite3 repaired.db3`"
    return unpack + mcap_repair(name)


@contextmanager
def _opened(
    path: Path, make: Callable[[], RosReader], advice: str, repair: str, *, ros1: bool
) -> Iterator[BagSource]:
    with bag_errors(path, advice):
        reader = make()
        reader.open()
    try:
        yield _RosBag(path, reader, repair, ros1=ros1)
    finally:
        with suppress(Exception):  # a damaged database may refuse to be closed
            reader.close()


class _RosBag:
    def __init__(self, path: Path, reader: RosReader, repair: str, *, ros1: bool) -> None:
        self._path, self._reader, self._repair, self._ros1 = path, reader, repair, ros1
        files = Counter[tuple[str, str]]()  # of a split bag, whose metadata may count one file's messages
        for storage in getattr(reader, "storages", ()):
            files.update({(part.topic, part.msgtype): part.msgcount for part in storage.connections})
        self.topics = sorted_topics(
            [
                Topic(
                    each.topic, short_type(each.msgtype), files.get((each.topic, each.msgtype), each.msgcount)
                )
                for each in reader.connections
            ]
        )

    def messages(self, names: Collection[str]) -> Iterator[Message]:
        connections = [connection for connection in self._reader.connections if connection.topic in names]
        if not connections:  # which the library takes for all
            return
        with bag_errors(self._path, self._repair):
            for connection, log_ns, data in self._reader.messages(connections):
                content = bytes(memoryview(data))  # a damaged row may hold anything
                decode = partial(self._decode, connection, content)
                yield Message(connection.topic, short_type(connection.msgtype), int(log_ns), decode)

    def _decode(self, connection: Connection, data: bytes) -> Any:
        kind, definition = connection.msgtype, connection.msgdef
        with bag_errors(self._path):
            if self._ros1:
                return decode_ros1(data, kind, definition.data)
            return decode_cdr(data, kind, definition.data, definition.format.name.lower())


# Which kind a file is, by content before name.


ROS1_ANY = b"#ROSBAG V"  # of any version
SQLITE_MAGIC = b"SQLite format 3\0"


def looks_like_rosbag1(path: Path) -> bool:
    """Return whether a file begins as ROS 1 bags do, or is named like one."""
    return starts_with(path, ROS1_ANY) or (path.suffix == ".bag" and path.is_file())


def looks_like_rosbag2(path: Path) -> bool:
    """Return whether a folder is a ROS 2 bag, or a file is its database."""
    if path.is_dir():
        return is_bag_folder(path)
    return path.name.endswith((".db3", *COMPRESSED)) or starts_with(path, SQLITE_MAGIC)


def looks_like_mcap(path: Path) -> bool:
    """Return whether a file begins as MCAP does, or is named like it."""
    return is_mcap(path) or (path.suffix == ".mcap" and path.is_file())


def looks_like_bag(path: Path) -> bool:
    """Return whether a file or folder is a bag of any kind."""
    return looks_like_rosbag1(path) or looks_like_rosbag2(path) or looks_like_mcap(path)
