"""Where text goes: results on standard output, everything else on standard error."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext

from rich import progress as bars
from rich.console import Console, ConsoleOptions, RenderableType
from rich.highlighter import JSONHighlighter
from rich.progress import Progress, Task
from rich.segment import Segment
from rich.text import Text

from .errors import one_line_errors
from .visible import CONTROLS, visible, wrapped

WIDTH = 80  # of what goes to a file or a pipe, where there is no terminal to ask
IS_ASKED = Console().is_terminal or "COLUMNS" in os.environ  # Rich asks the one or the other


class VisibleConsole(Console):
    """A console that styles what it prints, and shows control characters in it as marks."""

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterator[Segment]:
        """Yield the parts of what is printed; only parts that Rich itself made steer the terminal."""
        for part in super().render(renderable, options):
            yield part if part.control else Segment(visible(part.text), part.style)

    def say(self, text: str, style: str = "") -> None:
        """Print sentences in lines that fit, broken between words; a command or a path is never broken."""
        for line in wrapped(text, self.width):
            self.print(Text(line, style=style), soft_wrap=True)


results = VisibleConsole(width=None if IS_ASKED else WIDTH, soft_wrap=False, highlight=False, markup=False)
notes = VisibleConsole(stderr=True, soft_wrap=True, highlight=False, markup=False)


def note(text: str) -> None:
    """Print a line that is not a result: broken between words on a terminal, else whole for programs."""
    if notes.is_terminal:
        notes.say(text)
    else:
        notes.print(text)


def print_json(value: object) -> None:
    """Print a result as JSON, see `plain_value`."""
    from maurice_mcl.values import plain_value  # loads numpy, which help does without

    text = json.dumps(plain_value(value), ensure_ascii=False, indent=2)
    escaped = CONTROLS.sub(lambda match: f"\\u{ord(match[0]):04x}", text)  # those that JSON itself leaves
    results.print(JSONHighlighter()(escaped), soft_wrap=True)


class RateColumn(bars.ProgressColumn):
    """How many are done in a second."""

    def render(self, task: Task) -> Text:
        """Return the rate, nothing before it is known."""
        speed = task.finished_speed or task.speed
        return Text("" if speed is None else f"{speed:.3g}/s")


class ConsoleListener:
    """Writes remarks and warnings to standard error and shows progress there, one bar at a time."""

    def __init__(self) -> None:
        self._bar: Progress | None = None
        self._what = ""

    def remark(self, text: str) -> None:
        """Print a remark."""
        note(text)

    def warning(self, text: str) -> None:
        """Print a warning."""
        note(text)

    def progress(self, done: int, total: int, what: str) -> None:
        """Move the bar of `what`, which replaces any other; it is removed when all is done."""
        if not notes.is_terminal:  # a pipe would get blank lines
            return
        if self._bar is None or what != self._what:
            self.end()
            columns = (
                bars.SpinnerColumn(),
                bars.TextColumn("{task.description}", markup=False),
                bars.BarColumn(),
                bars.MofNCompleteColumn(),
                RateColumn(),
            )
            times: list[bars.ProgressColumn] = [bars.TimeElapsedColumn()]
            times += (
                [bars.TimeRemainingColumn(compact=True), bars.TextColumn("left", markup=False)]
                if total
                else []
            )
            self._bar = Progress(
                *columns,
                *times,
                console=notes,
                transient=True,
                redirect_stdout=False,
                redirect_stderr=False,  # the stream marks what steers a terminal, as bars do
            )
            self._bar.start()
            self._bar.add_task(what, total=None)
            self._what = what
        self._bar.update(self._bar.task_ids[0], completed=done, total=total or None)
        if done >= total > 0:
            self.end()

    def end(self) -> None:
        """Remove the bar."""
        if self._bar is not None:
            self._bar.stop()
            self._bar = None


TO_CONSOLE = ConsoleListener()


@contextmanager
def listening(*, usage: bool = True) -> Iterator[ConsoleListener]:
    """Yield a listener that writes to standard error; its progress bar is removed when the block ends.

    With `usage`, a bad argument found inside the block is reported below the command's usage.
    """
    with one_line_errors() if usage else nullcontext():
        try:
            yield TO_CONSOLE
        finally:
            TO_CONSOLE.end()
