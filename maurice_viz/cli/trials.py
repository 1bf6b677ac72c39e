"""`maurice-replay trials` and `trials-table`: many runs over drives, filters and seeds; their statistics."""

from __future__ import annotations

import io
import math
import os
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import polars as pl
from rich.table import Table

from maurice_datasets.trials.engine import DASK, LOCAL, run_plan
from maurice_datasets.trials.plan import read_plan, shipped_plans
from maurice_datasets.trials.table import DEFAULT, Difference, Group, grouped, load_trials, paired
from maurice_loaders.files import expect_absent, write_whole

from ..errors import OptionError
from ..listener import progress_of
from ..plots.figures import FORMATS, draw_figures
from ..reports.trials_report import trials_report as write_report
from ..text.trials import metric_title
from . import options as opt
from .console import listening, note, print_json, results
from .options import argument, option

PLAN = f"A plan as TOML, or one that comes along: {', '.join(shipped_plans())}."
Folder = Annotated[Path, argument("DIR", "A folder that `trials` has made.")]


def trials(
    plan: Annotated[str, argument("PLAN", PLAN)],
    output: Annotated[
        Path, option("-o --output", "The folder that the rows go to.", metavar="DIR", show_default=False)
    ],
    workers: Annotated[
        int, option("--workers", "Processes at once.", min=1, max=1024, show_default="one for each core")
    ] = os.cpu_count() or 1,
    engine: Annotated[str, option("--engine", f"{LOCAL}, or {DASK} for many machines.")] = LOCAL,
    scheduler: Annotated[
        str | None, option("--scheduler", "Address of a Dask scheduler.", metavar="ADDRESS")
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
        made = run_plan(
            chosen,
            output,
            workers=workers,
            engine=DASK if scheduler else engine,
            scheduler=scheduler,
            resume=resume,
            progress=progress_of(listener, chosen.title),
        )
    if json_output:
        print_json(asdict(made))
        return
    results.print(f"{output}: {made.runs:,} runs, {made.made:,} made now, {made.failed:,} of them failed")
    if made.error is not None:
        note(f"the first that failed: {made.error}; the column error has all")
    note(f"now try: maurice-replay trials-table {output} --by {','.join(_first(chosen))}")


def _first(plan: Any) -> list[str]:
    return list(dict.fromkeys(key for part in plan.parts for key in part.variants.varied))[:2] or ["part"]


def figures(
    folder: Folder,
    output: Annotated[
        Path, option("-o --output", "The folder that the figures go to.", metavar="DIR", show_default=False)
    ],
    only: Annotated[str, option("--only", "Only these numbers, as in 26,34,60.", metavar="NUMBERS")] = "",
    formats: Annotated[
        str, option("--format", f"{', '.join(FORMATS)}, or several.", metavar="FORMATS")
    ] = "png",
    force: opt.Force = False,
) -> None:
    """Draw the thesis's figures from trials, each with the intervals that it lacked."""
    try:
        numbers = [int(word) for word in only.split(",") if word]
    except ValueError:
        raise OptionError(f"found --only {only!r}, expected numbers, like 26,34,60") from None
    with listening() as listener:
        drawn = draw_figures(
            folder,
            output,
            only=numbers,
            formats=[word for word in formats.split(",") if word],
            force=force,
            progress=progress_of(listener, "figures"),
        )
    results.print(f"{len(drawn.files)} files written to {output}")
    for number, why in drawn.left_out:
        note(f"figure {number} left out: {why}")


def trials_report(
    folder: Folder,
    output: Annotated[Path, option("-o --output", "The page to write.", metavar="OUT.html")] = Path(
        "trials.html"
    ),
    force: opt.Force = False,
) -> None:
    """Write one page that tells the thesis's trials again: its claims beside our numbers, and the figures."""
    with listening() as listener:
        made = write_report(folder, output, force=force, progress=progress_of(listener, "figures"))
    results.print(f"{made} written")


def trials_view(
    folder: Folder,
    metric: Annotated[
        str, option("--metric", "A column of the rows: what is along y, and what is worst.")
    ] = DEFAULT,
    by: Annotated[
        str | None,
        option("--by", "The setting along x.", metavar="COLUMN", show_default="particles, or what is varied"),
    ] = None,
    run: Annotated[
        str | None,
        option(
            "--run",
            "The run to show.",
            metavar="PART/SESSION/VARIANT/SEED",
            show_default="the worst of the first part",
        ),
    ] = None,
    rrd: Annotated[
        Path | None,
        option("-o --rrd", "Write the Rerun recording to this file and open no viewer.", metavar="OUT.rrd"),
    ] = None,
    force: opt.Force = False,
    json_output: opt.Json = False,
) -> None:
    """Show the curves of trials beside the run behind one of their points, made again from its row."""
    from ..app.trials import trials_view as show_trials  # imports Rerun, which the other commands do without

    with listening() as listener:
        shown = show_trials(folder, metric=metric, by=by, run=run, to=rrd, force=force, listener=listener)
    if json_output:
        print_json(asdict(shown) | {"is_same": shown.is_same, "rrd": shown.rrd and str(shown.rrd)})
        return
    results.print(f"{shown.run}: made again{', the same error to the last bit' if shown.is_same else ''}")
    note("the worst of the part are shown by --run " + ", ".join(shown.worst))


def trials_table(
    folder: Folder,
    by: Annotated[
        str, option("--by", "Group by these columns or settings.", metavar="COLUMNS", show_default=False)
    ] = "",
    metric: Annotated[str, option("--metric", "A column of the rows; docs/trials.md lists them.")] = DEFAULT,
    where: Annotated[
        list[str] | None,
        option("--where", "Only rows with COLUMN=VALUE; repeat for more.", metavar="COLUMN=VALUE"),
    ] = None,
    csv: Annotated[Path | None, option("--csv", "Write the groups here.", metavar="FILE")] = None,
    parquet: Annotated[Path | None, option("--parquet", "Write the groups here.", metavar="FILE")] = None,
    force: opt.Force = False,
    json_output: opt.Json = False,
) -> None:
    """Print grouped figures with intervals, and differences from the first group, run by run."""
    rows, columns = load_trials(folder, where or []), [name for name in by.split(",") if name]
    groups, differences = grouped(rows, columns, metric), paired(rows, columns, metric)
    for file in (csv, parquet):
        if file is not None:
            expect_absent(file, force=force)
            _write(file, groups, parquet=file is parquet, force=force)
    if json_output:
        print_json({"metric": metric, "groups": _plain(groups), "differences": _plain(differences)})
        return
    results.print(_groups(groups, metric))
    if differences:
        results.print(_differences(differences, metric))


def _plain(found: list[Group] | list[Difference]) -> list[dict[str, Any]]:
    """Return groups as plain values; what is not known or infinite is null."""
    kept = []
    for one in found:
        values = {key: value for key, value in asdict(one).items() if key != "curve"}
        figure = values.pop("figure")
        told = values | figure | {"median": values.get("median")}
        kept.append(
            {
                key: None if isinstance(value, float) and not math.isfinite(value) else value
                for key, value in told.items()
            }
        )
    return kept


def _write(file: Path, groups: list[Group], *, parquet: bool, force: bool) -> None:
    rows = [{**one.pop("by"), **one} for one in _plain(groups)]
    frame, held = pl.DataFrame(rows, infer_schema_length=None), io.BytesIO()
    if parquet:
        frame.write_parquet(held)
    else:
        frame.write_csv(held)
    write_whole(file, held.getvalue(), force=force)


def _groups(groups: list[Group], metric: str) -> Table:
    title, factor = metric_title(metric)
    localize = metric == "pictures_to_localize"
    named = "localized (%)" if localize else title
    table = Table(title=title.removesuffix(" (%)") if localize else title, title_justify="left")
    for name in groups[0].by if groups else ():
        table.add_column(name)
    for name in (named, "95 % interval", "median", "runs", "failed"):
        table.add_column(name, justify="right")
    for one in groups:
        figure = one.figure
        limits = f"{figure.low * factor:.1f} to {figure.high * factor:.1f}"
        middle = one.median if localize else one.median * factor
        cells = (f"{figure.value * factor:.1f}", limits, _or_dash(middle), str(one.runs), str(one.failed))
        table.add_row(*(str(value) for value in one.by.values()), *cells)
    if localize:
        table.caption = "median by Kaplan and Meier: runs that were not localized are censored at their end"
    return table


def _differences(differences: list[Difference], metric: str) -> Table:
    title, factor = metric_title(metric)
    against = ", ".join(str(value) for value in differences[0].against.values())
    table = Table(title=f"{title}, less that of {against}, on the same drives", title_justify="left")
    for name in differences[0].by:
        table.add_column(name)
    for name in ("difference", "95 % interval", "pairs"):
        table.add_column(name, justify="right")
    for one in differences:
        figure = one.figure
        limits = f"{figure.low * factor:+.1f} to {figure.high * factor:+.1f}"
        cells = (f"{figure.value * factor:+.1f}", limits, str(figure.count))
        table.add_row(*(str(value) for value in one.by.values()), *cells)
    return table


def _or_dash(value: float) -> str:
    return f"{value:.1f}" if math.isfinite(value) else "-"
