"""How a command ends: bad input in one line and status 1, a request to stop in 130 or 143; no traceback."""

from __future__ import annotations

import errno
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import NoReturn

import typer

INTERRUPTED = 130  # the status a shell gives a command ended by Ctrl-C ...
TERMINATED = 143  # ... and by SIGTERM


@contextmanager
def errors_end_the_command() -> Iterator[None]:
    """Turn bad input and a request to stop into one line and a status; defects keep their traceback."""
    try:
        with one_line_errors():
            yield
    except KeyboardInterrupt as stop:
        terminated = type(stop) is not KeyboardInterrupt  # Terminated, which need not be imported yet
        typer.echo("; ".join(["maurice-replay: stopped", *map(str, stop.args)]), err=True)
        raise typer.Exit(TERMINATED if terminated else INTERRUPTED) from None


@contextmanager
def one_line_errors() -> Iterator[None]:
    """Turn bad input and bad files into one line and status 1, a bad argument into a usage error."""
    try:
        yield
    except OSError as problem:
        where = f"{problem.filename}: " if problem.filename else ""
        advice = "; free some space, or write to another disk" if problem.errno == errno.ENOSPC else ""
        fail(f"{where}{problem.strerror or problem}{advice}")
    except Exception as problem:
        if _is(problem, "maurice_viz.errors", "OptionError"):
            raise typer.BadParameter(str(problem)) from None
        if _is(problem, "maurice_loaders.errors", "InputError"):
            fail(str(problem))
        raise


def _is(problem: Exception, module: str, name: str) -> bool:
    """Return whether it is an error of that class, without importing the class."""
    loaded = sys.modules.get(module)
    return loaded is not None and isinstance(problem, getattr(loaded, name))


def fail(text: str) -> NoReturn:
    """End the command with one line on standard error and status 1."""
    typer.echo(f"maurice-replay: {' '.join(text.split())}", err=True)
    raise typer.Exit(1)
