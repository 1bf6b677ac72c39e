"""MCAP files of any profile, through `mcap`: ROS 2 (CDR), ROS 1, JSON and protobuf messages."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, TypeAlias

from ..errors import InputError
from .decoding import ENCODINGS, MOST_BYTES, decode
from .source import BagSource, Message, Topic, bag_errors, require_ros, short_type, sorted_topics, starts_with

if TYPE_CHECKING:
    from mcap.reader import McapReader
    from mcap.records import Channel, Schema
    from mcap.records import Message as McapMessage
    from mcap.summary import Summary

    Record: TypeAlias = tuple[Schema | None, Channel, McapMessage]

MAGIC = b"\x89MCAP0\r\n"


def is_mcap(path: Path) -> bool:
    """Return whether a file begins as MCAP does."""
    return starts_with(path, MAGIC)


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
        file.seek(-len(MAGIC), 2)
        if file.read() != MAGIC:
            raise ValueError(f"it ends at byte {file.tell()} without its footer")
        summary = self._reader().get_summary()
        if summary is not None and not _complete(summary):
            summary = None
        self._indexed = summary is not None and bool(summary.chunk_indexes)
        if summary is None or summary.statistics is None:
            found = self._counted()
        else:
            counts = summary.statistics.channel_message_counts
            pairs = [(one, summary.schemas.get(one.schema_id)) for one in summary.channels.values()]
            found = [_topic(schema, channel, counts.get(channel.id, 0)) for channel, schema in pairs]
        self.topics = sorted_topics(found)

    def messages(self, names: Collection[str]) -> Iterator[Message]:
        """Yield the messages of these topics by recording time."""
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
        """Count the messages of a file without statistics."""
        found = dict[int, Topic]()
        counts = Counter[int]()
        for schema, channel, _ in self._records(None):
            counts[channel.id] += 1
            found[channel.id] = _topic(schema, channel, counts[channel.id])
        return list(found.values())

    def _decode(self, schema: Schema | None, channel: Channel, data: bytes) -> Any:
        named = ("", b"", "") if schema is None else (schema.name, schema.data, schema.encoding)
        with bag_errors(self._path):
            return decode(data, channel.message_encoding, *named)


def _complete(summary: Summary) -> bool:
    """Return whether a summary repeats all channels and schemas, which writers may leave out."""
    if any(one.uncompressed_size > MOST_BYTES for one in summary.chunk_indexes):
        raise ValueError(f"a chunk of more than {MOST_BYTES} bytes")
    used = {number for one in summary.chunk_indexes for number in one.message_index_offsets}
    if summary.statistics is not None:
        used |= summary.statistics.channel_message_counts.keys()
    schemas = {one.schema_id for one in summary.channels.values()} - {0}
    return bool(summary.channels) and used <= summary.channels.keys() and schemas <= summary.schemas.keys()


def _topic(schema: Schema | None, channel: Channel, count: int) -> Topic:
    known = channel.message_encoding in ENCODINGS
    unreadable = "" if known else f"its messages are encoded as {channel.message_encoding!r}"
    return Topic(channel.topic, short_type("" if schema is None else schema.name), count, unreadable)
