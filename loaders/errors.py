"""The one error that bad files raise: a line a person can act on."""

from __future__ import annotations

from pathlib import Path


class InputError(Exception):
    """A file that is not what it should be: what was found, where, what was expected, what to do.

    `str()` is one line without a traceback's help: `session.log:17: found ..., expected ...; what to do`.
    """

    def __init__(self, file: Path, message: str, line: int | None = None) -> None:
        message = " ".join(message.splitlines())  # one line, whatever names and system messages hold
        place = f"{file}" if line is None else f"{file}:{line}"
        super().__init__(f"{place}: {message}")
        self.file = file
        self.line = line  # counted from 1; None when the matter is the whole file
        self.message = message


class SourceError(InputError):
    """As InputError, of a source that is no file: its name is kept as it was typed."""

    def __init__(self, name: str, message: str, line: int | None = None) -> None:
        super().__init__(Path(name), message, line)
        self.args = (f"{name}{'' if line is None else f':{line}'}: {self.message}",)
