"""Numbers of runs over time, for papers and notebooks: any columns of a run's table."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from maurice_loaders.errors import InputError
from maurice_mcl.values import expected_one_of

from ..style import LOST, RUN_COLORS
from .calibration import expect_matplotlib

if TYPE_CHECKING:
    import polars as pl
    from matplotlib.figure import Figure

    from ..running.run import RunScores

HEIGHT_IN, WIDTH_IN = 2.2, 8.0  # of each pair of axes
UNITS = {"_m": " (m)", "_rad": " (rad)", "_s": " (s)"}  # by the end of a column's name


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
    import polars as pl
    from matplotlib import pyplot

    steps, names = _steps_of(runs), columns or ("error_m",)
    numbers = [column for column, kind in steps.schema.items() if kind.is_numeric() or kind == pl.Boolean]
    for name in names:
        if name not in numbers:
            raise InputError(None, f"plot: found no numbers {name!r}; {expected_one_of(name, numbers)}")
    size = (WIDTH_IN, HEIGHT_IN * len(names))
    figure, grid = pyplot.subplots(len(names), squeeze=False, sharex=True, figsize=size, layout="constrained")
    for axes, name in zip(grid[:, 0], names, strict=True):
        for number, ((label,), run) in enumerate(steps.group_by("label", maintain_order=True)):
            color = _shares(RUN_COLORS[number % len(RUN_COLORS)])
            axes.plot(run["time_s"], run[name].cast(float), color=color, label=label)
        for time_s in steps.filter(steps["kidnapped"])["time_s"].unique():
            axes.axvline(time_s, color=_shares(LOST))
        axes.set_ylabel(_axis(name))
        axes.spines[["top", "right"]].set_visible(False)
    grid[-1, 0].set_xlabel("time (s)")
    grid[0, 0].legend(frameon=False)
    return figure


def _steps_of(runs: RunScores | pl.DataFrame | str | Path) -> pl.DataFrame:
    from ..notebook import traces

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
