"""`maurice-replay trials run|table|report`: many runs over drives, filters and seeds; their statistics."""

from __future__ import annotations

import io
import itertools
import math
import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Annotated, Any

import polars as pl
import typer
from rich.box import SIMPLE_HEAD
from rich.table import Table
from rich.text import Text

from maurice_datasets.trials import table as tables
from maurice_datasets.trials.engine import DASK, LOCAL, run_plan
from maurice_datasets.trials.folder import TrialsFolder
from maurice_datasets.trials.plan import read_plan, shipped_plans
from maurice_datasets.trials.rows import TYPES
from maurice_datasets.trials.statistics import FEW, Interval
from maurice_datasets.trials.table import Difference, Group
from maurice_loaders.files.text import plain_cell
from maurice_loaders.files.writing import expect_absent, write_whole
from maurice_mcl.values import plain

from ..errors import progress_of
from ..text.summary import metric_title, name_of
from .shared import options as opt
from .shared.console import listening, note, print_json, results
from .shared.options import argument, completed, option

TABLES = (".csv", ".parquet")
PLAN = f"A plan as TOML, or one that comes along: {', '.join(shipped_plans())}."
Folder = Annotated[Path, argument("DIR", "A folder that `trials run` has made.")]
Where = Annotated[
    list[str] | None,
    option("--where", "Only rows with COLUMN=VALUE; repeat for more.", metavar="COLUMN=VALUE"),
]


def run(
    plan: Annotated[str, argument("PLAN", PLAN, autocompletion=completed(shipped_plans()))],
    output: Annotated[Path, opt.writes("DIR", "The folder that the rows go to.")],
    workers: Annotated[
        int, option("--workers", "Processes at once.", min=1, max=1024, show_default="one for each core")
    ] = os.cpu_count() or 1,
    scheduler: Annotated[
        str | None,
        option("--scheduler", "Run on many machines: the address of a Dask scheduler.", metavar="ADDRESS"),
    ] = None,
    resume: Annotated[bool, option("--resume", "Go on with a folder; nothing is computed twice.")] = False,
    only: Annotated[
        str, option("--only", "Only parts whose names contain one of these words.", metavar="WORDS")
    ] = "",
    seeds: Annotated[
        int | None, option("--seeds", "Runs of every variant.", min=1, show_default="the plan's")
    ] = None,
    quick: Annotated[
        bool, option("--quick", "Two seeds, two arenas, short drives: to see that it works.")
    ] = False,
    json_output: opt.Json = False,
) -> None:
    """Make every run of a plan: drives times filters times seeds, paired."""
    chosen = read_plan(plan).only([word for word in only.split(",") if word])
    chosen = (chosen.quick() if quick else chosen).with_seeds(seeds)
    with listening() as listener:
        summary = run_plan(
            chosen,
            output,
            workers=workers,
            engine=DASK if scheduler else LOCAL,
            scheduler=scheduler,
            resume=resume,
            progress=progress_of(listener, chosen.title),
        )
    if json_output:
        print_json(summary)
        return
    results.say(
        f"{output}: {summary.runs:,} runs, {summary.made:,} made now, {summary.failed:,} of them failed"
    )
    if summary.error is not None:
        note(f"the first that failed: {summary.error}; the column error has all")
    varied = dict.fromkeys(key for part in chosen.parts for key in part.variants.varied)
    note(f"now try: maurice-replay trials table {output} --by {','.join([*varied][:2]) or 'part'}")


def report(
    folder: Folder,
    output: Annotated[Path, opt.writes("OUT.html", "The page to write. [default: trials.html]")] = Path(
        "trials.html"
    ),
    where: Where = None,
    force: opt.Force = False,
) -> None:
    """Write one page about trials: what every variant reached, and where on the floor runs go wrong."""
    from ..reports.trials_report import trials_report as write_report  # imports charts and Jinja

    with listening():
        page = write_report(folder, output, where=where or [], force=force)
    results.print(f"{page} written")


def table(
    folder: Folder,
    by: Annotated[
        str, option("--by", "Group by these columns or settings.", metavar="COLUMNS", show_default=False)
    ] = "",
    metric: Annotated[
        str,
        option(
            "--metric",
            f"One of {', '.join(tables.NUMBERS)}.",
            metavar="NAME",
            autocompletion=completed(tables.NUMBERS),
        ),
    ] = tables.DEFAULT,
    where: Where = None,
    output: Annotated[Path | None, opt.writes("OUT.csv|OUT.parquet", "Write the groups here.")] = None,
    force: opt.Force = False,
    json_output: opt.Json = False,
) -> None:
    """Print grouped figures with intervals, and differences from the first group, run by run."""
    if output is not None:
        if output.suffix not in TABLES:
            raise typer.BadParameter(f"-o ends in {' or '.join(TABLES)}, found {str(output)!r}")
        expect_absent(output, force=force)
    rows, columns = tables.load_trials(folder, where or []), [name for name in by.split(",") if name]
    groups, differences = tables.grouped(rows, columns, metric), tables.paired(rows, columns, metric)
    if output is not None:
        _write(output, groups, force=force)
    if json_output:
        print_json({"metric": metric, "groups": _plain(groups), "differences": _plain(differences)})
        return
    if rows.is_empty():
        more = f"finished run yet; `trials run PLAN -o {folder} --resume` goes on with it"
        note(f"{folder} holds no {'run that is as --where says' if where else more}")
        return
    results.print(_groups(groups, metric))
    counted = [difference for difference in differences if difference.figure.count]
    if counted:
        results.print(_differences(counted, metric))
    _say_if_few(group.figure for group in groups)
    worst = rows.filter(pl.col(tables.DEFAULT).is_not_null()).sort(tables.DEFAULT, descending=True)
    if not worst.is_empty():
        row = worst.row(0, named=True)
        commands = TrialsFolder(folder).commands_of(row)
        shown = f"; to see it: {commands}" if commands else ""
        note(f"the run with the largest error: {name_of(row)}{shown}")
    if not any(group.figure.count for group in groups):
        note(f"no run holds {metric}: it failed, was left out, or has no truth for it")


def _plain(rows: Sequence[Group | Difference]) -> list[dict[str, Any]]:
    """Return rows of a table as plain values; what is not known or infinite is null."""
    records = [plain(row) for row in rows]
    return [
        {key: record[key] for key in record if key not in ("curve", "figure")}
        | record["figure"]
        | {"median": record.get("median")}
        for record in records
    ]


def _write(file: Path, groups: list[Group], *, force: bool) -> None:
    rows = [{**row.pop("by"), **row} for row in _plain(groups)]
    if file.suffix != ".parquet":
        rows = [{name: plain_cell(value) for name, value in row.items()} for row in rows]
    frame, content = pl.DataFrame(rows, infer_schema_length=None), io.BytesIO()
    if file.suffix == ".parquet":
        frame.write_parquet(content)
    else:
        frame.write_csv(content)
    write_whole(file, content.getvalue(), force=force)


def _groups(groups: list[Group], metric: str) -> Table:
    title, factor = metric_title(metric)
    digits, timed = _digits(metric), metric in tables.TIMES
    flag = title.endswith("(%)")
    table = _table(title, groups[0].by if groups else ())
    names = ("rate" if flag or timed else "mean", "95 % interval", "median")
    several = any(group.figure.drives != group.figure.count for group in groups)  # runs of a drive
    shown = (True, True, not flag, True, several, any(group.failed for group in groups))
    for name in itertools.compress((*names, "runs", "drives", "failed"), shown):
        table.add_column(name, justify="right")
    for group in groups:
        value, limits = _in_words(group.figure, 100 if timed else factor, digits)
        counts = map(str, (group.runs, group.figure.drives, group.failed))
        cells = (value, limits, _or_dash(group.median * factor, digits), *counts)
        table.add_row(*map(_cell, group.by.values()), *itertools.compress(cells, shown))
    if timed:
        table.caption = "rate: share that localized (%). median: the others are censored at their end"
    return table


def _differences(differences: list[Difference], metric: str) -> Table:
    title, factor = metric_title(metric)
    against = ", ".join(_cell(value) for value in differences[0].against.values())
    table = _table(f"{title}, less that of {against}", differences[0].by)
    never = "; a run that never localized counts with its whole drive" if metric in tables.TIMES else ""
    table.caption = f"on the same drives{never}"
    several = any(row.figure.drives != row.figure.count for row in differences)  # pairs of a drive
    names = ("difference", "95 % interval", "pairs", "drives")[: 3 + several]
    for name in names:
        table.add_column(name, justify="right")
    for row in differences:
        value, limits = _in_words(row.figure, factor, _digits(metric), "+")
        cells = (value, limits, str(row.figure.count), str(row.figure.drives))
        table.add_row(*map(_cell, row.by.values()), *cells[: len(names)])
    return table


def _say_if_few(figures: Iterable[Interval]) -> None:
    """Say what intervals of so few drives are worth, once for all of a table."""
    drives = min((figure.drives for figure in figures if figure.count), default=FEW)
    if drives == 1:
        note("intervals are over the seeds of one drive: they say nothing of other drives")
    elif drives < FEW:
        note(f"{drives} drives are few: intervals are wide or missing; from {FEW} on they tell something")


def _table(title: str, by: Iterable[str]) -> Table:
    """Begin a table; its columns have the last word of their keys where that tells them apart."""
    names = list(by)
    short = [name.rpartition(".")[2] for name in names]
    shown = Text(title, no_wrap=True, overflow="ignore")
    table = Table(title=shown, title_justify="left", caption_justify="left", box=SIMPLE_HEAD)
    table.collapse_padding, table.pad_edge = True, False  # three keys fit into 80 columns
    for name in short if len(set(short)) == len(short) else names:
        table.add_column(name, overflow="fold")
    return table


def _cell(value: Any) -> str:
    return "-" if value is None else str(value)


def _digits(metric: str) -> int:
    """Return two digits for shares and confidences, which are 1 at most, and one for what has a unit."""
    return 2 if TYPES[metric] == pl.Float64 and not metric.endswith(("_m", "_rad", "_s")) else 1


def _in_words(figure: Interval, factor: float, digits: int, sign: str = "") -> tuple[str, str]:
    """Return a figure and its interval."""
    limits = (figure.value, figure.low, figure.high)
    value, low, high = (_or_dash(limit * factor, digits, sign) for limit in limits)
    return value, f"{low} to {high}" if math.isfinite(figure.low) else "-"


def _or_dash(value: float, digits: int = 1, sign: str = "") -> str:
    return f"{value:{sign}.{digits}f}" if math.isfinite(value) else "-"
