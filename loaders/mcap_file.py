"""Reading an MCAP file, whatever its messages are: its channels at once, its messages lazily.

Chunks are unpacked one at a time, or as many as overlap in time.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import BinaryIO

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
    McapCut,
    McapError,
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
Message = tuple[Channel, int, bytes]  # its channel, the time of recording in ns, its bytes
Held = tuple[Channel, int, memoryview]  # the same, not yet copied out of its chunk


class McapFile:
    """An MCAP file; a context manager, and read lazily as often as one likes.

    Raises LogError for what is no MCAP file and for a file that is cut; with `keep_going` a cut file is read
    as far as it goes, and `cut` says where it ends.
    """

    def __init__(self, path: Path, *, keep_going: bool = False) -> None:
        self.path = path
        self.profile = ""
        self.channels: dict[int, Channel] = {}
        self.counts: Counter[int] = Counter()  # messages, by the channel's number
        self.cut: str | None = None  # what is missing, in words; None: the file is whole
        self._schemas: dict[int, Schema] = {}
        self._chunks: list[ChunkIndex] = []
        self._keep_going = keep_going

    def __enter__(self) -> McapFile:
        """Open the file and read what it says of itself."""
        try:
            self._file: BinaryIO = self.path.open("rb")
        except OSError as problem:
            raise LogError(self.path, f"cannot be read: {problem.strerror}") from None
        try:
            self._open()
        except (McapError, OSError, MemoryError) as problem:
            self._file.close()
            raise LogError(self.path, self._broken(problem)) from None
        except LogError:
            self._file.close()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        """Close the file."""
        self._file.close()

    def messages(self, wanted: Collection[int]) -> Iterator[Message]:
        """Give the messages of these channels, by the time of recording where the file has an index.

        LogError where the file is damaged, or cut and not kept going.
        """
        going = self._indexed(wanted) if self._chunks else self._scanned(wanted)
        while True:
            try:
                message = next(going, None)
            except McapCut as problem:
                if self._keep_going:
                    return
                raise LogError(self.path, self._broken(problem)) from None
            except (McapError, OSError, MemoryError) as problem:
                raise LogError(self.path, self._broken(problem)) from None
            if message is None:
                return
            channel, log_ns, data = message
            yield channel, log_ns, bytes(data)

    def _broken(self, problem: Exception) -> str:
        advice = "`mcap recover` mends what can be mended"
        if isinstance(problem, McapCut):
            advice = f"--keep-going reads it as far as it goes, {advice}"
        return f"{problem or type(problem).__name__}; expected a whole MCAP file; {advice}"

    def _open(self) -> None:
        if self._file.read(len(MAGIC)) != MAGIC:
            raise LogError(self.path, "found no MCAP file, expected one; is it another format?")
        self._size = self._file.seek(0, 2)
        self._data_end = self._size
        for kind, _, body in records(self._file, len(MAGIC), self._size):
            if kind == HEADER:
                self.profile = Cursor(body).text()
            break
        summary = self._summary_start()
        if summary:
            self._read_summary(summary)
        if not summary or not self.channels or (self._chunks and not self.counts):
            self._scan_whole()

    def _summary_start(self) -> int:
        """Give where the summary begins; 0 when there is none, or the file is cut."""
        at = self._size - FOOTER_BYTES
        self._file.seek(max(at, 0))
        footer = self._file.read()
        if at < len(MAGIC) or footer[-len(MAGIC) :] != MAGIC or footer[0] != FOOTER:
            self.cut = f"ends at byte {self._size} without the footer"
            if not self._keep_going:
                raise McapCut(self.cut)
            return 0
        self._data_end = at
        start = int.from_bytes(footer[9:17], "little")
        if start and not len(MAGIC) <= start <= at:
            raise McapError(f"found a summary at byte {start} of {self._size}, expected it inside the file")
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
        except McapCut as problem:
            self.cut = str(problem)
            if not self._keep_going:
                raise

    def _scanned(self, wanted: Collection[int] | None) -> Iterator[Held]:
        """Go through the data in the order in which it was written."""
        for kind, _, body in records(self._file, len(MAGIC), self._data_end):
            if kind == DATA_END:
                return
            if kind == CHUNK:
                yield from self._in_chunk(body, wanted)
            elif kind == MESSAGE:
                yield from self._message(Cursor(body), wanted)
            else:
                self._learn(kind, Cursor(body))

    def _indexed(self, wanted: Collection[int]) -> Iterator[Held]:
        chunks = [(chunk.start_ns, chunk.offset) for chunk in self._chunks]
        return merged(
            chunks, lambda at: self._in_chunk(self._chunk_at(at), wanted), lambda message: message[1]
        )

    def _chunk_at(self, offset: int) -> bytes:
        kind, _, body = next(records(self._file, offset, self._data_end), (0, 0, b""))
        if kind != CHUNK:
            raise McapError(f"found no chunk at byte {offset}, expected the one of the index")
        return body

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
            raise McapError(f"found a message of channel {number}, which is not described")
        record.take(4)
        log_ns = record.number(8)
        record.take(8)
        yield self.channels[number], log_ns, record.rest()
