"""`maurice-replay events RUN`: what happened in a saved run, and your own bookmarks beside it."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Annotated

import typer
from rich.table import Table
from rich.text import Text

from maurice_mcl.analysis.events import KINDS, RunEvent

from ..console import listening, note, results
from ..convert.export import RunArgument
from ..errors import one_line_errors
from ..options import JsonOption

ALL_RUNS = "all"  # in a table: an event that every run of a comparison has
BOOKMARKS = "Bookmarks"

KindOption = Annotated[
    list[str] | None,
    typer.Option("--kind", metavar="KIND", help=f"Only this kind; may be repeated: {', '.join(KINDS)}."),
]
AllOption = Annotated[bool, typer.Option("--all", help="List routine events too: resampling, a new floor.")]
AddOption = Annotated[
    tuple[int, str] | None,
    typer.Option(
        "--add",
        metavar="STEP NOTE",
        help='Keep a bookmark beside the run: --add 40 "odd turn".',
        rich_help_panel=BOOKMARKS,
    ),
]
RemoveOption = Annotated[
    str | None,
    typer.Option(
        "--remove",
        metavar="STEP|NOTE",
        help="Remove the bookmarks of a step, or those with this note.",
        rich_help_panel=BOOKMARKS,
    ),
]


def events(
    run: RunArgument,
    kinds: KindOption = None,
    everything: AllOption = False,
    add: AddOption = None,
    remove: RemoveOption = None,
    json_output: JsonOption = False,
) -> None:
    """List what happened in a saved run, and keep bookmarks of your own beside it."""
    from ...app.events import drop_bookmarks, keep_bookmark
    from ...app.events import events as find

    if add is not None and remove is not None:
        raise typer.BadParameter("give --add or --remove, not both")
    with one_line_errors(), listening() as listener:
        if add is not None:
            step, text = add
            file = keep_bookmark(run, step, text)
            note(f"{file}: bookmark at step {step}: {' '.join(text.split())}")
            return
        if remove is not None:
            gone = drop_bookmarks(run, remove)
            note(f"{run}: {gone} bookmark{'s' * (gone != 1)} removed")
            return
        found = find(run, kinds=kinds or (), routine=everything, listener=listener)
    if json_output:
        results.print_json(json.dumps(found.to_json()))
    elif any(one.events for one in found.runs):
        results.print(_table({one.label: one.events for one in found.runs}, found.session))
    else:
        note(f"{run}: no event{' of that kind' if kinds else ''}")


def _table(by_run: dict[str, Sequence[RunEvent]], title: str) -> Table:
    """Return a table with one row per event, by step, and a column for the run where there are several."""
    table = Table(title=Text(title, no_wrap=True, overflow="ignore"), title_justify="left")
    several = len(by_run) > 1
    for name in ("step", "time (s)"):
        table.add_column(name, justify="right", no_wrap=True)
    for name in ("run", "event") if several else ("event",):
        table.add_column(name, no_wrap=True)
    table.add_column("what")
    for event, labels in _by_event(by_run):
        who = ALL_RUNS if len(labels) == len(by_run) else ", ".join(labels)
        row = [str(event.step), f"{event.time_s:.1f}", *([who] if several else []), event.kind, event.text]
        table.add_row(*map(Text, row))
    return table


def _by_event(by_run: dict[str, Sequence[RunEvent]]) -> list[tuple[RunEvent, list[str]]]:
    """Join equal events of several runs, in the order of steps and kinds."""
    labels: dict[RunEvent, list[str]] = {}
    for label, some in by_run.items():
        for event in dict.fromkeys(some):
            labels.setdefault(event, []).append(label)
    order = list(KINDS)
    return sorted(labels.items(), key=lambda item: (item[0].step, order.index(item[0].kind)))
