"""`maurice-replay events RUN`: what happened in a saved run, and notes of one's own."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from maurice_mcl.analysis.events import KINDS

from ..console import note, results
from ..errors import one_line_errors
from ..options import JsonOption


def _check_kinds(values: list[str] | None) -> list[str] | None:
    for value in values or ():
        if value not in KINDS:
            raise typer.BadParameter(f"no kind called {value!r}; there are {', '.join(KINDS)}")
    return values


FolderArgument = Annotated[
    Path, typer.Argument(help="A folder that --run wrote.", show_default=False, metavar="RUN")
]
KindOption = Annotated[
    list[str] | None,
    typer.Option(
        "--kind", metavar="KIND", help=f"Only this kind; may be repeated: {', '.join(KINDS)}.",
        callback=_check_kinds,
    ),
]  # fmt: skip
AllOption = Annotated[
    bool, typer.Option("--all", help="Also what happens all the time: resampling, crossing a floor.")
]
AddOption = Annotated[
    tuple[int, str] | None,
    typer.Option("--add", metavar="STEP NOTE", help='Keep a bookmark beside the run: --add 40 "odd turn".'),
]
RemoveOption = Annotated[
    str | None,
    typer.Option("--remove", metavar="STEP|NOTE", help="Remove the bookmarks of a step, or of one text."),
]


def events(
    run: FolderArgument,
    kinds: KindOption = None,
    everything: AllOption = False,
    add: AddOption = None,
    remove: RemoveOption = None,
    json_output: JsonOption = False,
) -> None:
    """List what happened in a saved run, and keep bookmarks of your own beside it."""
    if add is not None and remove is not None:
        raise typer.BadParameter("give --add or --remove, not both")
    with one_line_errors():
        if add is not None:
            _add(run, *add)
        elif remove is not None:
            _remove(run, remove)
        else:
            _list(run, kinds or [], everything, json_output)


def _list(folder: Path, kinds: list[str], everything: bool, json_output: bool) -> None:
    from ...app.run_events import find_events, to_json, to_table, wanted

    found = find_events(folder)
    chosen = {run.label: wanted(run, kinds, routine=everything) for run in found.runs}
    for problem in found.problems:
        note(problem)
    if json_output:
        results.print_json(json.dumps(to_json(chosen)))
    elif any(chosen.values()):
        results.print(to_table(chosen, found.session))
    else:
        note(f"{folder}: no event{' of that kind' if kinds else ''}")


def _add(folder: Path, step: int, text: str) -> None:
    from maurice_loaders.runs.bookmarks import Bookmark, add_bookmark, bookmarks_file
    from maurice_loaders.runs.store import open_runs

    from ...app.run_events import check_step

    line = " ".join(text.split())
    if not line:
        raise typer.BadParameter('a bookmark has a text: --add 40 "odd turn"')
    check_step(open_runs(folder), folder, step)
    add_bookmark(folder, Bookmark(step, line))
    note(f"{bookmarks_file(folder)}: bookmark at step {step}: {line}")


def _remove(folder: Path, which: str) -> None:
    from maurice_loaders.errors import InputError
    from maurice_loaders.runs.bookmarks import bookmarks_file, read_bookmarks, remove_bookmarks
    from maurice_loaders.runs.store import open_runs

    open_runs(folder)  # says what is wrong where this is no saved run
    kept = read_bookmarks(folder)
    unwanted = [one for one in kept.kept if which in (str(one.step), one.note)]
    if not unwanted:
        there = ", ".join(str(one.step) for one in kept.kept) or "none"
        raise InputError(bookmarks_file(folder), f"found no bookmark {which!r}; there are at steps: {there}")
    gone = remove_bookmarks(folder, unwanted)
    note(f"{bookmarks_file(folder)}: {gone} bookmark{'s' * (gone != 1)} removed")
