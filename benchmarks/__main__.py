"""All benchmarks in one run (`make bench`): `python -m benchmarks [NAME ...] [--quick] [--resume] [--write]`.

Prints every table as it is done, and saves it to out/bench.json, beside those of earlier runs. `--resume`
leaves out what is saved there. `--write` also puts the tables into docs/performance.md, between their marks.
After `check`, which CI runs, the status is 1 where a ratio fell by half.
"""

from __future__ import annotations

import argparse
import json
import re
from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path

import cv2
from rich.console import Console
from rich.table import Table as Shown

from .speed import check, filter_step, growth, laser, libraries, many_runs, pictures, recording, replays
from .speed.measure import Table, machine
from .speed.peers import install

DOCS = Path(__file__).parents[1] / "docs" / "performance.md"
SAVED = Path("out/bench.json")

SECTIONS: Mapping[str, Callable[[bool], Table]] = {
    "check": check.check,
    "filter-step": lambda quick: filter_step.filter_steps(install(), quick),
    "laser": laser.laser,
    "one-picture": pictures.one_picture,
    "pictures": pictures.pictures,
    "replays": replays.replays,
    "trials": many_runs.runs_a_second,
    "recordings": recording.recordings,
    "panels": recording.panels,
    "commands": replays.commands,
    "libraries": libraries.libraries,
    "growth": growth.growth,
}


def main() -> None:
    """Run what was asked for."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(SECTIONS)}; none: all")
    parser.add_argument("--quick", action="store_true", help="few rounds: to see that it works")
    parser.add_argument("--resume", action="store_true", help="go on where a run stopped")
    parser.add_argument("--write", action="store_true", help="put the tables into docs/performance.md")
    asked = parser.parse_args()
    unknown = [name for name in asked.names if name not in SECTIONS]
    if unknown:
        parser.error(f"found {unknown[0]}, expected {', '.join(SECTIONS)}")
    cv2.setNumThreads(1)
    console, on, tables, names = Console(width=140), machine(), saved(), asked.names or list(SECTIONS)
    for name in names:
        if asked.resume and name in tables:
            continue
        tables[name] = SECTIONS[name](asked.quick)
        show(console, tables[name])
        results = {"on": on, "tables": {name: asdict(table) for name, table in tables.items()}}
        SAVED.parent.mkdir(exist_ok=True)
        SAVED.write_text(json.dumps(results, indent=1))
    if asked.write:
        write([tables[name] for name in names], on)
    if "check" in names and any(check.FELL in row for row in tables["check"].rows):
        raise SystemExit(1)


def saved() -> dict[str, Table]:
    """Return the tables of earlier runs, by name; none if there is no such file, or one of an older form."""
    try:
        tables = json.loads(SAVED.read_text())["tables"]
        return {name: Table(**table) for name, table in tables.items()}
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return {}


def show(console: Console, table: Table) -> None:
    """Print a table."""
    shown = Shown(*table.columns, title=table.title)
    for row in table.rows:
        shown.add_row(*row)
    console.print(shown)
    for note in table.notes:
        console.print(note)


def write(tables: list[Table], on: Mapping[str, str]) -> None:
    """Put tables between their marks in the docs, `<!-- NAME -->` and `<!-- end -->`."""
    text = DOCS.read_text(encoding="utf-8")
    parts = {table.name: table.markdown() for table in tables}
    parts["machine"] = "\n".join(f"* {what}: {value}" for what, value in on.items())
    for name, part in parts.items():
        marked = re.compile(rf"(<!-- {name} -->\n).*?(<!-- end -->)", re.DOTALL)
        text = marked.sub(lambda found, part=part: f"{found[1]}\n{part}\n\n{found[2]}", text)
    DOCS.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
