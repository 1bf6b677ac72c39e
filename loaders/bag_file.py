"""A bag in one file: how it is opened and read, and what is said where it is damaged."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import BinaryIO, ClassVar, Generic, Self, TypeVar

from .errors import LogError

Source = TypeVar("Source")  # what a message came from: a channel, a connection


class BagError(ValueError):
    """What is wrong with the bytes of a bag."""


class BagCut(BagError):
    """The file ends in the middle of a record, or without its index."""


BROKEN = (BagError, OSError, MemoryError)  # what a damaged file leads to


class BagFile(ABC, Generic[Source]):
    """A bag; a context manager, and read lazily as often as one likes.

    Raises LogError for what is no such file or damaged, and for one that is cut; with `keep_going` a cut file
    is read as far as it goes.
    """

    whole: ClassVar[str]  # what was expected, for errors
    mends: ClassVar[str]  # the command that mends a file that is cut
    advice: ClassVar[str]  # what to do of other damage

    def __init__(self, path: Path, *, keep_going: bool = False) -> None:
        self.path = path
        self.cut = ""  # what is missing of a file that is read all the same
        self._keep_going = keep_going
        self._size = 0

    def __enter__(self) -> Self:
        """Open the file and read what it says of itself."""
        try:
            self._file: BinaryIO = self.path.open("rb")
        except OSError as problem:
            raise LogError(self.path, f"cannot be read: {problem.strerror}") from None
        try:
            self._size = self._file.seek(0, 2)
            self._file.seek(0)
            self._open()
        except BROKEN as problem:
            self._file.close()
            raise self._refusal(problem) from None
        except LogError:
            self._file.close()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        """Close the file."""
        self._file.close()

    def messages(self, wanted: Collection[int]) -> Iterator[tuple[Source, int, bytes]]:
        """Give messages by their source's number: source, time of recording in ns, bytes.

        They come by the time of recording where the file has an index, else as written. LogError where the
        file is damaged, or cut and not kept going.
        """
        try:
            for source, log_ns, data in self._held(wanted):
                yield source, log_ns, bytes(data)
        except BagCut as problem:
            if not self._keep_going:
                raise self._refusal(problem) from None
            self.cut = str(problem)
        except BROKEN as problem:
            raise self._refusal(problem) from None

    @abstractmethod
    def _open(self) -> None:
        """Read what the file says of itself."""

    @abstractmethod
    def _held(self, wanted: Collection[int]) -> Iterator[tuple[Source, int, bytes | memoryview]]:
        """Give messages not yet copied out of their chunk."""

    def _refusal(self, problem: Exception) -> LogError:
        advice = self.advice
        if isinstance(problem, BagCut):
            advice = f"{self.mends} mends it, --keep-going reads it as far as it goes"
        return LogError(
            self.path, f"{str(problem) or type(problem).__name__}; expected {self.whole}; {advice}"
        )
