"""`maurice-replay check SESSION...`: whether a filter does what is demanded of it, for a build server."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich import box
from rich.table import Table
from rich.text import Text

from ..app.check.check import CheckResult
from ..app.check.check import check as run_check
from ..app.check.drive import DriveCheck
from .shared import options as opt
from .shared.console import listening, note, print_json, results
from .shared.options import argument, option, read_length, reading_of, settings_of

DEMANDS, COMPARE, OUTPUT = "Demands", "Baseline", "Output"
HELD, FAILED = "held", "FAILED"


def check(
    sessions: Annotated[
        list[Path], argument("SESSION...", "A session log, or a recording of any format (see `formats`).")
    ],
    max_error: Annotated[
        str | None,
        option("--max-error", "Mean position error: 0.3m, 30cm, 12in.", DEMANDS, metavar="LENGTH"),
    ] = None,
    localized_by: Annotated[
        int | None,
        option("--localized-by", "Localized within so many steps, and not lost after.", DEMANDS, min=1),
    ] = None,
    converged_by: Annotated[
        int | None,
        option("--converged-by", "Sure of one place within so many; needs no true poses.", DEMANDS, min=1),
    ] = None,
    min_localized: Annotated[
        float, option("--min-localized", "Share of the runs that must meet each demand.", DEMANDS)
    ] = 0.95,
    seeds: Annotated[int, option("--seeds", "Runs with seeds 0, 1, 2, ...", DEMANDS, min=1, max=10_000)] = 1,
    against: Annotated[
        Path | None,
        option("--against", "Fail where this is worse, seed by seed.", COMPARE, metavar="FILE.parquet"),
    ] = None,
    save_baseline: Annotated[
        Path | None,
        option("--save-baseline", "Write the runs for --against.", COMPARE, metavar="FILE.parquet"),
    ] = None,
    library: opt.Library = None,
    preset: opt.Preset = None,
    feature: opt.Feature = None,
    particles: opt.Particles = None,
    start: opt.Start = None,
    config: opt.Config = None,
    settings: opt.Set = None,
    junit: Annotated[Path | None, option("--junit", "Write JUnit XML.", OUTPUT, metavar="FILE.xml")] = None,
    artifacts: Annotated[
        Path | None,
        option(
            "--artifacts", "Where a run failed: write why, and a recording of it.", OUTPUT, metavar="FOLDER"
        ),
    ] = None,
    force: opt.Force = False,
    json_output: opt.Json = False,
    reading: opt.Reading = None,
    keep_going: opt.KeepGoing = False,
) -> None:
    """Run a filter with many seeds; exit status 0 if it does what is demanded of it, 1 if not."""
    with listening() as listener:
        found = run_check(
            sessions,
            library,
            max_error_m=None if max_error is None else read_length(max_error, "--max-error"),
            localized_by=localized_by,
            converged_by=converged_by,
            min_localized=min_localized,
            seeds=seeds,
            preset=preset,
            feature=feature,
            particles=particles,
            start=start,
            config=config,
            settings=settings_of(settings),
            reading=reading_of(reading, keep_going=keep_going),
            against=against,
            save_baseline=save_baseline,
            junit=junit,
            artifacts=artifacts,
            force=force,
            listener=listener,
        )
    if json_output:
        print_json(found.to_json())
    else:
        _print(found)
    if seeds == 1:
        note("one run may be luck: --seeds 20 tests the rate")
    if not found.passed:
        raise typer.Exit(1)


def _print(found: CheckResult) -> None:
    for drive in found.drives:
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
            results.print(line, soft_wrap=True)
    failed = [drive.session for drive in found.drives if not drive.passed]
    results.print(f"failed: {', '.join(failed)}" if failed else "passed", soft_wrap=True)


def _table(title: str, *names: str) -> Table:
    table = Table(title=Text(title), title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False)
    for name in names:
        table.add_column(name)
    return table


def _demands(drive: DriveCheck) -> Table:
    count = len(drive.runs)
    title = f"{drive.session}: {count} run{'s' * (count > 1)} of {len(drive.steps)} steps"
    if count > 1 and drive.demands:
        title += f"; {drive.demands[0].needed:.0%} of the runs have to meet each demand"
    table = _table(title, "demand", "met by", "95 % interval", "")
    for one in drive.demands:
        met = f"{one.met} of {one.runs}"
        interval = f"{one.low:.0%} to {one.high:.0%}" if one.runs > 1 else "-"
        result = HELD if one.passed else FAILED
        table.add_row(f"{one.title}\n  {one.found}", met, interval, result)
    return table


def _changes(drive: DriveCheck) -> Table:
    title = f"{drive.session}: against the baseline, {drive.changes[0].pairs} seeds"
    table = _table(title, "figure", "difference", "95 % interval", "p", "")
    for one in drive.changes:
        values = (one.before, one.now, one.difference, one.low, one.high)
        before, now, by, low, high = (drive.figure(one.kind, value) for value in values)
        name = f"{one.title}\n  {before} before, {now} now"
        table.add_row(name, by, f"{low} to {high}", f"{one.p:.2g}", HELD if one.passed else FAILED)
    return table
