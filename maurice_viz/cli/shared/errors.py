"""How a command ends: bad input in one line and status 1, a request to stop in 130 or 143; no traceback.

Importing Typer takes a tenth of a second, and a request to stop has to work during that time too.
"""

from __future__ import annotations

import errno
import os
import shutil
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import NoReturn

from .visible import wrapped

STATUS = {signal.SIGINT: 130, signal.SIGTERM: 143}  # what a shell gives a command ended by a signal


@contextmanager
def errors_end_the_command() -> Iterator[None]:
    """Turn bad input and a request to stop into one line and a status; defects keep their traceback."""
    import typer

    try:
        with one_line_errors():
            yield
    except KeyboardInterrupt as stop:
        end_at_once()
        typer.echo("; ".join(["maurice-replay: stopped", *map(str, stop.args)]), err=True)
        raise typer.Exit(status_of(stop)) from None
    finally:
        end_at_once()


@contextmanager
def one_line_errors() -> Iterator[None]:
    """Turn bad input and bad files into one line and status 1, a bad argument into a usage error."""
    import typer

    try:
        yield
    except OSError as problem:
        where = f"{problem.filename}: " if problem.filename else ""
        advice = "; free some space, or write to another disk" if problem.errno == errno.ENOSPC else ""
        fail(f"{where}{problem.strerror or problem}{advice}")
    except Exception as problem:  # told apart by name: importing their classes would be slow
        if _is(problem, "maurice_viz.errors", "OptionError"):
            raise typer.BadParameter(str(problem)) from None
        if _is(problem, "maurice_loaders.errors", "InputError"):
            fail(str(problem))
        raise


def status_of(stop: KeyboardInterrupt) -> int:
    """Return the status after Ctrl-C, or after SIGTERM for `Terminated`, which need not be imported yet."""
    return STATUS[signal.SIGINT if type(stop) is KeyboardInterrupt else signal.SIGTERM]


def _is(problem: Exception, module: str, name: str) -> bool:
    """Return whether it is an error of that class, without importing the class."""
    loaded = sys.modules.get(module)
    return loaded is not None and isinstance(problem, getattr(loaded, name))


def fail(text: str) -> NoReturn:
    """End the command with one line on standard error and status 1."""
    import typer

    line = f"maurice-replay: {' '.join(text.split())}"
    if sys.stderr.isatty():
        line = "\n".join(wrapped(line, shutil.get_terminal_size().columns))
    typer.echo(line, err=True)
    raise typer.Exit(1)


def end_while_starting() -> None:
    """Let both signals end the process at once, unless the parent process set them to be ignored."""
    for number in STATUS:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _end_at_once)


def stop_by_exception() -> None:
    """From here on the command has things to close: let a request to stop raise an exception."""
    for number in STATUS:
        if signal.getsignal(number) is _end_at_once:
            signal.signal(number, _stop)


def end_at_once() -> None:
    """From here on nothing needs to be closed: undo `stop_by_exception`."""
    for number in STATUS:
        if signal.getsignal(number) is _stop:
            signal.signal(number, _end_at_once)


def _end_at_once(number: int, frame: FrameType | None) -> None:
    """End the process: while modules are imported nothing needs cleaning up, and an exception may be lost."""
    os.write(sys.stderr.fileno(), b"maurice-replay: stopped\n")
    os._exit(STATUS[signal.Signals(number)])


def _stop(number: int, frame: FrameType | None) -> None:
    from ...errors import Terminated

    raise Terminated if number == signal.SIGTERM else KeyboardInterrupt
