"""`make fuzz`: many inputs for everything that reads what others write or send.

    python tests/fuzz/fuzz_all.py [--inputs 200000] [--again]
    python tests/fuzz/fuzz_all.py --one "session log" 1234

Inputs are made from their number, so that a finding can be tried alone. It goes on where it stopped.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
import time
import tracemalloc
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from random import Random

sys.path.append(str(Path(__file__).parents[1]))  # where the helpers are

from fuzz_targets import SHARES, TARGETS, prepare, try_drawn
from fuzz_watch import TookTooLong, in_memory, in_time, limited_memory, peak, resident

STATE = Path("out/fuzz.json")
BATCH = 500
TRACED_EVERY = 10  # batches; in the others memory is looked at as a whole
MOST_GROWTH = 100 * 2**20  # bytes, from the first batch of a target to its last
SAY_EVERY_S = 10.0


@dataclass(slots=True)
class Progress:
    """How far it got."""

    inputs: int
    done: dict[str, int] = field(default_factory=dict)
    found: list[str] = field(default_factory=list)
    seconds: float = 0.0
    peak: int = 0  # bytes


def main(words: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("--inputs", type=int, default=200_000)
    parser.add_argument("--again", action="store_true", help="from the beginning")
    parser.add_argument("--state", type=Path, default=STATE)
    parser.add_argument("--one", nargs=2, metavar=("TARGET", "NUMBER"))
    typed = parser.parse_args(words)
    with limited_memory(), _quiet_libraries(), tempfile.TemporaryDirectory(dir=_memory()) as folder:
        prepare(Path(folder))
        if typed.one is not None:
            try_one(typed.one[0], int(typed.one[1]), Path(folder))
            return 0
        progress = _resumed(typed.state, typed.inputs, again=typed.again)
        for name, share in SHARES.items():
            fuzz(name, round(share * typed.inputs), Path(folder), progress, typed.state)
    _report(progress)
    typed.state.unlink(missing_ok=True)
    return 1 if progress.found else 0


def fuzz(name: str, wanted: int, folder: Path, progress: Progress, state: Path) -> None:
    """Try the inputs of one target that are still to be tried."""
    said_s, first = 0.0, None
    while (done := progress.done.get(name, 0)) < wanted:
        begun_s, count = time.monotonic(), min(BATCH, wanted - done)
        found = [] if name in TARGETS else _drawn(name, done, count)
        if name in TARGETS:
            found = _mutated(name, done, count, folder, traced=done // BATCH % TRACED_EVERY == 1)
        first = resident() if first is None and done >= 2 * BATCH else first
        progress.done[name] = done + count
        progress.found += found
        progress.seconds += time.monotonic() - begun_s
        progress.peak = max(progress.peak, peak())
        _keep(state, progress)
        if time.monotonic() - said_s > SAY_EVERY_S or found or done + count >= wanted:
            said_s = time.monotonic()
            total = f"{sum(progress.done.values())} of {progress.inputs}"
            print(f"{name}: {done + count} of {wanted}; {total}, {len(progress.found)} found", flush=True)
    if first is not None and resident() - first > MOST_GROWTH:
        progress.found.append(f"{name}: memory grew by {(resident() - first) // 2**20} MiB")


def try_one(name: str, number: int, folder: Path) -> str:
    """Try the input of a number; return what was refused."""
    made = TARGETS[name].make(Random(f"{name} {number}"))
    with in_time():
        return TARGETS[name].read(made, folder)


def _mutated(name: str, begin: int, count: int, folder: Path, *, traced: bool) -> list[str]:
    found = []
    if traced:
        tracemalloc.start()
    for number in range(begin, begin + count):
        try:
            if traced:
                with in_memory():
                    try_one(name, number, folder)
            else:
                try_one(name, number, folder)
        except (Exception, TookTooLong) as problem:
            found.append(f"--one {name!r} {number}: {type(problem).__name__}: {problem}"[:500])
            print(found[-1], flush=True)
    if traced:
        tracemalloc.stop()
    return found


def _drawn(name: str, begin: int, count: int) -> list[str]:
    try:
        try_drawn(name, begin, count)
    except (Exception, TookTooLong) as problem:
        notes = " ".join(getattr(problem, "__notes__", []))
        return [f"{name}, inputs from {begin}: {type(problem).__name__}: {problem} {notes}"[:2000]]
    return []


def _resumed(state: Path, inputs: int, *, again: bool) -> Progress:
    if not again and state.exists():
        known = Progress(**json.loads(state.read_text()))
        if known.inputs == inputs:
            print(f"going on after {sum(known.done.values())} inputs; --again begins anew")
            return known
    return Progress(inputs)


def _keep(state: Path, progress: Progress) -> None:
    state.parent.mkdir(parents=True, exist_ok=True)
    part = state.with_suffix(".part")
    part.write_text(json.dumps(asdict(progress)))
    part.replace(state)


def _report(progress: Progress) -> None:
    for one in progress.found:
        print(one)
    tried, memory = sum(progress.done.values()), progress.peak / 2**20
    print(
        f"{tried} inputs in {progress.seconds:.0f} s, {memory:.0f} MiB at most, {len(progress.found)} found"
    )


@contextmanager
def _quiet_libraries() -> Iterator[None]:
    """Keep away what libjpeg and libpng write to standard error by themselves."""
    before = os.dup(2)
    with Path(os.devnull).open("wb") as nowhere:
        os.dup2(nowhere.fileno(), 2)
    try:
        yield
    finally:
        os.dup2(before, 2)
        os.close(before)


def _memory() -> str | None:
    return "/dev/shm" if Path("/dev/shm").is_dir() else None


if __name__ == "__main__":
    sys.exit(main())
