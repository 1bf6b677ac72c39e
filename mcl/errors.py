"""The error that bad input raises, in every package: one line that a person can act on."""

from __future__ import annotations

from pathlib import Path
from typing import Any

MOST_CHARACTERS = 2000  # of a message


class InputError(Exception):
    """Input that is not what it should be: what was found, where, what was expected, what to do.

    `str()` is one line: `session.log:17: found ..., expected ...; what to do`.

        >>> import maurice_mcl as mcl
        >>> str(mcl.InputError(None, "particles: found -1, expected a whole number from 1 to 10000000"))
        'particles: found -1, expected a whole number from 1 to 10000000'
    """

    def __init__(self, file: Path | None, message: str, line: int | None = None) -> None:
        """Take the file (None for values from no file) and the line, counted from 1."""
        message = " ".join(message.splitlines())  # one line, whatever names and system messages contain
        if len(message) > MOST_CHARACTERS:  # of a value that was found
            message = f"{message[: MOST_CHARACTERS // 2]} ... {message[-MOST_CHARACTERS // 2 :]}"
        place = f"{file or ''}" if line is None else f"{file}:{line}"
        super().__init__(f"{place}: {message}" if place else message)
        self.file = file
        self.line = line  # None when the error concerns the entire file
        self.message = message

    def __reduce__(self) -> tuple[Any, ...]:
        """Let the error come back from a worker process: subclasses take other arguments than `args`."""
        return _again, (type(self), self.args), self.__dict__


def _again(kind: type[InputError], args: tuple[Any, ...]) -> InputError:
    made = kind.__new__(kind, *args)
    made.args = args
    return made
