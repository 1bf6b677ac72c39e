"""Reading an MCAP file: its channels at once, its messages as they are asked for.

Chunks are unpacked one at a time, or as many as overlap in time.
"""

from __future__ import annotations

import struct
import sys
import zlib
from collections import Counter
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import BinaryIO

from ..errors import InputError
from .bag_merge import merged
from .source import BagCut, BagError, BagFile

# The parts of an MCAP file, as https://mcap.dev/spec has them: numbers are little-endian.

MAGIC = b"\x89MCAP0\r\n"
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, CHUNK_INDEX, STATISTICS, DATA_END = (
    *range(1, 7),
    *(0x08, 0x0B, 0x0F),
)
KEPT = (HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, CHUNK_INDEX, STATISTICS, DATA_END)
ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
MOST_BYTES = 2**30  # of one record or one unpacked chunk; writers stay far below


class Cursor:
    """Reads the fields of one record from its beginning. BagCut where it ends too early."""

    def __init__(self, data: bytes | memoryview) -> None:
        self._data = memoryview(data)
        self.at = 0

    def take(self, size: int) -> memoryview:
        """Give so many bytes."""
        end = self.at + size
        if end > len(self._data):
            raise BagCut(f"found {len(self._data) - self.at} bytes in a record, expected {size}")
        part, self.at = self._data[self.at : end], end
        return part

    def number(self, size: int) -> int:
        """Give an unsigned number of so many bytes."""
        return int.from_bytes(self.take(size), "little")

    def text(self) -> str:
        """Give a text with its length before it."""
        try:
            return str(self.take(self.number(4)), "utf-8")
        except UnicodeDecodeError:
            raise BagError("found bytes that are no UTF-8, expected a name") from None

    def rest(self) -> memoryview:
        """Give what is left."""
        return self.take(len(self._data) - self.at)

    @property
    def more(self) -> bool:
        """Tell whether anything is left."""
        return self.at < len(self._data)


@dataclass(frozen=True, slots=True)
class Schema:
    """How the messages of a channel are built."""

    name: str
    encoding: str  # "jsonschema", "ros2msg", "ros1msg", "protobuf" ...; "" when there is none
    data: bytes


@dataclass(frozen=True, slots=True)
class Channel:
    """One stream of messages."""

    id: int
    topic: str
    encoding: str  # of the messages: "json", "cdr", "ros1", "protobuf" ...
    schema: Schema


@dataclass(frozen=True, slots=True)
class ChunkIndex:
    """Where a chunk stands, and the times of its messages."""

    start_ns: int
    end_ns: int
    offset: int  # of the chunk's record, with its first byte
    channels: frozenset[int]  # that have messages in it; empty: not told


NO_SCHEMA = Schema("", "", b"")


def records(file: BinaryIO, start: int, end: int) -> Iterator[tuple[int, int, bytes]]:
    """Give the records that stand between two places of a file: kind, place and body.

    Only kinds that matter are read, others skipped. BagCut where the file ends within one.
    """
    at = start
    while at < end:
        file.seek(at)
        head = file.read(9)
        if len(head) < 9:
            raise BagCut(f"ends at byte {at + len(head)}, within a record")
        kind, size = head[0], int.from_bytes(head[1:], "little")
        if at + 9 + size > end:
            raise BagCut(f"ends at byte {end}, within a record that begins at byte {at}")
        if kind in KEPT:
            if size > MOST_BYTES:
                raise BagError(f"found a record of {size} bytes at byte {at}, expected at most {MOST_BYTES}")
            yield kind, at, file.read(size)
        at += 9 + size


def inner_records(data: bytes | memoryview) -> Iterator[tuple[int, Cursor]]:
    """Give the records within an unpacked chunk or a summary."""
    whole = Cursor(data)
    while whole.more:
        kind, size = whole.number(1), whole.number(8)
        yield kind, Cursor(whole.take(size))


def read_schema(record: Cursor) -> tuple[int, Schema]:
    """Read a schema and its number."""
    number, name, encoding = record.number(2), record.text(), record.text()
    return number, Schema(name, encoding, bytes(record.take(record.number(4))))


def read_channel(record: Cursor, schemas: dict[int, Schema]) -> Channel:
    """Read a channel, with its schema."""
    number, schema, topic, encoding = record.number(2), record.number(2), record.text(), record.text()
    return Channel(number, topic, encoding, schemas.get(schema, NO_SCHEMA))


def read_chunk_index(record: Cursor) -> ChunkIndex:
    """Read where a chunk is."""
    start_ns, end_ns, offset, _length = struct.unpack("<QQQQ", record.take(32))
    return ChunkIndex(start_ns, end_ns, offset, frozenset(_by_channel(record)))


def read_counts(record: Cursor) -> dict[int, int]:
    """Read how many messages each channel has, from the statistics."""
    record.take(42)
    return _by_channel(record)


def _by_channel(record: Cursor) -> dict[int, int]:
    """Read a table with a number for every channel."""
    table = bytes(record.take(record.number(4)))
    if len(table) % 10:
        raise BagError(f"found a table of {len(table)} bytes, expected 10 a channel")
    return dict(struct.iter_unpack("<HQ", table))


def unpack_chunk(data: bytes) -> bytes | memoryview:
    """Give the records of a chunk. BagError where it is damaged or packed in an unknown way."""
    record = Cursor(data)
    record.take(16)
    size, checksum, packing = record.number(8), record.number(4), record.text()
    packed = record.take(record.number(8))
    if size > MOST_BYTES:
        raise BagError(f"found a chunk of {size} bytes, expected at most {MOST_BYTES}")
    unpacked = _unpack(packed, packing, size)
    if len(unpacked) != size:
        raise BagError(f"found a chunk of {len(unpacked)} bytes, expected {size}")
    if checksum and zlib.crc32(unpacked) != checksum:
        raise BagError("found a damaged chunk (checksum), expected a whole one")
    return unpacked


def _unpack(packed: memoryview, packing: str, size: int) -> bytes | memoryview:
    if packing == "":
        return packed
    if packing == "zstd":
        return unpack_zstd(packed, size)
    try:
        if packing == "lz4":
            frame = import_module("lz4.frame")  # which has no types
            return bytes(frame.LZ4FrameDecompressor().decompress(bytes(packed), max_length=size))
    except (RuntimeError, EOFError, ValueError, MemoryError) as problem:
        raise BagError(f"found a chunk that cannot be unpacked ({problem})") from None
    raise BagError(f"found a chunk packed with {packing!r}, expected lz4, zstd or none")


def unpack_zstd(packed: bytes | memoryview, size: int) -> bytes:
    """Unpack to so many bytes at most. BagError where it is damaged."""
    if sys.version_info >= (3, 14):
        from compression import zstd
    else:
        from backports import zstd
    try:
        return bytes(zstd.ZstdDecompressor().decompress(packed, max_length=size))
    except zstd.ZstdError as problem:
        raise BagError(f"found packed data that cannot be unpacked ({problem})") from None


# Reading an MCAP file, whatever its messages are: its channels at once, its messages lazily.

FOOTER_BYTES = 9 + 20 + len(MAGIC)
Held = tuple[Channel, int, memoryview]  # a channel, the time of recording in ns, bytes within a chunk


class McapFile(BagFile[Channel]):
    """An MCAP file. `BagFile` says how it is used."""

    whole = "a whole MCAP file"
    mends = "`mcap recover`"
    advice = "`mcap recover` mends what can be mended"

    def __init__(self, path: Path, *, keep_going: bool = False) -> None:
        super().__init__(path, keep_going=keep_going)
        self.profile = ""
        self.channels: dict[int, Channel] = {}
        self.counts: Counter[int] = Counter()  # messages, by the channel's number
        self._schemas: dict[int, Schema] = {}
        self._chunks: list[ChunkIndex] = []
        self._data_end = 0

    def _open(self) -> None:
        if self._file.read(len(MAGIC)) != MAGIC:
            raise InputError(self.path, "found no MCAP file, expected one; is it another format?")
        self._data_end = self._size
        for kind, _, body in records(self._file, len(MAGIC), self._size):
            if kind == HEADER:
                self.profile = Cursor(body).text()
            break
        try:
            summary = self._summary_start()
            if summary:
                self._read_summary(summary)
        except BagError as problem:
            if not self._keep_going:
                raise
            self.cut, summary = str(problem), 0
            self._chunks.clear()
        if not summary or not self.channels or (self._chunks and not self.counts):
            self._scan_whole()

    def _held(self, wanted: Collection[int]) -> Iterator[Held]:
        return self._indexed(wanted) if self._chunks else self._scanned(wanted)

    def _summary_start(self) -> int:
        """Give where the summary begins; 0 when there is none. BagCut where the file is cut."""
        at = self._size - FOOTER_BYTES
        self._file.seek(max(at, 0))
        footer = self._file.read()
        if at < len(MAGIC) or footer[-len(MAGIC) :] != MAGIC or footer[0] != FOOTER:
            raise BagCut(f"ends at byte {self._size} without the footer")
        self._data_end = at
        start = int.from_bytes(footer[9:17], "little")
        if start and not len(MAGIC) <= start <= at:
            raise BagError(f"found a summary at byte {start} of {self._size}, expected it inside the file")
        return start

    def _read_summary(self, start: int) -> None:
        end, self._data_end = self._data_end, start
        for kind, _, body in records(self._file, start, end):
            record = Cursor(body)
            if kind == CHUNK_INDEX:
                self._chunks.append(read_chunk_index(record))
            elif kind == STATISTICS:
                self.counts.update(read_counts(record))
            else:
                self._learn(kind, record)
        self._chunks.sort(key=lambda chunk: (chunk.start_ns, chunk.offset))

    def _learn(self, kind: int, record: Cursor) -> None:
        """Take in a schema or a channel; one that comes again is the same, and not read."""
        if kind == SCHEMA:
            number, schema = read_schema(record)
            self._schemas.setdefault(number, schema)
        elif kind == CHANNEL:
            channel = read_channel(record, self._schemas)
            self.channels.setdefault(channel.id, channel)

    def _scan_whole(self) -> None:
        """Count the messages of a file that does not say; what is cut off is left out."""
        self.counts.clear()
        try:
            for channel, _, _ in self._scanned(None):
                self.counts[channel.id] += 1
        except BagError as problem:
            self.cut = str(problem)
            if not self._keep_going:
                raise

    def _scanned(self, wanted: Collection[int] | None) -> Iterator[Held]:
        """Go through the data in the order in which it was written."""
        for kind, at, body in records(self._file, len(MAGIC), self._data_end):
            if kind == DATA_END:
                return
            if kind == CHUNK:
                yield from self._sound(at, self._in_chunk(body, wanted))
            elif kind == MESSAGE:
                yield from self._message(Cursor(body), wanted)
            else:
                self._learn(kind, Cursor(body))

    def _indexed(self, wanted: Collection[int]) -> Iterator[Held]:
        told = [one for one in self._chunks if not (one.channels and one.channels.isdisjoint(wanted))]
        chunks = [(chunk.start_ns, chunk.offset) for chunk in told]
        return merged(chunks, lambda at: self._chunk_at(at, wanted), lambda message: message[1])

    def _chunk_at(self, offset: int, wanted: Collection[int]) -> Iterator[Held]:
        return self._sound(offset, self._indexed_chunk(offset, wanted))

    def _indexed_chunk(self, offset: int, wanted: Collection[int]) -> Iterator[Held]:
        kind, _, body = next(records(self._file, offset, self._data_end), (0, 0, b""))
        if kind != CHUNK:
            raise BagError("found another record there, expected the chunk of the index")
        yield from self._in_chunk(body, wanted)

    def _in_chunk(self, body: bytes, wanted: Collection[int] | None) -> Iterator[Held]:
        for kind, record in inner_records(unpack_chunk(body)):
            if kind == MESSAGE:
                yield from self._message(record, wanted)
            else:
                self._learn(kind, record)

    def _message(self, record: Cursor, wanted: Collection[int] | None) -> Iterator[Held]:
        number = record.number(2)
        if wanted is not None and number not in wanted:
            return
        if number not in self.channels:
            raise BagError(f"found a message of channel {number}, which is not described")
        record.take(4)
        log_ns = record.number(8)
        record.take(8)
        yield self.channels[number], log_ns, record.rest()
