"""Drawing the thesis's figures from a folder of trials, several at once, and writing them."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache, partial
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from maurice_datasets.trials.engine import in_processes
from maurice_datasets.trials.rows import ROWS, expect_trials
from maurice_loaders.errors import InputError
from maurice_loaders.files.writing import check_target, write_whole
from maurice_viz.plots.calibration import INK, expect_matplotlib, figure_bytes

from .figures import FIGURES, OF_PICTURES
from .material import Material, MissingRuns

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FORMATS = ("png", "svg", "pdf")
Work = Callable[[Sequence[int]], "list[RenderedFigure]"]
NO_VALUE = "none of these runs has a value of it; more or longer runs may have"
FEW = 3  # figures that are not worth the start of processes


@dataclass(frozen=True, slots=True)
class RenderedFigure:
    """One figure as files, or why there is none."""

    number: int
    files: tuple[bytes, ...] = ()  # in the order of the formats
    missing: str = ""


@dataclass(frozen=True, slots=True)
class Drawn:
    """What was drawn, and what was not, with the reason."""

    files: tuple[Path, ...]
    left_out: tuple[tuple[int, str], ...]


def draw_figures(
    trials: str | Path,
    to: str | Path,
    *,
    only: Iterable[int] = (),
    formats: Sequence[str] = ("png",),
    force: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> Drawn:
    """Draw figures from a folder of trials into a folder, as figure-26.png and so on.

    What the folder has no runs for is left out, with the plan that makes them. InputError, once the others
    are drawn, if it was asked for by its number; also for unknown numbers and formats.

        >>> from benchmarks.thesis.drawn import draw_figures
        >>> draw_figures("trials", "figures", only=[26, 60]).files  # doctest: +SKIP
        (PosixPath('figures/figure-26.png'), PosixPath('figures/figure-60.png'))
    """
    wanted, folder = list(only), Path(to)
    known = {entry.number: entry for entry in FIGURES}
    for number in wanted:
        if number not in known:
            there = ", ".join(map(str, sorted(known)))
            why = "the others show what is not here, such as the robot"
            raise InputError(None, f"found figure {number}, expected one of {there}; {why}")
    for name in formats:
        if name not in FORMATS:
            raise InputError(None, f"found format {name!r}, expected one of {', '.join(FORMATS)}")
    expect_matplotlib(folder)
    expect_trials(Path(trials))
    if not folder.exists():
        check_target(folder, force=force)
        folder.mkdir(parents=True)
    chosen = tuple(wanted) or tuple(known)
    files, left = list[Path](), list[tuple[int, str]]()
    for entry in rendered(Path(trials), chosen, tuple(formats), titled=True, progress=progress):
        if entry.missing:
            left.append((entry.number, entry.missing))
            continue
        for name, data in zip(formats, entry.files, strict=True):
            file = folder / f"figure-{entry.number:02}.{name}"
            write_whole(file, data, force=force)
            files.append(file)
    if wanted and left:
        raise InputError(None, "; ".join(dict.fromkeys(why for _, why in sorted(left))))
    return Drawn(tuple(sorted(files)), tuple(sorted(left)))


def rendered(
    folder: Path,
    numbers: Sequence[int],
    formats: tuple[str, ...],
    *,
    titled: bool,
    dpi: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Iterator[RenderedFigure]:
    """Yield figures as they are done, on all cores; those that the folder has no runs for say so."""
    work = partial(_render, folder, formats, titled, dpi)
    with _at_once(work, numbers) as found:
        for done, entry in enumerate(chain.from_iterable(found)):
            if progress is not None:
                progress(done, len(numbers))
            yield entry


@contextmanager
def _at_once(work: Work, numbers: Sequence[int]) -> Iterator[Iterator[list[RenderedFigure]]]:
    workers = min(os.cpu_count() or 1, len(numbers) // FEW)
    if workers <= 1:
        yield map(work, ([number] for number in numbers))
        return
    with in_processes(work, shares(numbers, workers), workers) as found:
        yield found


def shares(numbers: Sequence[int], workers: int) -> list[list[int]]:
    """Return figures as the work of processes: those about pictures for half of them, the others one by one.

    Figures about pictures need the same drives, which every process that draws any of them has to render.
    """
    about = {entry.number for entry in OF_PICTURES}
    together = [number for number in numbers if number in about]
    parts = max(workers // 2, 1)
    shared = [together[part::parts] for part in range(parts)]
    return [share for share in shared if share] + [[number] for number in numbers if number not in about]


def _render(
    folder: Path, formats: tuple[str, ...], titled: bool, dpi: int | None, numbers: Sequence[int]
) -> list[RenderedFigure]:
    return [_render_one(folder, formats, titled, dpi, number) for number in numbers]


def rows_changed(folder: Path) -> float:
    """Return when the newest rows of a folder were written; 0 where there are none."""
    return max((file.stat().st_mtime for file in (folder / ROWS).glob("*.parquet")), default=0.0)


def _render_one(
    folder: Path, formats: tuple[str, ...], titled: bool, dpi: int | None, number: int
) -> RenderedFigure:
    figure = next(figure for figure in FIGURES if figure.number == number)
    try:
        drawing = figure.draw(_material(folder, rows_changed(folder)))
        _expect_values(drawing, folder)
        if titled:
            _entitle(drawing, f"{number}. {figure.title}")
        return RenderedFigure(number, tuple(figure_bytes(drawing, kind, dpi) for kind in formats))
    except MissingRuns as problem:
        return RenderedFigure(number, missing=str(problem))
    except Exception as problem:  # of few runs a fit or a scale may not exist, and the others go on
        why = f"cannot be drawn from these runs ({type(problem).__name__}: {problem})"
        return RenderedFigure(number, missing=f"{folder}: {why}")


def _expect_values(drawing: Figure, folder: Path) -> None:
    """Refuse a figure without any value, which matplotlib can put on no scale; mark empty axes of others."""
    shown = [axes for axes in drawing.axes if axes.axison]
    empty = [axes for axes in shown if axes.has_data() and not np.isfinite(axes.dataLim.extents).all()]
    if shown and len(empty) == len(shown):
        raise MissingRuns(folder, NO_VALUE)
    for axes in empty:
        axes.clear()
        axes.set_axis_off()
        axes.text(0.5, 0.5, NO_VALUE, ha="center", va="center", transform=axes.transAxes)


@lru_cache(1)
def _material(folder: Path, changed: float) -> Material:
    """Keep a process's drives from one figure to the next, unless rows were added."""
    return Material(folder)


def _entitle(made: Figure, title: str) -> None:
    """Write the title over the only axes of a figure, or over all of them."""
    if len(made.axes) == 1:
        made.axes[0].set_title(title, loc="left", fontsize=12, color=INK)
    else:
        made.suptitle(title, x=0.01, ha="left", fontsize=12, color=INK)
