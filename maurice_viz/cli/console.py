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
    TextColumn,
    TimeElapsedColumn,
)

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


@contextmanager
def progress(what: str) -> Iterator[Advance]:
    """Show a bar on standard error while something goes on; silent where that is no terminal."""
    columns = (SpinnerColumn(), TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    quiet = not notes.is_terminal  # otherwise a pipe would get blank lines
    with Progress(*columns, TimeElapsedColumn(), console=notes, transient=True, disable=quiet) as bar:
        task = bar.add_task(what, total=None)

        def advance(done: int, total: int, now: str = "", /) -> None:
            bar.update(task, completed=done, total=total or None, description=now or what)

        yield advance
