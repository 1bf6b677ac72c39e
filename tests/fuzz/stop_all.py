"""`make stops`: commands that write are stopped, killed, or meet a full disk, at many random moments.

    python tests/fuzz/stop_all.py [--trials 120] [--again]
    python tests/fuzz/stop_all.py --one 17

A trial starts a command on a small session and ends it at a moment drawn from its number: by Ctrl-C, SIGTERM
or SIGKILL, or by a limit on the size of a file. Then its exit status, its words and its files have to
fit, and the same command, run again, has to succeed and to leave nothing else behind. It goes on where it
stopped.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from random import Random

import cv2
from rerun.chunk import RrdReader

from maurice_loaders.runs.manifest import is_saved
from maurice_loaders.runs.store import open_runs
from maurice_viz.viewer.snapshot import software_driver

sys.path.append(str(Path(__file__).parents[1]))  # where the helpers are, and a folder maurice_viz of tests

from helpers.commands import COMMAND, no_display
from helpers.small_session import picture_at, write_small_session, write_small_survey

STATE = Path("out/stops.json")
PATIENCE_S = 300.0
STATUS = {signal.SIGINT: 130, signal.SIGTERM: 143, signal.SIGKILL: -9}
FULL = 0  # in the place of a signal: a limit on the size of files
WAYS = (signal.SIGINT, signal.SIGTERM, signal.SIGKILL, FULL)
QUICK = ("--particles", "300")

# What is typed, and what it makes: the rest of a folder is not its own.
COMMANDS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "replay": (("replay", "session.log", *QUICK, "-o", "a.rrd", "--json"), ("a.rrd",)),
    "save": (("replay", "session.log", *QUICK, "-o", "none", "--save-run", "kept", "--json"), ("kept",)),
    "both": (
        ("replay", "session.log", *QUICK, "-o", "a.rrd", "--save-run", "kept", "--json"),
        ("a.rrd", "kept"),
    ),
    "compare": (
        ("compare", "session.log", *QUICK, "-o", "a.rrd", "--save-run", "kept", "--json"),
        ("a.rrd", "kept"),
    ),
    "demo": (("demo", "-o", "a.rrd", "--json"), ("a.rrd",)),
    "import": (("import", "pictures", "photos", "--poses", "photos/poses.csv", "-o", "made"), ("made",)),
    "build": (("library", "build", "survey.log", "-o", "library"), ("library",)),
    "report": (("report", "saved", "-o", "a.html"), ("a.html",)),
    "snapshot": (("snapshot", "saved", "-o", "a.png", "--step", "3"), ("a.png",)),
    "movie": (("snapshot", "saved", "-o", "a.mp4", "--from", "2", "--to", "4"), ("a.mp4",)),
}
DRAWN = ("snapshot", "movie")  # need a Vulkan driver


@dataclass(slots=True)
class Progress:
    """How far it got."""

    trials: int
    done: int = 0
    found: list[str] = field(default_factory=list)
    took_s: dict[str, float] = field(default_factory=dict)  # each command, undisturbed


@dataclass(frozen=True, slots=True)
class Ended:
    """How a command ended."""

    status: int
    out: str
    err: str
    orphans: list[int]  # processes that it started and that outlive it


def main(words: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("--trials", type=int, default=120)
    parser.add_argument("--again", action="store_true", help="from the beginning")
    parser.add_argument("--state", type=Path, default=STATE)
    parser.add_argument("--one", type=int, metavar="NUMBER", help="this trial alone")
    typed = parser.parse_args(words)
    progress = _resumed(typed.state, typed.trials, again=typed.again)
    with tempfile.TemporaryDirectory(prefix="stops-") as folder:
        base = Path(folder)
        prepare(base)
        if typed.one is not None:
            print(try_one(typed.one, base, progress) or "nothing found")
            return 0
        while progress.done < progress.trials:
            progress.found += try_one(progress.done, base, progress)
            progress.done += 1
            _keep(typed.state, progress)
    for line in progress.found:
        print(line)
    print(f"{progress.done} trials, {len(progress.found)} findings")
    typed.state.unlink(missing_ok=True)
    return 1 if progress.found else 0


def prepare(base: Path) -> None:
    """Write what the commands read: a session with its survey, pictures with a table, a saved run."""
    write_small_survey(base)
    write_small_session(base)
    (base / "photos").mkdir()
    rows = ["image,x_m,y_m,heading_deg"]
    for number in range(60):
        pose = (0.3 + 0.03 * number, 0.8, 0.1 * number)
        cv2.imwrite(str(base / f"photos/{number}.png"), picture_at(pose))  # type: ignore[arg-type]
        rows.append(f"{number}.png,{pose[0]},{pose[1]},{6 * number}")
    (base / "photos/poses.csv").write_text("\n".join(rows) + "\n")
    done = run(base, base, ("replay", "session.log", *QUICK, "-o", "none", "--save-run", "saved"))
    assert done.status == 0, done.err


def try_one(number: int, base: Path, progress: Progress) -> list[str]:
    """Make one trial; return what was wrong."""
    names = [name for name in COMMANDS if name not in DRAWN or software_driver() is not None]
    name, draw = names[number % len(names)], Random(f"stops {number}")
    way = WAYS[number // len(names) % len(WAYS)]
    if way == FULL and name in DRAWN:
        way = signal.SIGKILL  # the viewer would be limited as well
    words, made = COMMANDS[name]
    if name not in progress.took_s:
        with _workplace(base) as work:
            began = time.monotonic()
            done = run(work, base, words)
            assert done.status == 0, f"{name}: {done.err}"
            progress.took_s[name] = time.monotonic() - began
    with _workplace(base) as work:
        after_s, limit = draw.random() * progress.took_s[name], int(10 ** draw.uniform(1, 5.5))
        if way == FULL:
            ended, how = run(work, base, words, limit=limit), f"files of at most {limit} bytes"
        else:
            ended = run(work, base, words, way=way, after_s=after_s)
            how = f"{signal.Signals(way).name} after {after_s:.2f} s"
        wrong = [
            *_wrong_words(ended, way),
            *_wrong_files(work, made, ended, way),
            *_wrong_again(work, base, words, made),
        ]
    print(f"{number}: {name}, {how}: status {ended.status}", *wrong, sep="; ", flush=True)
    return [f"--one {number} ({name}, {how}): {one}" for one in wrong]


def run(
    work: Path, base: Path, words: tuple[str, ...], way: int = 0, after_s: float = 0.0, limit: int = 0
) -> Ended:
    """Run a command in its folder, and send it a signal after some time, or limit the size of its files."""
    own = {"TMPDIR": str(work / "tmp"), "MAURICE_CACHE": str(base / "cache"), "MAURICE_WORK": str(work)}
    (work / "tmp").mkdir(exist_ok=True)
    limited: Callable[[], None] | None = None
    if limit:
        limited = partial(resource.setrlimit, resource.RLIMIT_FSIZE, (limit, limit))
    with subprocess.Popen(
        [*COMMAND, *words],
        cwd=work,
        env=no_display() | own,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        preexec_fn=limited,
    ) as process:
        if way:
            _wait_until_it_listens(process)
        try:
            out, err = process.communicate(timeout=after_s if way else PATIENCE_S)
        except subprocess.TimeoutExpired:
            process.send_signal(way or signal.SIGKILL)
            out, err = process.communicate(timeout=PATIENCE_S)
    return Ended(process.returncode, out, err, _end_orphans(work))


def _wait_until_it_listens(process: subprocess.Popen[str]) -> None:
    """Before its first line is run, Python itself answers to signals; Linux only."""
    while process.poll() is None:
        status = Path(f"/proc/{process.pid}/status").read_text()
        caught = next(line for line in status.splitlines() if line.startswith("SigCgt"))
        if int(caught.split()[1], 16) >> (signal.SIGTERM - 1) & 1:
            return
        time.sleep(0.002)


def _end_orphans(work: Path) -> list[int]:
    """End processes that outlive the command that started them, known by its environment; Linux only."""
    marked, patient_until = f"MAURICE_WORK={work}\0".encode(), time.monotonic() + 3
    found = [0]
    while found and time.monotonic() < patient_until:  # they may just be ending
        time.sleep(0.05)
        found = [int(one.name) for one in Path("/proc").glob("[0-9]*") if marked in _environment(one)]
    for one in found:
        os.kill(one, signal.SIGKILL)
    return found


def _environment(process: Path) -> bytes:
    try:
        return (process / "environ").read_bytes()
    except OSError:
        return b""


def _wrong_words(ended: Ended, way: int) -> list[str]:
    wrong = []
    allowed = {0, 1} if way == FULL else {0, STATUS[signal.Signals(way)]}
    if ended.status not in allowed:
        wrong.append(f"status {ended.status}")
    if (
        "Traceback" in ended.err
        or "panicked" in ended.err
        or (way != signal.SIGKILL and "rror:" in ended.err)
    ):
        wrong.append(f"words: {ended.err!r}")
    said = [line for line in ended.err.splitlines() if line.startswith("maurice-replay: ")]
    if ended.status not in (0, -9) and len(said) != 1:
        wrong.append(f"{len(said)} lines that say why: {ended.err!r}")
    if ended.orphans:
        wrong.append(f"{len(ended.orphans)} processes left")
    return wrong


def _wrong_files(work: Path, made: tuple[str, ...], ended: Ended, way: int) -> list[str]:
    """Check what is there: nothing half-written under its final name, nothing hidden but after a kill."""
    wrong = []
    for file in _new_files(work):
        whole = file.name in made
        if not whole and not (file.name.endswith(".part.rrd") or way == signal.SIGKILL):
            wrong.append(f"left {file.name}")
        if file.suffix == ".rrd":
            wrong += _wrong_recording(file, whole=whole)
        if whole and file.name == "kept" and is_saved(file):
            wrong += _wrong_run(file, ended)
    if way != signal.SIGKILL and (left := list((work / "tmp").iterdir())):
        wrong.append(f"left {[file.name for file in left]} among the temporary files")
    return wrong


def _wrong_recording(file: Path, *, whole: bool) -> list[str]:
    try:
        if whole:
            for _ in RrdReader(file).stream():
                pass
    except (RuntimeError, ValueError, OSError) as problem:
        return [f"{file.name}: {problem}"]
    return []


def _wrong_run(folder: Path, ended: Ended) -> list[str]:
    """A saved run can be read, and goes as far as the scores that were printed."""
    try:
        counts = [sum(1 for _ in run.steps()) for run in open_runs(folder)]
    except Exception as problem:
        return [] if ended.status == -9 and "manifest" in str(problem) else [f"{folder.name}: {problem}"]
    if ended.out and ended.status != 1:
        told = [one["updates"] for one in json.loads(ended.out)["runs"]]
        if told != counts:
            return [f"scores of {told} updates, {counts} saved"]
    return []


def _wrong_again(work: Path, base: Path, words: tuple[str, ...], made: tuple[str, ...]) -> list[str]:
    """The same command runs through afterwards, replaces what is there and removes what was left."""
    force = ("--force",) if any((work / name).exists() for name in made) else ()
    again = run(work, base, (*words, *force))
    if again.status != 0:
        return [f"again: status {again.status}, {again.err!r}"]
    left = {file.name for file in (*_new_files(work), *(work / "tmp").iterdir())} - set(made)
    wrong = [f"again: left {sorted(left)}"] if left else []
    for name in made:
        if name.endswith(".rrd"):
            wrong += _wrong_recording(work / name, whole=True)
        if name == "kept":
            wrong += _wrong_run(work / name, again)
    return wrong


def _new_files(work: Path) -> list[Path]:
    return [file for file in sorted(work.iterdir()) if not file.is_symlink() and file.name != "tmp"]


class _workplace(tempfile.TemporaryDirectory[str]):
    """A folder with links to what is read."""

    def __init__(self, base: Path) -> None:
        super().__init__(prefix="trial-", dir=base)
        self._base = base

    def __enter__(self) -> Path:  # type: ignore[override]
        work = Path(super().__enter__())
        for name in ("session.log", "survey.log", "pictures", "photos", "saved"):
            if (self._base / name).exists():
                (work / name).symlink_to(self._base / name)
        return work


def _resumed(state: Path, trials: int, *, again: bool) -> Progress:
    if not again and state.exists():
        known = Progress(**json.loads(state.read_text()))
        if known.trials == trials:
            print(f"going on after {known.done} trials; --again begins anew")
            return known
    return Progress(trials)


def _keep(state: Path, progress: Progress) -> None:
    state.parent.mkdir(parents=True, exist_ok=True)
    part = state.with_suffix(".part")
    part.write_text(json.dumps(asdict(progress)))
    part.replace(state)


if __name__ == "__main__":
    sys.exit(main())
