"""Where words go: results on standard output, everything else on standard error."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    SpinnerColumn,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
)

from ..app.listener import Listener

TABLE_WIDTH = 100  # of a table that goes to a file or a pipe, where there is no terminal to ask

results = Console(
    width=None if Console().is_terminal else TABLE_WIDTH, soft_wrap=False, highlight=False, markup=False
)
notes = Console(stderr=True, soft_wrap=True, highlight=False, markup=False)


class Advance(Protocol):
    """Moves a progress bar on."""

    def __call__(self, done: int, total: int, what: str = "", /) -> None:
        """Say how many are done, of how many (0: nobody knows), and of what if that changed."""
        ...


def note(text: str) -> None:
    """Say something that is not the result."""
    notes.print(text)


def _bar() -> Progress:
    columns = (SpinnerColumn(), TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    quiet = not notes.is_terminal  # otherwise a pipe would get blank lines
    return Progress(*columns, TimeElapsedColumn(), console=notes, transient=True, disable=quiet)


@contextmanager
def progress(what: str) -> Iterator[Advance]:
    """Show a bar on standard error while something goes on; silent where that is no terminal."""
    with _bar() as bar:
        task = bar.add_task(what, total=None)

        def advance(done: int, total: int, now: str = "", /) -> None:
            bar.update(task, completed=done, total=total or None, description=now or what)

        yield advance


class ConsoleListener:
    """Writes remarks and warnings to standard error and shows progress there, one bar at a time."""

    def __init__(self, bar: Progress | None = None) -> None:
        """Show progress in this bar; without one only remarks and warnings are written."""
        self._bar = bar
        self._task: TaskID | None = None
        self._what = ""

    def remark(self, text: str) -> None:
        """Print a remark."""
        note(text)

    def warning(self, text: str) -> None:
        """Print a warning."""
        note(text)

    def progress(self, done: int, total: int, what: str) -> None:
        """Move the bar of `what`; it takes the place of the bar of anything else."""
        if self._bar is None:
            return
        if self._task is None or what != self._what:
            if self._task is not None:
                self._bar.remove_task(self._task)
            self._task, self._what = self._bar.add_task(what, total=None), what
        self._bar.update(self._task, completed=done, total=total or None)


@contextmanager
def listening() -> Iterator[Listener]:
    """Yield a listener that writes to standard error; its progress bar goes when the block ends."""
    with _bar() as bar:
        yield ConsoleListener(bar)


TO_CONSOLE = ConsoleListener()
