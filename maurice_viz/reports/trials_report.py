"""The thesis's trials told again as one page: its claims beside our numbers, then every figure."""

from __future__ import annotations

import base64
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import polars as pl

from maurice_datasets.trials.plan import shipped_plans
from maurice_datasets.trials.rows import read_plan_of
from maurice_datasets.trials.table import grouped
from maurice_loaders.writing import expect_absent, write_whole
from maurice_mcl.geometry import INCH_M

from ..errors import OptionError
from ..plots.calibration import expect_matplotlib
from ..plots.drawn import rendered
from ..plots.figures import FIGURES
from ..plots.material import Material
from .claims import BUILT_IN, CLAIMS, NOT, REPRODUCED, UNDECIDED, UNTESTABLE, judged
from .pages import page_of_template

SECTIONS = (
    (range(4, 15), "Motion and noise (3.2, 3.3)"),
    (range(15, 24), "Matching pictures (3.3)"),
    (range(24, 34), "Position tracking (3.6.2)"),
    (range(34, 41), "Global localization (3.6.3)"),
    (range(41, 44), "What else was observed (3.6.5)"),
    (range(47, 51), "Smoothing (4.2.1)"),
    (range(51, 57), "Edges (4.2.2)"),
    (range(57, 63), "Blended features (4.2.3)"),
    (range(63, 70), "Sensor-aided sampling (4.3)"),
    (range(70, 74), "Cost, and what remained open (5)"),
)
PAGE_DPI = 100
CLASSES = {REPRODUCED: "yes", NOT: "no", UNDECIDED: "open", UNTESTABLE: "none", BUILT_IN: "none"}


@dataclass(frozen=True, slots=True)
class PageFigure:
    """A figure as the page holds it."""

    number: int
    title: str
    data: str  # PNG, base64; empty where it cannot be drawn ...
    missing: str  # ... and why


def trials_report(
    trials: str | Path,
    to: str | Path = "trials.html",
    *,
    force: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> Path:
    """Write one self-contained page about a folder of trials: what every variant reached, with intervals.

    Trials of the shipped plans also get the thesis's claims and its figures. Of each claim it says:
    reproduced, not reproduced, undecided (the trials allow both), built into the simulated robot, or not
    testable. Returns the file.
    InputError for a folder without trials and for a file that exists, unless `force` is given.

        >>> import maurice_viz as mv
        >>> mv.trials_report("trials", to="trials.html")  # doctest: +SKIP
        PosixPath('trials.html')
    """
    file = Path(to)
    if file.suffix.lower() not in (".html", ".htm"):
        raise OptionError(f"found {file.name!r}, expected a name that ends in .html")
    expect_absent(file, force=force)
    expect_matplotlib(file)
    write_whole(file, page_of(Material(Path(trials)), progress).encode(), force=force)
    return file


def page_of(material: Material, progress: Callable[[int, int], None] | None = None) -> str:
    """Return the page."""
    plan, rows = read_plan_of(material.folder), material.rows
    thesis = not {part["name"] for part in plan["parts"]}.isdisjoint(shipped_plans())
    claims = CLAIMS if thesis else ()
    found = list(zip(claims, judged([one.check(material) for one in claims]), strict=True))
    drawn = drawings(material, progress) if thesis else []
    return page_of_template(
        "trials.html",
        title=plan["title"],
        claims=[
            {"claim": one, "finding": finding, "kind": CLASSES[finding.verdict]} for one, finding in found
        ],
        counts={name: sum(finding.verdict == name for _, finding in found) for name in CLASSES},
        sections=[
            (title, [one for one in drawn if one.number in numbers])
            for numbers, title in SECTIONS
            if any(one.number in numbers and one.data for one in drawn)
        ],
        parts=_parts(rows, plan),
        results=_results(rows, plan),
        about=_about(rows),
        drawn=[one.number for one in drawn if one.data],
    )


def drawings(material: Material, progress: Callable[[int, int], None] | None = None) -> list[PageFigure]:
    """Return every figure, or why it cannot be drawn from the folder's runs."""
    titles = {one.number: one.title for one in FIGURES}
    found = rendered(material.folder, tuple(titles), ("png",), titled=False, dpi=PAGE_DPI, progress=progress)
    drawn = [
        PageFigure(
            one.number, titles[one.number], base64.b64encode(b"".join(one.files)).decode(), one.missing
        )
        for one in found
    ]
    return sorted(drawn, key=lambda one: one.number)


def _parts(rows: pl.DataFrame, plan: dict[str, Any]) -> list[dict[str, Any]]:
    return [
        {
            "title": part["title"],
            "runs": len(rows.filter(pl.col("part") == part["name"])),
            "command": f"maurice-replay trials {_plan_named(part['name'])} -o trials",
        }
        for part in plan["parts"]
    ]


def _plan_named(part: str) -> str:
    return part if part in shipped_plans() else f"{part}.toml"


def _results(rows: pl.DataFrame, plan: dict[str, Any]) -> list[dict[str, Any]]:
    """Return what every variant of every part reached: rows of a table, part by part."""
    found = []
    for part in plan["parts"]:
        some = rows.filter(pl.col("part") == part["name"])
        by = ["session", "label"]
        errors, rights = (grouped(some, by, metric) for metric in ("error_m", "right_at_end"))
        recorded = some["arena"].null_count() == len(some)
        unit, factor = ("m", 1.0) if recorded else ("in", 1 / INCH_M)
        lines = [
            (*error.by.values(), error.runs, error.figure.said(factor, 2), right.figure.said(100, 0))
            for error, right in zip(errors, rights, strict=True)
        ]
        found.append({"title": part["title"], "unit": unit, "rows": lines})
    return found


def _about(rows: pl.DataFrame) -> str:
    versions = ", ".join(sorted(set(rows["version"].drop_nulls())))
    arenas = rows["arena"].drop_nulls().n_unique()
    simulated = f" in {arenas} simulated arenas, none of them used for tuning"
    where = f"{len(rows):,} runs{simulated if arenas else ' over recorded sessions'}"
    return f"{where}; maurice-replay {versions}"
