"""ROS 2 bags, through `rosbags`: a folder with metadata.yaml, or one file of messages."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import InputError
from .decoding import decode_cdr
from .mcap import is_mcap, mcap_repair, open_mcap
from .source import BagSource, Message, Topic, bag_errors, require_ros, short_type, sorted_topics, starts_with

if TYPE_CHECKING:
    from rosbags.interfaces import Connection
    from rosbags.rosbag2.reader import DirectoryReader
    from rosbags.rosbag2.storage_sqlite3 import Sqlite3Reader

METADATA = "metadata.yaml"
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
    opened = _folder_or_file(path)
    return open_mcap(opened) if is_mcap(opened) else _open(opened)


def _files_in(path: Path) -> list[Path]:
    """Return the files that hold a bag's messages, by name; a file is its own."""
    if not path.is_dir():
        return [path]
    return sorted(file for file in path.iterdir() if file.name.endswith((*FILES, *COMPRESSED)))


def _folder_or_file(path: Path) -> Path:
    """Return a folder with metadata, else its only file. InputError where that cannot be opened alone."""
    if path.is_file():
        if path.name.endswith(COMPRESSED):
            found = "found a compressed file, expected a plain one"
            raise InputError(path, f"{found}; decompress it with `zstd -d {path.name}`")
        return path
    if (path / METADATA).is_file():
        return path
    files = _files_in(path)
    if len(files) == 1:
        return _folder_or_file(files[0])
    found = f"found {len(files)} files of a bag and no {METADATA}, expected it"
    raise InputError(path, f"{found}; create it with `ros2 bag reindex {path.name}`")


def _refuse_journal(file: Path) -> None:
    """Refuse a database with pages still in a journal beside it, which readers would ignore silently."""
    for ending, magic in JOURNALS.items():
        beside = file.with_name(f"{file.name}{ending}")
        if starts_with(beside, magic):
            found = f"found {beside.stat().st_size} bytes of it in {beside.name}, expected a closed file"
            merge = f"merge them with `sqlite3 {file.name} 'PRAGMA quick_check'`"
            raise InputError(file, f"{found}; was the recording killed? {merge}")


@contextmanager
def _open(path: Path) -> Iterator[BagSource]:
    from rosbags.rosbag2.reader import DirectoryReader
    from rosbags.rosbag2.storage_sqlite3 import Sqlite3Reader

    folder = path.is_dir()
    repair = _repair(path)
    rebuild = f"rebuild {METADATA} with `ros2 bag reindex {path.name}`, or " if folder else ""
    with bag_errors(path, rebuild + repair):
        reader = DirectoryReader(path) if folder else Sqlite3Reader(path.absolute())
        reader.open()
    try:
        yield _Ros2Bag(path, reader, repair)
    finally:
        with suppress(Exception):  # a damaged database may refuse to be closed
            reader.close()


def _repair(path: Path) -> str:
    """Return the command that repairs a bag, by what its messages are stored in."""
    names = [file.name for file in _files_in(path)]
    name = names[0] if len(names) == 1 else "FILE"
    if names and not names[0].endswith(".mcap"):
        return f"repair it with `sqlite3 {name} .recover | sqlite3 repaired.db3`"
    return mcap_repair(name)


class _Ros2Bag:
    """An open ROS 2 bag."""

    def __init__(self, path: Path, reader: DirectoryReader | Sqlite3Reader, repair: str) -> None:
        self._path, self._reader, self._repair = path, reader, repair
        self.topics = sorted_topics(
            [Topic(one.topic, short_type(one.msgtype), one.msgcount) for one in reader.connections]
        )

    def messages(self, names: Collection[str]) -> Iterator[Message]:
        """Yield the messages of these topics by recording time."""
        wanted = [one for one in self._reader.connections if one.topic in names]
        if not wanted:  # which the library takes for all
            return
        with bag_errors(self._path, self._repair):
            for one, log_ns, data in self._reader.messages(wanted):
                held = bytes(memoryview(data))  # a damaged row may hold anything
                decode = partial(self._decode, one, held)
                yield Message(one.topic, short_type(one.msgtype), int(log_ns), decode)

    def _decode(self, connection: Connection, data: bytes) -> Any:
        definition, form = connection.msgdef.data, connection.msgdef.format.name.lower()
        with bag_errors(self._path):
            return decode_cdr(data, connection.msgtype, definition, form)
