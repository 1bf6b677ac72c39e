"""One page about trials: what every variant reached, and where on the floor runs go wrong."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import polars as pl

from maurice_datasets.trials.folder import TrialsFolder
from maurice_datasets.trials.plan import shipped_plans
from maurice_datasets.trials.rows import read_plan_of
from maurice_datasets.trials.table import grouped, load_trials
from maurice_loaders.files.writing import expect_absent, write_whole
from maurice_mcl.values import INCH_M

from ..errors import OptionError
from .atlas import atlas_section
from .pages import page_of_template


def trials_report(
    trials: str | Path,
    to: str | Path = "trials.html",
    *,
    spot_m: float | None = None,
    where: Sequence[str] = (),
    force: bool = False,
) -> Path:
    """Write one self-contained page about a folder of trials: what every variant reached, with intervals.

    Trials with truth also have an atlas: error, rank of the truth and time to localize on the floor plan, the
    worst runs of every spot with the commands that show them, and how far confidence can be trusted. `where`
    keeps rows with `column=value`. `spot_m` is the width of a spot in meters; None: the distance up to which
    an update is correct. Returns the file. InputError for a folder without trials and for a file that exists,
    unless `force` is given.

        >>> import maurice_viz as mv
        >>> mv.trials_report("trials", to="trials.html")  # doctest: +SKIP
        PosixPath('trials.html')
    """
    file = Path(to)
    if file.suffix.lower() not in (".html", ".htm"):
        raise OptionError(f"found {file.name!r}, expected a name that ends in .html")
    expect_absent(file, force=force)
    write_whole(file, page_of(Path(trials), spot_m, where).encode(), force=force)
    return file


def page_of(folder: Path, spot_m: float | None = None, where: Sequence[str] = ()) -> str:
    """Return the page."""
    plan, rows = read_plan_of(folder), load_trials(folder, where).filter(pl.col("error").is_null())
    return page_of_template(
        "trials.html",
        title=plan["title"],
        parts=_parts(rows, plan),
        results=_results(rows, plan),
        about=_about(rows),
        atlas=atlas_section(TrialsFolder(folder), rows, spot_m),
    )


def _parts(rows: pl.DataFrame, plan: dict[str, Any]) -> list[dict[str, Any]]:
    return [
        {
            "title": part["title"],
            "runs": len(rows.filter(pl.col("part") == part["name"])),
            "command": f"maurice-replay trials run {_plan_named(part['name'])} -o trials",
        }
        for part in plan["parts"]
    ]


def _plan_named(part: str) -> str:
    return part if part in shipped_plans() else f"{part}.toml"


def _results(rows: pl.DataFrame, plan: dict[str, Any]) -> list[dict[str, Any]]:
    """Return what every variant of every part reached: rows of a table, part by part."""
    tables = []
    for part in plan["parts"]:
        of_part = rows.filter(pl.col("part") == part["name"])
        if of_part.is_empty():
            continue
        by = ["session", "label"]
        errors, rights = (grouped(of_part, by, metric) for metric in ("error_m", "right_at_end"))
        recorded = of_part["arena"].null_count() == len(of_part)
        unit, factor = ("m", 1.0) if recorded else ("in", 1 / INCH_M)
        heads = ("Session", "Variant", "Runs", f"Position error, mean ({unit})", "Right at the end (%)")
        lines = [
            (*error.by.values(), error.runs, error.figure.text(factor, 2), right.figure.text(100, 0))
            for error, right in zip(errors, rights, strict=True)
        ]
        named = [list(zip(heads, line, strict=True)) for line in lines]
        tables.append({"title": part["title"], "heads": heads, "rows": named})
    return tables


def _about(rows: pl.DataFrame) -> str:
    versions = ", ".join(sorted(set(rows["version"].drop_nulls())))
    arenas = rows["arena"].drop_nulls().n_unique()
    simulated = f" in {arenas} simulated arenas, none of them used for tuning"
    where = f"{len(rows):,} runs{simulated if arenas else ' over recorded sessions'}"
    return f"{where}; maurice-replay {versions}"
