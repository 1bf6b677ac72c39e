"""Reading a ROS 1 bag chunk by chunk.

`rosbags` keeps an entry of every message of every topic, gigabytes for hours of an inertial unit, and refuses
bags that were not closed; it decodes the messages (`ros_types`).
"""

from __future__ import annotations

import bz2
import struct
from collections import Counter
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import BinaryIO

from ..errors import InputError
from .bag_merge import merged
from .source import BagCut, BagError, BagFile

# The parts of a ROS 1 bag, version 2.0 (http://wiki.ros.org/Bags/Format/2.0): numbers are little-endian.

MAGIC = b"#ROSBAG V2.0\n"
MESSAGE, BAG_HEADER, INDEX, CHUNK, CHUNK_INFO, CONNECTION = range(2, 8)
MOST_BYTES = 2**30  # of one record or one unpacked chunk; writers stay far below
Fields = dict[str, bytes]


@dataclass(frozen=True, slots=True)
class BagConnection:
    """One publisher of a topic."""

    id: int
    topic: str
    type: str  # "nav_msgs/Odometry"
    definition: str  # of the type, with all that it is made of


@dataclass(frozen=True, slots=True)
class ChunkInfo:
    """Where a chunk stands, when its messages were recorded, and how many each connection has in it."""

    start_ns: int
    at: int
    counts: dict[int, int]


def number(fields: Fields, name: str, size: int) -> int:
    """Read an unsigned number of a record's header. BagError where it is missing."""
    value = fields.get(name, b"")
    if len(value) != size:
        raise BagError(f"found a record without a sound {name!r}, expected one")
    return int.from_bytes(value, "little")


def time_ns(fields: Fields, name: str) -> int:
    """Read a time of a record's header, in nanoseconds."""
    value = number(fields, name, 8)
    return (value & 0xFFFFFFFF) * 10**9 + (value >> 32)


def text(fields: Fields, name: str) -> str:
    """Read a text of a record's header; bytes that are no UTF-8 are replaced."""
    return fields.get(name, b"").decode(errors="replace")


def parse_fields(data: bytes) -> Fields:
    """Read the name=value pairs of a header. BagError where it is damaged."""
    fields, at = Fields(), 0
    while at < len(data):
        size = int.from_bytes(data[at : at + 4], "little")
        name, equals, value = data[at + 4 : at + 4 + size].partition(b"=")
        if not equals or at + 4 + size > len(data):
            raise BagError("found a damaged record header, expected name=value pairs")
        fields[name.decode(errors="replace")] = value
        at += 4 + size
    return fields


def record_at(file: BinaryIO, at: int, end: int, *, skip: tuple[int, ...] = ()) -> tuple[Fields, bytes, int]:
    """Read the record at a place of a file: header, data, and where the next one begins.

    The data of the kinds to skip are not read. BagCut where the file ends within it.
    """
    head_bytes = _size_at(file, at, end)
    fields = parse_fields(file.read(head_bytes))
    data_at = at + 4 + head_bytes
    data_bytes = _size_at(file, data_at, end)
    skipped = kind(fields) in skip
    return fields, b"" if skipped else file.read(data_bytes), data_at + 4 + data_bytes


def kind(fields: Fields) -> int:
    """Tell what a record is."""
    return number(fields, "op", 1)


def inner_records(data: bytes) -> Iterator[tuple[Fields, memoryview]]:
    """Give the records within an unpacked chunk: header and data."""
    whole, at = memoryview(data), 0
    while at < len(whole):
        parts = []
        for _ in range(2):
            size = int.from_bytes(whole[at : at + 4], "little")
            if at + 4 + size > len(whole):
                raise BagError("found a record that is larger than its chunk")
            parts.append(whole[at + 4 : at + 4 + size])
            at += 4 + size
        yield parse_fields(bytes(parts[0])), parts[1]


def read_connection(fields: Fields, data: bytes | memoryview) -> BagConnection:
    """Read a connection."""
    about = parse_fields(bytes(data))
    parts = text(fields, "topic").split("/")
    topic = ("/" if parts[0] == "" else "") + "/".join(part for part in parts if part)
    key = number(fields, "conn", 4)
    return BagConnection(key, topic, text(about, "type"), text(about, "message_definition"))


def read_chunk_info(fields: Fields, data: bytes) -> ChunkInfo:
    """Read where a chunk is and what it holds."""
    pairs = data[: len(data) // 8 * 8]
    counts = dict(struct.iter_unpack("<II", pairs))
    return ChunkInfo(time_ns(fields, "start_time") if counts else 0, number(fields, "chunk_pos", 8), counts)


def unpack_chunk(fields: Fields, data: bytes) -> bytes:
    """Give the records of a chunk. BagError where it is damaged or packed in an unknown way."""
    size, packing = number(fields, "size", 4), text(fields, "compression")
    if size > MOST_BYTES:
        raise BagError(f"found a chunk of {size} bytes, expected at most {MOST_BYTES}")
    try:
        if packing == "bz2":
            data = bz2.BZ2Decompressor().decompress(data, max_length=size)
        elif packing == "lz4":
            frame = import_module("lz4.frame")  # which has no types
            data = frame.LZ4FrameDecompressor().decompress(data, max_length=size)
        elif packing != "none":
            raise BagError(f"found a chunk packed with {packing!r}, expected bz2, lz4 or none")
    except (RuntimeError, EOFError, OSError) as problem:
        raise BagError(f"found a chunk that cannot be unpacked ({problem})") from None
    if len(data) != size:
        raise BagError(f"found a chunk of {len(data)} bytes, expected {size}")
    return data


def _size_at(file: BinaryIO, at: int, end: int) -> int:
    """Read the length that stands at a place, and check that so much follows."""
    file.seek(at)
    size = int.from_bytes(file.read(4), "little")
    if at + 4 > end or at + 4 + size > end:
        raise BagCut(f"ends at byte {end}, within a record at byte {at}")
    if size > MOST_BYTES:
        raise BagError(f"found a record of {size} bytes at byte {at}, expected at most {MOST_BYTES}")
    return size


# Reading a ROS 1 bag chunk by chunk: only where the chunks are is kept, however many messages there are.

Data = bytes | memoryview
Held = tuple[BagConnection, int, Data]  # who published it, the time of recording in ns, bytes in a chunk
Records = Iterator[tuple[Fields, Data]]


class Ros1File(BagFile[BagConnection]):
    """A ROS 1 bag. `BagFile` says how it is used."""

    whole = "a whole bag"
    mends = "`rosbag reindex`"
    advice = "was it copied whole?"

    def __init__(self, path: Path, *, keep_going: bool = False) -> None:
        super().__init__(path, keep_going=keep_going)
        self.connections: dict[int, BagConnection] = {}
        self.counts: Counter[int] = Counter()  # messages, by the connection's number
        self._chunks: list[ChunkInfo] = []
        self._begin = 0

    def _held(self, wanted: Collection[int]) -> Iterator[Held]:
        return self._indexed(wanted) if self._chunks else self._scanned(wanted)

    def _open(self) -> None:
        if self._file.read(len(MAGIC)) != MAGIC:
            raise InputError(self.path, "found no ROS 1 bag of version 2.0, expected one")
        fields, _, self._begin = record_at(self._file, len(MAGIC), self._size)
        if kind(fields) != BAG_HEADER:
            raise BagError("found no bag header, expected one")
        if fields.get("encryptor"):
            raise InputError(self.path, "found an encrypted bag, expected one that was decrypted")
        try:
            self._read_index(number(fields, "index_pos", 8))
        except BagError as problem:
            if not self._keep_going:
                raise
            self.cut = str(problem)
            self._chunks.clear()
            self._count()

    def _read_index(self, at: int) -> None:
        if not self._begin <= at <= self._size:
            raise BagCut(f"ends at byte {self._size} without an index; was the recording ended properly?")
        while at < self._size:
            fields, data, at = record_at(self._file, at, self._size)
            if kind(fields) == CHUNK_INFO:
                info = read_chunk_info(fields, data)
                self._chunks.append(info)
                self.counts.update(info.counts)
            else:
                self._learn(fields, data)
        self._chunks.sort(key=lambda info: (info.start_ns, info.at))

    def _learn(self, fields: Fields, data: Data) -> None:
        """Take in a connection; one that comes again is the same."""
        if kind(fields) == CONNECTION:
            connection = read_connection(fields, data)
            self.connections.setdefault(connection.id, connection)

    def _count(self) -> None:
        """Count the messages of a bag without a sound index, as far as it goes."""
        self.counts.clear()
        try:
            for connection, _, _ in self._scanned(None):
                self.counts[connection.id] += 1
        except BagError:
            return

    def _indexed(self, wanted: Collection[int]) -> Iterator[Held]:
        chunks = [
            (info.start_ns, info.at) for info in self._chunks if not info.counts.keys().isdisjoint(wanted)
        ]
        return merged(chunks, lambda at: self._chunk_at(at, wanted), lambda message: message[1])

    def _chunk_at(self, at: int, wanted: Collection[int]) -> Iterator[Held]:
        return self._sound(at, self._messages(self._indexed_records(at), wanted))

    def _indexed_records(self, at: int) -> Records:
        fields, data, _ = record_at(self._file, at, self._size)
        if kind(fields) != CHUNK:
            raise BagError("found another record there, expected the chunk of the index")
        yield from _unpacked(fields, data)

    def _scanned(self, wanted: Collection[int] | None) -> Iterator[Held]:
        """Go through all messages in the order in which they were written."""
        following = self._begin
        while following < self._size:
            at = following
            fields, data, following = record_at(self._file, at, self._size, skip=(INDEX, CHUNK_INFO))
            if kind(fields) == CHUNK:
                yield from self._sound(at, self._messages(_unpacked(fields, data), wanted))
            else:
                yield from self._messages([(fields, data)], wanted)

    def _messages(
        self, records: Iterable[tuple[Fields, Data]], wanted: Collection[int] | None
    ) -> Iterator[Held]:
        """Give the messages among some records, and take in the connections."""
        for fields, data in records:
            self._learn(fields, data)
            if kind(fields) != MESSAGE:
                continue
            key = number(fields, "conn", 4)
            if key not in self.connections:
                raise BagError(f"found a message of connection {key}, which is not described")
            if wanted is None or key in wanted:
                yield self.connections[key], time_ns(fields, "time"), data


def _unpacked(fields: Fields, data: bytes) -> Records:
    """Give the records of a chunk, which is unpacked when the first is asked for."""
    yield from inner_records(unpack_chunk(fields, data))
