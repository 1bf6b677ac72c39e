"""The commands and the Python of documentation pages, run as a reader runs them: in order, in one folder."""

from __future__ import annotations

import os
import re
import shlex
import signal
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from threading import Timer

import cv2
import numpy as np

from helpers.commands import no_display
from helpers.commands import run as run_here
from helpers.small_session import picture_at

ROOT = Path(__file__).parents[2]
COMMAND = "maurice-replay"
PLACEHOLDER = re.compile(r"\b[A-Z]{2,}\b")  # a word in capitals: something of the reader's own
OWN = {"FOLDER": "own-pictures"}  # what stands for it here
LONG = re.compile(r"#.*\bminutes?\b")  # a comment that warns of it
WRITTEN = re.compile(r"(?:-o|--output|--save-run|--session-only) ([^\s/]+)")  # names of what a command writes
WORD = re.compile(r"[^\s/\"']+")
SERVES = re.compile(r"\s--web\b")  # until Ctrl-C
PATIENCE_S = 120.0  # until a page that is served ends: far longer than it takes
NO_DRIVER = "found no software Vulkan driver"


@dataclass(frozen=True)
class Step:
    """A line of a shell block, or a whole block of Python."""

    page: str
    section: str  # of the page, by its second-level heading
    text: str
    is_python: bool = False

    @property
    def is_long(self) -> bool:
        return bool(LONG.search(self.text))


def steps_of(page: str) -> list[Step]:
    """Return what a page has a reader type, in order, comments included.

    Lines of shell blocks that do not call the command, such as `make demo`, install it.
    """
    found, section, language, block = list[Step](), "", None, list[str]()
    for line in (ROOT / page).read_text(encoding="utf-8").splitlines():
        if line.startswith("```"):
            if language == "python":
                found.append(Step(page, section, "\n".join(block), is_python=True))
            elif language == "sh":
                typed = "\n".join(block).replace("\\\n", " ").splitlines()
                found += [Step(page, section, one) for one in typed if calls_us(one)]
            language, block = (line[3:].strip() or "text", []) if language is None else (None, [])
        elif language is not None:
            block.append(line)
        elif line.startswith("## "):
            section = line[3:]
    return found


def calls_us(line: str) -> bool:
    return Path(line.split(" ")[0]).name == COMMAND


def quick(steps: list[Step]) -> list[Step]:
    """Leave out commands that are said to take minutes, and those that name what these would have written."""
    taken, missing = list[Step](), set[str]()
    for step in steps:
        if step.is_long or missing & set(WORD.findall(step.text.split("#")[0])[1:]):
            missing |= set(WRITTEN.findall(step.text))
        else:
            taken.append(step)
    return taken


def prepare(folder: Path) -> None:
    """Write what a reader has already: a folder of pictures with a table of poses."""
    own = folder / OWN["FOLDER"]
    (own / "images").mkdir(parents=True)
    lines = ["image,x_m,y_m,heading_deg"]
    for number in range(60):
        angle = number * 2 * np.pi / 60
        pose = np.array([2 + 1.5 * np.cos(angle), 2 + 1.5 * np.sin(angle), angle + np.pi / 2])
        name = f"images/frame{number:04d}.jpg"
        cv2.imwrite(str(own / name), picture_at(pose))
        lines.append(f"{name},{pose[0]:.3f},{pose[1]:.3f},{np.degrees(pose[2]):.1f}")
    (own / "poses.csv").write_text("\n".join(lines) + "\n")


def run_step(step: Step, folder: Path) -> None:
    """Run one step as a reader does; a status that is not 0, a traceback, or a placeholder that nothing
    stands for fail.
    """
    if step.is_python:
        return _run([sys.executable, "-c", step.text], step, folder)
    shell = ["bash", "-c", f"exec {_typed(step)}"]
    return _serve(shell, step, folder) if SERVES.search(step.text) else _run(shell, step, folder)


def run_quickly(steps: list[Step], folder: Path) -> None:
    """Run steps here, as all is imported already; a shell runs what is served or redirected."""
    for step in steps:
        if step.is_python:
            exec(compile(step.text, step.page, "exec"), {"__name__": "__main__"})
        elif SERVES.search(step.text) or ">" in _typed(step):
            run_step(step, folder)
        else:
            done = run_here(*shlex.split(_typed(step))[1:], expect=None)
            _judge(done.exit_code, done.stderr, step, done.output)


def _typed(step: Step) -> str:
    typed = PLACEHOLDER.sub(lambda word: OWN[word[0]], step.text.split("#")[0].strip())
    return typed.replace(f".venv/bin/{COMMAND}", COMMAND)


def _run(words: list[str], step: Step, folder: Path) -> None:
    done = subprocess.run(words, cwd=folder, env=_environment(), capture_output=True, text=True, check=False)
    _judge(done.returncode, done.stderr, step, done.stdout + done.stderr)


def _judge(status: int, errors: str, step: Step, output: str) -> None:
    _expect(status == 0 or (status == 1 and NO_DRIVER in errors), step, output)


def _serve(words: list[str], step: Step, folder: Path) -> None:
    """Wait until the page is served, then press Ctrl-C."""
    lines = list[str]()
    with subprocess.Popen(
        words, cwd=folder, env=_environment(), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    ) as server:
        timer = Timer(PATIENCE_S, server.kill)
        timer.start()
        assert server.stderr is not None
        for line in server.stderr:
            lines.append(line)
            if "Ctrl-C" in line:
                server.send_signal(signal.SIGINT)
                break
        server.wait()
        timer.cancel()
    _expect(server.returncode == 0 and any("in a browser" in line for line in lines), step, "".join(lines))


def _expect(right: bool, step: Step, output: str) -> None:
    right = right and "Traceback" not in output
    assert right, f"{step.page}, {step.section}: {step.text}\n{output}"


def _environment() -> dict[str, str]:
    installed = str(Path(sys.executable).parent)
    return no_display() | {"PATH": f"{installed}{os.pathsep}{os.environ['PATH']}"}
