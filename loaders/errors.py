"""The errors that bad input raises: `InputError` of `maurice_mcl.errors` and its kinds."""

from __future__ import annotations

from pathlib import Path

from maurice_mcl.errors import InputError as InputError


class SourceError(InputError):
    """Bad input from a source that is not a file; its name is kept as it was typed."""

    def __init__(self, name: str, message: str, line: int | None = None) -> None:
        super().__init__(Path(name), message, line)
        self.args = (f"{name}{'' if line is None else f':{line}'}: {self.message}",)


class BadValueError(InputError, ValueError):
    """A bad value; the caller that knows the file adds it."""

    def __init__(self, message: str) -> None:
        super().__init__(None, message)


class FieldError(BadValueError):
    """A value of the wrong type or shape."""


class PictureError(BadValueError):
    """A picture that is missing, damaged or of an unsupported format."""
