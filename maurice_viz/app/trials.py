"""Trials in the viewer: their curves beside the run behind a chosen point, recomputed from its row."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import rerun as rr

from maurice_datasets.trials.statistics import mean
from maurice_datasets.trials.table import DEFAULT, NUMBERS, TIMES, clusters_of
from maurice_loaders.errors import InputError
from maurice_mcl.analysis.failures.verdict import decisive_step

from ..drawing.canvas import png
from ..drawing.run_chart import SERIES, Mean, RunChart, Series
from ..entities import TRIALS_CHART, TRIALS_CHOSEN, TRIALS_RUNS, TRIALS_TEXT
from ..layouts.trials import trials as layout
from ..listener import SILENT, Listener
from ..panels.panel import MARKDOWN
from ..playback import FilterRun, run_together, shared
from ..plots.material import Material, NothingToDraw
from ..scene import RunView
from ..style import RUN_COLORS
from ..text.trials import metric_title, name_of, run_text
from .output import DriveScene, OutputOptions, layout_of, observed, opened
from .run import Playback, collector_of, step_through

PARTICLES, WORST, DOT, LARGE = "particles", 5, 3.0, 9.0
Row = dict[str, Any]


@dataclass(frozen=True, slots=True)
class TrialsView:
    """What was drawn."""

    run: str  # PART/SESSION/VARIANT/SEED
    error_m: float | None  # of the row
    recomputed_m: float | None  # of the same run, made again
    rrd: Path | None
    worst: tuple[str, ...] = field(default=())  # the runs of the part with the greatest values

    @property
    def is_same(self) -> bool:
        """Whether the run made again has the error of its row, to the last bit."""
        return self.error_m == self.recomputed_m


def trials_view(
    folder: str | Path,
    *,
    metric: str = DEFAULT,
    by: str | None = None,
    run: str | None = None,
    to: str | Path | None = None,
    force: bool = False,
    listener: Listener | None = None,
) -> TrialsView:
    """Draw the curves of a part of trials beside one of its runs, made again from its row.

    `run` is PART/SESSION/VARIANT/SEED; None: the run of the first part with the greatest `metric`. `by` is
    the setting along x; None: the number of particles, or the first setting that the part varies. `to` is the
    Rerun recording to write; None: a viewer, where there is a display. InputError for what is not there.

        >>> import maurice_viz as mv
        >>> mv.trials_view("trials", to="trials.rrd")  # doctest: +SKIP
    """
    if metric not in NUMBERS or metric in TIMES:
        there = ", ".join(name for name in NUMBERS if name not in TIMES)
        raise InputError(None, f"found --metric {metric!r}, expected one of {there}")
    material, listener = Material(Path(folder)), listener or SILENT
    row = _chosen(material, metric, run)
    rows = material.part(row["part"], session=row["session"])
    ordered = rows.filter(pl.col(metric).is_not_null()).sort(metric, "seed", descending=[True, False])
    worst = list(ordered[:WORST].iter_rows(named=True))
    chart = chart_of(rows, metric, by or _varied(rows))
    output = OutputOptions("trials", None if to is None else Path(to), to is not None, force=force)
    playback, written = _playback(material, row), list[Path]()
    collector = collector_of(playback)
    blueprint = layout_of(playback.views, playback.scene, "trials", extra={"trials": layout})

    def step() -> int | None:
        return decisive_step(collector.verdicts()) if collector.updates else None

    name = playback.scene.info.name
    with opened(output, name, blueprint, listener, written=written, decisive=step) as rec:
        _draw(rec, chart, rows, row, metric)
        with observed(rec, playback.views, playback.scene) as observers:
            step_through(playback, observers, {}, collector, listener)
        again = collector.results()[0].score.position_error_mean_m
        same = again == row[DEFAULT]
        text = run_text(material.folder, row, worst, metric, same)
        rec.log(TRIALS_TEXT, rr.TextDocument(text, media_type=MARKDOWN), static=True)
    if not same:
        made = f"version {row['version']}, numpy {row['numpy']}, on {row['host']}"
        listener.warning(f"{name_of(row)}: made again, its error is not that of its row ({made})")
    names = tuple(name_of(one) for one in worst)
    return TrialsView(name_of(row), row[DEFAULT], again, written[0] if written else None, names)


def _chosen(material: Material, metric: str, run: str | None) -> Row:
    """Return the row of a run by its name, or the one with the greatest figure of the first part."""
    if run is not None:
        part, _, rest = run.partition("/")
        session, *numbers = rest.rsplit("/", 2)
        if len(numbers) != 2 or not all(number.isdigit() for number in numbers):
            raise InputError(None, f"found --run {run!r}, expected PART/SESSION/VARIANT/SEED")
        variant, seed = map(int, numbers)
        try:
            return material.part(part, session=session, variant=variant, seed=seed).row(0, named=True)
        except NothingToDraw:
            why = f"found no run {run!r}, expected one of its rows"
            raise InputError(
                material.folder, f"{why}; maurice-replay trials-table prints what there is"
            ) from None
    rows = material.rows.filter(pl.col(metric).is_not_null())
    for part in material.parts:
        some = rows.filter(pl.col("part") == part)
        if not some.is_empty():
            return some.sort(metric, "seed", descending=[True, False]).row(0, named=True)
    raise InputError(material.folder, f"found no run whose {metric} is known, expected one or more")


def _varied(rows: pl.DataFrame) -> str:
    """Return the setting along x: particles where the part varies them, else the first that it varies."""
    if rows[PARTICLES].n_unique() > 1:
        return PARTICLES
    settings = json.loads(rows["settings"][0] or "{}")
    varied = [name for name in settings if name in rows.columns and rows[name].n_unique() > 1]
    return varied[0] if varied else "label"


def chart_of(rows: pl.DataFrame, metric: str, by: str) -> RunChart:
    """Return the chart of runs over a setting: a series for each combination of all other settings."""
    if by not in rows.columns:
        raise InputError(None, f"found --by {by!r}, expected a column or a setting, like {PARTICLES}")
    title, factor = metric_title(metric)
    known = rows.filter(pl.col(metric).is_not_null()).with_columns(pl.col(metric).cast(pl.Float64) * factor)
    settings = known[by].unique(maintain_order=True).to_list()
    if all(isinstance(value, (int, float)) for value in settings):
        settings = sorted(settings)
    others = [
        name
        for name in ("feature", "preset", PARTICLES)
        if name != by and by != "label" and known[name].n_unique() > 1 and not _goes_with(known, name, by)
    ]
    groups = known.group_by(others, maintain_order=True) if others else [((), known)]
    series = [_series(", ".join(map(str, values)), some, metric, by, settings) for values, some in groups]
    return RunChart(by.replace("_", " "), title, settings, series[: len(SERIES)])


def _goes_with(rows: pl.DataFrame, name: str, by: str) -> bool:
    """Return whether a column is known once the setting along x is."""
    return rows.select(name, by).unique().height == rows[by].n_unique()


def _series(name: str, rows: pl.DataFrame, metric: str, by: str, settings: Sequence[object]) -> Series:
    at = [settings.index(value) for value in rows[by].to_list()]
    values, clusters = rows[metric].to_numpy(), clusters_of(rows)
    means = []
    for number in sorted(set(at)):
        here = np.array(at) == number
        found = mean(values[here], clusters[here])
        means.append(Mean(number, found.value, found.low, found.high))
    runs = [name_of(row) for row in rows.iter_rows(named=True)]
    return Series(name, at, np.asarray(values, np.float64), runs, means)


def _playback(material: Material, row: Row) -> Playback:
    """Prepare the run behind a row to be made again: the same drive, filter and seed."""
    drive, localizer = material.drive_of(row), material.localizer_of(row)
    label = f"{row['label']}, seed {row['seed']}".replace("/", " ")
    again = FilterRun(label, localizer, drive.start)
    scene = DriveScene(drive.session.info, localizer.library, row["off_m"] is not None, row["updates"])
    updates = shared(run_together([again], drive.session.moments()))
    return Playback(
        updates, row["updates"], [RunView.live(label, localizer, drive.start)], scene, lambda collector: None
    )


def _draw(rec: rr.RecordingStream, chart: RunChart, rows: pl.DataFrame, row: Row, metric: str) -> None:
    """Draw the chart, a point for each run, and the chosen one larger in its own color."""
    picture = rr.EncodedImage(contents=png(chart.draw()), media_type="image/png", draw_order=-10.0)
    rec.log(TRIALS_CHART, picture, static=True)
    _, factor = metric_title(metric)
    for number, one in enumerate(chart.series):
        at, color = chart.points(number), SERIES[number % len(SERIES)]
        labels = [f"{name}: {value:.1f}" for name, value in zip(one.runs, one.values.tolist(), strict=True)]
        radius = rr.components.Radius.ui_points(DOT)
        points = rr.Points2D(at, colors=[color], radii=radius, labels=labels, show_labels=False)
        rec.log(f"{TRIALS_RUNS}/{number}", points, static=True)
        if name_of(row) in one.runs:
            chosen = at[one.runs.index(name_of(row))]
            label = f"seed {row['seed']}: {row[metric] * factor:.1f}"
            marked = rr.Points2D(
                [chosen],
                colors=[RUN_COLORS[0]],
                radii=rr.components.Radius.ui_points(LARGE),
                labels=[label],
                show_labels=True,
                draw_order=40.0,
            )
            rec.log(TRIALS_CHOSEN, marked, static=True)
