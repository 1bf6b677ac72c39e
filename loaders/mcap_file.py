"""Reading an MCAP file, whatever its messages are: its channels at once, its messages lazily.

Chunks are unpacked one at a time, or as many as overlap in time.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator
from pathlib import Path

from .bag_file import BagCut, BagError, BagFile
from .bag_merge import merged
from .errors import LogError
from .mcap_records import (
    CHANNEL,
    CHUNK,
    CHUNK_INDEX,
    DATA_END,
    FOOTER,
    HEADER,
    MAGIC,
    MESSAGE,
    SCHEMA,
    STATISTICS,
    Channel,
    ChunkIndex,
    Cursor,
    Schema,
    inner_records,
    read_channel,
    read_chunk_index,
    read_counts,
    read_schema,
    records,
    unpack_chunk,
)

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
            raise LogError(self.path, "found no MCAP file, expected one; is it another format?")
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
