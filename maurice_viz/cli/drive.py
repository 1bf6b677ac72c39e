"""`maurice-replay drive`: a robot that is driven by keys typed in a terminal, and watched in the viewer."""

from __future__ import annotations

import os
import re
import select
import shlex
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

from ..layouts import DETAILS
from .replay import printed
from .shared import options as opt
from .shared.console import ConsoleListener, note, notes
from .shared.errors import fail
from .shared.live_options import QUIET
from .shared.visible import visible
from .simulate import WORLD, WorldSet

NO_TERMINAL = "drive reads keys from a terminal, and found none; start it in one, not in a pipe or a script"
NO_POSIX = "drive reads keys from a POSIX terminal, and this system has none; use WSL"
IDLE_S = 0.4  # without a key, after which a robot on its own goes on
ARROWS = {"A": "up", "B": "down", "C": "right", "D": "left"}  # by the last letter of what a terminal sends
HELD = (*ARROWS.values(), *"wasd")  # keys that may be held down: the robot ends with them
KEY = re.compile(r"\x1b[\[O][0-9;]*([A-Za-z~])|(.)", re.DOTALL)
UNFINISHED = re.compile(r"\x1b(?:[\[O][0-9;]*)?$")  # an arrow of which the rest is still to come
CLEAR_LINE = "\r\x1b[K"


def drive(
    world: WorldSet,
    rrd: opt.Rrd = None,
    web: opt.Web = False,
    layout: opt.Layout = None,
    detail: opt.Detail = DETAILS[0],
    force: opt.Force = False,
    preset: opt.Preset = None,
    particles: opt.Particles = None,
    start: Annotated[
        str,
        opt.option(
            "--start",
            "Whether the filter knows where it begins.",
            opt.FILTER,
            **opt.one_of(("global", "tracking"), "start"),
        ),
    ] = "global",
    seed: opt.Seed = 0,
    laser: Annotated[
        bool, opt.option("--laser", "A robot with a laser in place of its camera, over a map.", WORLD)
    ] = False,
) -> None:
    """Drive the simulated robot by keys, with the filter at work in the viewer; ?: what the keys do."""
    if not sys.stdin.isatty():
        fail(NO_TERMINAL)
    if sys.platform == "win32":
        fail(NO_POSIX)
    os.environ.setdefault("RUST_LOG", QUIET)  # before the next lines import rerun, which reads it
    from maurice_datasets.sessions import simulation_plan

    from ..app.drive.drive import drive as drive_robot
    from ..running.filters import Filter
    from ..running.output import serving

    name = new_name()
    output = opt.DrawingSet(rrd, web, layout, detail, force).output(name, fixed_stem=True)
    status = StatusLine()
    try:
        with serving(output, status), typed_keys() as keys:
            drive_robot(
                keys,
                simulation_plan(start, **asdict(world), seed=seed, laser=laser),
                Filter(preset, particles=particles, seed=seed),
                folder=name,
                output=output,
                tell=status.tell,
                report=printed(json_output=False),
                listener=status,
            )
    finally:
        status.end()
    if Path(name).exists():
        note(f"now try: {shlex.join(['maurice-replay', 'diagnose', str(Path(name) / 'session.log')])}")


def new_name() -> str:
    """Return the first of drive-1, drive-2, ... that names neither a folder nor a recording here."""
    number = 1
    while Path(f"drive-{number}").exists() or Path(f"drive-{number}.rrd").exists():
        number += 1
    return f"drive-{number}"


class StatusLine(ConsoleListener):
    """The last line of a terminal, below all remarks."""

    def __init__(self) -> None:
        super().__init__()
        self._line = ""

    def tell(self, line: str) -> None:
        """Show a line in place of the last one; what is too long for one line stays above it. "" ends it."""
        self.end()
        if not line:
            self._write("\n" if self._line else "", self._line)
            self._line = ""
            return
        width = shutil.get_terminal_size().columns - 1
        if len(line) > width:
            self._write("")
            note(line)
        self._line = visible(line)[:width]
        self._write(self._line)

    def remark(self, text: str) -> None:
        """Print a remark above the line."""
        self._write("")
        super().remark(text)
        self._write(self._line)

    def warning(self, text: str) -> None:
        """Print a warning above the line."""
        self.remark(text)

    def progress(self, done: int, total: int, what: str) -> None:
        """Show what takes long; an update of a drive does not."""
        if what not in ("replay", "session"):
            super().progress(done, total, what)

    def _write(self, text: str, before: str = "") -> None:
        if notes.is_terminal:
            notes.file.write(f"{CLEAR_LINE}{before}{text}")  # past what makes control characters visible
            notes.file.flush()


@contextmanager
def typed_keys() -> Iterator[Iterator[str]]:
    """Yield keys as they are typed; the terminal is as it was after the block, however that ends."""
    import termios
    import tty

    terminal = sys.stdin.fileno()
    before = termios.tcgetattr(terminal)
    try:
        tty.setcbreak(terminal, termios.TCSANOW)
        yield _keys(terminal)
    finally:
        termios.tcsetattr(terminal, termios.TCSANOW, before)


def _keys(terminal: int) -> Iterator[str]:
    """Yield the keys typed in a terminal, and "" now and then where there is none, until it is gone."""
    rest = ""
    while True:
        if not select.select([terminal], [], [], IDLE_S)[0]:
            yield ""
            continue
        try:
            typed = os.read(terminal, 4096)
        except OSError:  # the terminal was closed
            typed = b""
        if not typed:
            return
        text = rest + typed.decode("utf-8", "replace")
        whole = UNFINISHED.sub("", text)
        rest = text[len(whole) :]
        yield from keys_of(whole)


def keys_of(text: str) -> list[str]:
    """Return the names of keys by what a terminal sends; of a key that is held down, one for all."""
    keys = [ARROWS.get(arrow, "") if arrow else letter for arrow, letter in KEY.findall(text)]
    pairs = zip(keys, ["", *keys], strict=False)
    return [key for key, before in pairs if key and not (key == before and key in HELD)]
