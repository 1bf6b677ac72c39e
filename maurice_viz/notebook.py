"""For notebooks: a run in Rerun's own widget, its figures and traces as polars frames, and their plots.

The widget needs the extra `notebook` (`pip install 'maurice-replay[notebook]'`). Its viewer is served from
this machine; `RERUN_NOTEBOOK_ASSET`, set before anything of Rerun is imported, says otherwise.
"""

from __future__ import annotations

import importlib.util
import json
import os
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import polars as pl

from maurice_loaders.errors import InputError
from maurice_loaders.files.writing import temporary_folder
from maurice_loaders.runs.store import SavedRun, open_runs
from maurice_loaders.session_log.header import session_in
from maurice_mcl.values import expected_one_of

from .app.replay import replay
from .app.snapshot import draw_saved
from .entities import STEP
from .errors import SILENT, Listener
from .plots.calibration import expect_matplotlib
from .running.filters import AnyFilter
from .running.output import Output, decisive_step_of, verdict_of
from .running.run import RunScores
from .running.saved_steps import Collected, Pictures, Restored, collect
from .style import LOST, RUN_COLORS, Scale, scale_for, units_named
from .text.summary import to_json

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Place: TypeAlias = str | Path
Side: TypeAlias = int | Literal["auto"]

INSTALL_COMMAND = "pip install 'maurice-replay[notebook]'"
ASSETS_VARIABLE = "RERUN_NOTEBOOK_ASSET"
SERVED_HERE = "serve-local"  # Rerun's default is a web site of its own
WIDTH: Side = "auto"
HEIGHT: Side = 760
HEIGHT_IN, WIDTH_IN = 2.2, 8.0  # of each pair of axes
UNITS = {"_m": " (m)", "_rad": " (rad)", "_s": " (s)"}  # by the end of a column's name


def show(
    source: Place,
    *,
    layout: str | None = None,
    width: Side = WIDTH,
    height: Side = HEIGHT,
    filter: AnyFilter = None,  # noqa: A002
    listener: Listener = SILENT,
) -> None:
    """Show a saved run, a recording (.rrd) or a session log in Rerun's widget, below the cell.

    The verdict, one line that says what happened, stands above the viewer. `layout` names the tab to begin
    with, for all but a recording, which has its own. `filter` is that of a session log, which is replayed.
    ImportError without the extra `notebook`; InputError for bad files.

        >>> import maurice_viz as mv
        >>> mv.show("my-run", layout="traces")  # doctest: +SKIP
    """
    expect_widget()
    path = Path(source)
    if path.suffix == ".rrd":
        _display(path, width, height)
        return
    with temporary_folder("maurice-notebook") as folder:
        recording = folder / "shown.rrd"
        if path.is_dir() and session_in(path) == path:
            draw_saved(path, recording, layout, listener)
        else:
            shown = Output(recording, layout=layout, is_temporary=True)
            replay(path, filter=filter, output=shown, listener=listener)
        _display(recording, width, height)


def results(run: Place) -> pl.DataFrame:
    """Return the scores of a saved run or of a comparison: one row per run, as `--json` has them.

    Without `odometry_alone`, for which the filter is needed, of which nothing is opened here.

    Meters, radians and seconds; null where a score does not apply. InputError for what is no saved run.

        >>> import maurice_viz as mv
        >>> mv.results("my-run").height
        1
    """
    rows = [
        to_json(_collected(saved).results, Scale(units_named(saved.manifest.display_units)))["runs"][0]
        for saved in open_runs(Path(run))
    ]
    scores = [{key: value for key, value in row.items() if key != "odometry_alone"} for row in rows]
    return pl.DataFrame([_flat(row) for row in scores], infer_schema_length=None)


def traces(run: Place) -> pl.DataFrame:
    """Return the tables of a saved run or of a comparison: one row per step and run (docs/python.md).

    Meters, radians and seconds, poses in the map's frame; null where something is not known. InputError for
    what is no saved run.

        >>> import maurice_viz as mv
        >>> mv.traces("my-run").height
        14
    """
    return pl.concat([_traces(saved) for saved in open_runs(Path(run))])


def plot(runs: RunScores | pl.DataFrame | str | Path, *columns: str) -> Figure:
    """Return a matplotlib figure of columns of runs over time, one below the other, in the runs' colors.

    `runs` is what `replay` or `compare` returned, a saved run, or a frame of `traces`; `columns` are numbers
    of a run's table (docs/python.md), "error_m" if none is named. Where the robot was kidnapped stands a red
    line. InputError for a column that there is not, and without matplotlib.

        >>> import maurice_viz as mv
        >>> figure = mv.plot("my-run", "error_m", "ess_share")
        >>> [axes.get_ylabel() for axes in figure.axes]
        ['error (m)', 'ess share']
    """
    expect_matplotlib(Path("figure"))
    from matplotlib import pyplot

    steps, names = _steps_of(runs), columns or ("error_m",)
    numbers = [column for column, kind in steps.schema.items() if kind.is_numeric() or kind == pl.Boolean]
    for name in names:
        if name not in numbers:
            raise InputError(None, f"plot: found no numbers {name!r}; {expected_one_of(name, numbers)}")
        if steps[name].null_count() == len(steps):
            raise InputError(
                None, f"plot: {name} is not known at any step of these runs, such as without truth"
            )
    size = (WIDTH_IN, HEIGHT_IN * len(names))
    figure, grid = pyplot.subplots(len(names), squeeze=False, sharex=True, figsize=size, layout="constrained")
    for axes, name in zip(grid[:, 0], names, strict=True):
        for number, ((label,), run) in enumerate(steps.group_by("label", maintain_order=True)):
            color = _shares(RUN_COLORS[number % len(RUN_COLORS)])
            style = "steps-post" if run.schema[name] == pl.Boolean else "default"
            axes.plot(run["time_s"], run[name].cast(float), color=color, label=label, drawstyle=style)
        for time_s in steps.filter(steps["kidnapped"])["time_s"].unique():
            axes.axvline(time_s, color=_shares(LOST))
        axes.set_ylabel(_axis(name))
        axes.spines[["top", "right"]].set_visible(False)
    grid[-1, 0].set_xlabel("time (s)")
    grid[0, 0].legend(frameon=False)
    return figure


def _steps_of(runs: RunScores | pl.DataFrame | str | Path) -> pl.DataFrame:
    if isinstance(runs, (str, Path)):
        return traces(runs)
    steps = runs.steps if hasattr(runs, "steps") else runs
    if "label" not in getattr(steps, "columns", ()):
        expected = "expected runs, a saved run, or a frame of `traces`"
        raise InputError(None, f"plot: found {type(runs).__name__} without the steps of a run; {expected}")
    return steps


def _axis(name: str) -> str:
    """Return a column's name as an axis has it, with its unit."""
    end = next((end for end in UNITS if name.endswith(end)), "")
    return name.removesuffix(end).replace("_", " ") + UNITS.get(end, "")


def _shares(color: Sequence[int]) -> tuple[float, ...]:
    return tuple(part / 255 for part in color)


def expect_widget() -> None:
    """Raise ImportError with the command that installs it where Rerun's widget is missing."""
    if importlib.util.find_spec("rerun_notebook") is None:
        raise ImportError(f"Rerun's notebook widget is not installed; {INSTALL_COMMAND}")
    os.environ.setdefault(ASSETS_VARIABLE, SERVED_HERE)


def _display(recording: Path, width: Side, height: Side) -> None:
    from IPython.display import Markdown, display  # type: ignore[import-not-found]  # with the extra
    from rerun_notebook import Viewer  # type: ignore[import-not-found]

    if not recording.is_file():
        raise InputError(recording, "found no such recording; replay a session with -o FILE.rrd to make one")
    # our colors are made for a dark ground, whatever the notebook's is
    viewer = Viewer(width=width, height=height, theme="dark")
    # the file as it is: it begins with its layout. Through a recording stream, whose first message names
    # a recording, the widget would have chosen a layout of its own before
    viewer.send_rrd(recording.read_bytes())
    if (step := decisive_step_of(recording)) is not None:
        viewer._on_raw_event(partial(_stand_at, viewer, [step]))
    if verdict := verdict_of(recording):
        display(Markdown(verdict))
    display(viewer)


def _stand_at(viewer: Any, steps: list[int], event: str) -> None:
    """Move the viewer to the step in the list, once, when it says that it has a timeline."""
    if steps and json.loads(event)["type"] == "timeline_change":
        viewer.set_time_ctrl(STEP, sequence=steps.pop(), play=False)


def _collected(run: SavedRun) -> Collected:
    """Go through a saved run without its pictures: all that is needed here was kept."""
    arena = run.arena()
    scale = scale_for(run.manifest.display_units, arena)
    return collect([Restored(run, None)], Pictures(), scale, arena, SILENT)


def _flat(row: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for key, value in row.items():
        if isinstance(value, dict):
            flat |= _flat(value, f"{prefix}{key}_")
        elif not isinstance(value, (list, tuple)):
            flat[f"{prefix}{key}"] = value
    return flat


def _traces(run: SavedRun) -> pl.DataFrame:
    (track,) = _collected(run).tracks
    return track.table.frame().select(pl.lit(run.manifest.label).alias("label"), pl.all())
