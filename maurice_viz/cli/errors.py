"""Bad input becomes one line on standard error and exit status 1, never a traceback."""

from __future__ import annotations

import errno
from collections.abc import Iterator
from contextlib import contextmanager

import typer

from maurice_loaders.errors import InputError

from ..errors import OptionError

INTERRUPTED = 130  # what a shell says of a command ended by Ctrl-C ...
TERMINATED = 143  # ... and by SIGTERM


@contextmanager
def one_line_errors() -> Iterator[None]:
    """Turn what can go wrong with files into one line; defects of our own keep their traceback."""
    try:
        yield
    except OptionError as problem:
        raise typer.BadParameter(str(problem)) from None
    except InputError as problem:
        _fail(str(problem))
    except OSError as problem:
        where = f"{problem.filename}: " if problem.filename else ""
        advice = "; free some space, or write to another disk" if problem.errno == errno.ENOSPC else ""
        _fail(f"{where}{problem.strerror or problem}{advice}")


def _fail(text: str) -> None:
    line = " ".join(text.split())
    typer.echo(f"maurice-replay: {line}", err=True)
    raise typer.Exit(1)
