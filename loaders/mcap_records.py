"""The parts of an MCAP file, as https://mcap.dev/spec has them: numbers are little-endian."""

from __future__ import annotations

import struct
import sys
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import import_module
from typing import BinaryIO

from .bag_file import BagCut, BagError

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
