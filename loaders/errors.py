"""Errors of bad input (`InputError` of `maurice_mcl.errors`, and its kinds); problems of a reading."""

from __future__ import annotations

from pathlib import Path

from maurice_mcl.errors import InputError as InputError


class SourceError(InputError):
    """Bad input from a source that is not a file; its name is kept as it was typed."""

    def __init__(self, name: str, message: str, line: int | None = None) -> None:
        super().__init__(Path(name), message, line)
        self.args = (f"{name}{'' if line is None else f':{line}'}: {self.message}",)


class TakenError(InputError):
    """What is to be written exists already, or by now: another process was faster."""


class BadValueError(InputError, ValueError):
    """A bad value; the caller that knows the file adds it."""

    def __init__(self, message: str) -> None:
        super().__init__(None, message)


class FieldError(BadValueError):
    """A value of the wrong type or shape."""


class PictureError(BadValueError):
    """A picture that is missing, damaged or of an unsupported format."""


# What reading a log brought to light: broken lines and things worth saying, bounded in number.

MOST_KEPT = 100


class ReadingNotes:
    """Problems, counted, and warnings, the first 100 of each; without `keep_going` a problem is raised."""

    def __init__(self, keep_going: bool) -> None:
        self._keep_going = keep_going
        self._problems: list[InputError] = []
        self._warnings: dict[str, None] = {}  # in order, each once
        self.count = 0  # problems found, kept or not
        self.tilts: dict[str, tuple[float, float]] = {}  # of poses that leave the plane: rad, m, by source

    def problem(self, error: InputError) -> None:
        """Count a broken line, or raise the error when not keeping going."""
        if not self._keep_going:
            raise error from None
        self.count += 1
        if len(self._problems) < MOST_KEPT:
            self._problems.append(error)

    def left_plane(self, name: str, tilt_rad: float, height_m: float, text: str) -> None:
        """Note that the poses of a source left the plane."""
        self.tilts[name] = (tilt_rad, height_m)
        self.warning(f"{name}: {text}")

    def warning(self, text: str) -> None:
        """Note something worth saying; the same text is kept once."""
        if len(self._warnings) < MOST_KEPT:
            self._warnings[text] = None

    @property
    def problems(self) -> tuple[InputError, ...]:
        """The first problems found."""
        return tuple(self._problems)

    @property
    def warnings(self) -> tuple[str, ...]:
        """The first warnings, each once."""
        return tuple(self._warnings)


class HasReadingNotes:
    """The problems and warnings of a session's last reading; subclasses reset them when a reading begins."""

    _notes: ReadingNotes

    @property
    def problem_count(self) -> int:
        """How much the last reading left out (0 without `keep_going`: the first problem is raised)."""
        return self._notes.count

    @property
    def problems(self) -> tuple[InputError, ...]:
        """The first 100 problems of the last reading."""
        return self._notes.problems

    @property
    def warnings(self) -> tuple[str, ...]:
        """The warnings of the last reading, for example about an unfinished last line."""
        return self._notes.warnings
