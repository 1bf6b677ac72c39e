"""`maurice-replay check SESSION...`: whether a filter does what is demanded of it, for a build server."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer
from rich import box
from rich.table import Table
from rich.text import Text

from maurice_mcl.scoring.demands import Demands

from ..app.check.check import CheckResult
from ..app.check.check import check as run_check
from ..app.check.drive import DriveCheck
from ..running.output import by_suffix
from .shared import options as opt
from .shared.console import listening, note, print_json, results
from .shared.options import argument, option
from .shared.values import read_length

DEMANDS, COMPARE, OUTPUT = "Demands", "Baseline", "Output"
MET, FAILED = "held", "FAILED"


@dataclass(frozen=True, slots=True)
class DemandSet:
    """What is demanded of the runs."""

    max_error: Annotated[
        str | None,
        option("--max-error", "Mean position error: 0.3m, 30cm, 12in.", DEMANDS, metavar="LENGTH"),
    ] = None
    localized_by: Annotated[
        int | None,
        option("--localized-by", "Localized within so many steps, and not lost after.", DEMANDS, min=1),
    ] = None
    converged_by: Annotated[
        int | None,
        option("--converged-by", "Sure of one place within so many; needs no true poses.", DEMANDS, min=1),
    ] = None
    min_localized: Annotated[
        float, option("--min-localized", "Share of the runs that must meet each demand.", DEMANDS)
    ] = 0.95
    seeds: Annotated[int, option("--seeds", "Runs with seeds 0, 1, 2, ...", DEMANDS, min=1, max=10_000)] = 1

    def demands(self) -> Demands:
        """Return all of it as `maurice_viz.check` takes it."""
        length_m = None if self.max_error is None else read_length(self.max_error, "--max-error")
        return Demands(length_m, self.localized_by, self.converged_by, self.min_localized)


def check(
    sessions: Annotated[
        list[Path], argument("SESSION...", "A session log, or a recording of any format (see `inspect`).")
    ],
    demands: DemandSet,
    chosen: opt.FilterSet,
    reading: opt.ReadingSet,
    against: Annotated[
        Path | None,
        option("--against", "Fail where this is worse, seed by seed.", COMPARE, metavar="FILE.parquet"),
    ] = None,
    files: Annotated[
        list[Path] | None,
        opt.writes(
            "OUT.xml|OUT.parquet",
            "OUT.xml: write JUnit XML. OUT.parquet: write the runs, for --against later. Repeatable.",
            OUTPUT,
        ),
    ] = None,
    artifacts: Annotated[
        Path | None,
        option("--artifacts", "Where a run failed: write why, and a recording.", OUTPUT, metavar="FOLDER"),
    ] = None,
    force: opt.Force = False,
    json_output: opt.Json = False,
) -> None:
    """Run a filter with many seeds; exit status 0 if it does what is demanded of it, 1 if not."""
    outputs = by_suffix(files, (".xml", ".parquet"))
    with listening() as listener:
        result = run_check(
            sessions,
            chosen.library,
            chosen.filter(),
            demands=demands.demands(),
            seeds=demands.seeds,
            reading=reading.options(),
            against=against,
            to=[*outputs.values(), *([artifacts] if artifacts else [])],
            force=force,
            listener=listener,
        )
    if json_output:
        print_json(result)
    else:
        _print(result)
    if demands.seeds == 1 and not all(drive.recorded for drive in result.drives):
        note("one run may be luck: --seeds 20 tests the rate")
    if not result.passed:
        raise typer.Exit(1)


def _print(result: CheckResult) -> None:
    for drive in result.drives:
        if drive.demands:
            results.print(_demands(drive))
        if drive.changes:
            results.print(_changes(drive))
        lines = [f"not certain: {text}" for text in drive.doubts]
        if drive.failure is not None:
            lines += drive.failure.text.splitlines()
            if drive.failure.recording is not None:
                lines.append(f"recording: {drive.failure.recording}")
        for line in lines:
            results.say(line)
    failed = [drive.session for drive in result.drives if not drive.passed]
    results.say(f"failed: {', '.join(failed)}" if failed else "passed")


def _table(title: str, *names: str) -> Table:
    table = Table(
        title=Text(title, no_wrap=True, overflow="ignore"),
        title_justify="left",
        box=box.SIMPLE_HEAD,
        pad_edge=False,
    )
    for name in names:
        table.add_column(name)
    return table


def _demands(drive: DriveCheck) -> Table:
    count = len(drive.runs)
    title = f"{drive.session}\n{count} run{'s' * (count > 1)} of {len(drive.steps)} steps"
    if count > 1 and drive.demands:
        title += f"; {drive.demands[0].needed:.0%} of the runs have to meet each demand"
    table = _table(title, "demand", "met by", "95 % interval", "")
    for demand in drive.demands:
        met = f"{demand.met} of {demand.runs}"
        interval = f"{demand.low:.0%} to {demand.high:.0%}" if demand.runs > 1 else "-"
        result = MET if demand.passed else FAILED
        table.add_row(f"{demand.title}\n  {demand.found}", met, interval, result)
    return table


def _changes(drive: DriveCheck) -> Table:
    title = f"{drive.session}\nagainst the baseline, {drive.changes[0].pairs} seeds"
    table = _table(title, "figure", "difference", "95 % interval", "p", "")
    for change in drive.changes:
        values = (change.before, change.now, change.difference, change.low, change.high)
        before, now, by, low, high = (drive.figure(change.kind, value) for value in values)
        name = f"{change.title}\n  {before} before, {now} now"
        table.add_row(name, by, f"{low} to {high}", f"{change.p:.2g}", MET if change.passed else FAILED)
    return table
