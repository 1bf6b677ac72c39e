"""Every figure of the thesis that trials can make, by its number there; titles and drawings are ours."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from maurice_loaders.errors import InputError
from maurice_loaders.files import check_target

from . import clouds, constants, costs, drives, histograms_of_light, matching, traces
from . import over_particles as counts
from .calibration import INK, expect_matplotlib, save
from .material import Material, NothingToDraw, ThesisFigure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FORMATS = ("png", "svg", "pdf")


TRAVEL = "Driven before it was lost, against the number of particles"
OVER_PARTICLES = (
    ThesisFigure(26, TRAVEL, partial(counts.before_loss, log=True)),
    ThesisFigure(27, f"{TRAVEL} (linear)", partial(counts.before_loss, log=False)),
    ThesisFigure(28, "Average error against the number of particles", counts.error),
    ThesisFigure(29, "Error over distance against the number of particles", counts.error_a_distance),
    ThesisFigure(30, "Error per 1,000 in of every run", counts.error_by_run),
    ThesisFigure(37, "Global localization: final error, by what made a run fail", counts.final_error),
    ThesisFigure(
        38,
        "Global localization: distance driven until localized",
        partial(
            counts.by_feature,
            metric="localized_m",
            label="driven until localized, runs that were (in)",
            features=("color",),
        ),
    ),
    ThesisFigure(
        39, "Global localization: time to localize", partial(counts.time_to_localize, features=("color",))
    ),
    ThesisFigure(
        59,
        "Global localization: error with color and edges blended",
        partial(
            counts.by_feature,
            metric="error_m",
            label="mean error of a run (in)",
            features=("color", "blended"),
        ),
    ),
    ThesisFigure(
        60,
        "Global localization: error with color alone",
        partial(counts.by_feature, metric="error_m", label="mean error of a run (in)", features=("color",)),
    ),
    ThesisFigure(
        61,
        "Global localization: time to localize, blended",
        partial(counts.localized_median, features=("color", "blended")),
    ),
    ThesisFigure(
        62,
        "Global localization: time to localize, color alone",
        partial(counts.localized_median, features=("color",)),
    ),
)
ALL = (
    *OVER_PARTICLES,
    *constants.FIGURES,
    *histograms_of_light.FIGURES,
    *matching.FIGURES,
    *clouds.FIGURES,
    *drives.FIGURES,
    *traces.FIGURES,
    *costs.FIGURES,
)
FIGURES = tuple(sorted(ALL, key=lambda one: one.number))


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

    What the folder has no runs for is left out, with the plan that makes them. InputError if it was asked
    for by its number, and for unknown numbers and formats.

        >>> import maurice_viz as mv
        >>> mv.draw_figures("trials", "figures", only=[26, 60]).files  # doctest: +SKIP
        (PosixPath('figures/figure-26.png'), PosixPath('figures/figure-60.png'))
    """
    wanted, folder = list(only), Path(to)
    known = {one.number: one for one in FIGURES}
    for number in wanted:
        if number not in known:
            there = ", ".join(map(str, sorted(known)))
            raise InputError(None, f"found figure {number}, expected one of {there}; docs/thesis.md says why")
    for name in formats:
        if name not in FORMATS:
            raise InputError(None, f"found format {name!r}, expected one of {', '.join(FORMATS)}")
    expect_matplotlib(folder)
    if not folder.exists():
        check_target(folder, force)
        folder.mkdir(parents=True)
    material, files, left = Material(Path(trials)), list[Path](), list[tuple[int, str]]()
    chosen = [known[number] for number in wanted] or list(FIGURES)
    for done, one in enumerate(chosen):
        if progress is not None:
            progress(done, len(chosen))
        try:
            made = one.draw(material)
        except NothingToDraw as problem:
            if wanted:
                raise
            left.append((one.number, str(problem)))
            continue
        _entitle(made, f"{one.number}. {one.title}")
        for name in formats:
            file = folder / f"figure-{one.number:02}.{name}"
            save(made, file, force=force)
            files.append(file)
    return Drawn(tuple(files), tuple(left))


def _entitle(made: Figure, title: str) -> None:
    """Write the title over the only axes of a figure, or over all of them."""
    if len(made.axes) == 1:
        made.axes[0].set_title(title, loc="left", fontsize=12, color=INK)
    else:
        made.suptitle(title, x=0.01, ha="left", fontsize=12, color=INK)
