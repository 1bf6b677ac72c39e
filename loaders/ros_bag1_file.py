"""Reading a ROS 1 bag chunk by chunk: only where the chunks are is kept, however many messages there are.

`rosbags` keeps an entry of every message of every topic, gigabytes for hours of an inertial unit, and refuses
bags that were not closed; it decodes the messages (`ros_types`).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Iterator
from pathlib import Path

from .bag_file import BagCut, BagError, BagFile
from .bag_merge import merged
from .errors import LogError
from .ros_bag1_records import (
    BAG_HEADER,
    CHUNK,
    CHUNK_INFO,
    CONNECTION,
    INDEX,
    MAGIC,
    MESSAGE,
    BagConnection,
    ChunkInfo,
    Fields,
    inner_records,
    kind,
    number,
    read_chunk_info,
    read_connection,
    record_at,
    time_ns,
    unpack_chunk,
)

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
            raise LogError(self.path, "found no ROS 1 bag of version 2.0, expected one")
        fields, _, self._begin = record_at(self._file, len(MAGIC), self._size)
        if kind(fields) != BAG_HEADER:
            raise BagError("found no bag header, expected one")
        if fields.get("encryptor"):
            raise LogError(self.path, "found an encrypted bag, expected one that was decrypted")
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
