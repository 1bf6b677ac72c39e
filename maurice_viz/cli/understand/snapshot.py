"""`maurice-replay snapshot RUN -o OUT.png`: what the viewer shows, as a picture or a movie."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated

import typer

from ...entities import Phase
from ..console import listening, results
from ..errors import one_line_errors
from ..options import ForceOption, LayoutOption

PHASES = " | ".join(phase.name.lower() for phase in Phase)
PICTURE, MOVIE = "Picture", "Movie"

SourceArgument = Annotated[
    Path,
    typer.Argument(
        metavar="RUN|FILE.rrd", show_default=False, help="A saved run's folder, or a Rerun recording."
    ),
]
PictureOption = Annotated[
    Path | None,
    typer.Option("-o", "--output", metavar="OUT.png", help="The picture to write.", rich_help_panel=PICTURE),
]
StepOption = Annotated[
    int | None,
    typer.Option("--step", min=1, help="Which step. [default: the last]", rich_help_panel=PICTURE),
]
PhaseOption = Annotated[
    str | None, typer.Option("--phase", help=f"One phase of it: {PHASES}.", rich_help_panel=PICTURE)
]
MovieOption = Annotated[
    Path | None,
    typer.Option(
        "--movie",
        metavar="OUT.mp4|OUT.gif",
        help="Write a movie of a range of steps instead.",
        rich_help_panel=MOVIE,
    ),
]
FromOption = Annotated[
    int | None,
    typer.Option("--from", min=1, help="Its first step. [default: the first]", rich_help_panel=MOVIE),
]
ToOption = Annotated[
    int | None,
    typer.Option("--to", min=1, help="Its last step. [default: the last]", rich_help_panel=MOVIE),
]
FpsOption = Annotated[
    float, typer.Option("--fps", min=0.1, max=50, help="Its pictures per second.", rich_help_panel=MOVIE)
]
PhasesOption = Annotated[
    bool,
    typer.Option(
        "--phases", help="Six pictures per step, one per phase, instead of one.", rich_help_panel=MOVIE
    ),
]
ViewOption = Annotated[
    str | None, typer.Option("--view", help="Only this view, by its title or the beginning of its title.")
]
SizeOption = Annotated[str, typer.Option("--size", metavar="WxH", help="Size of the window in pixels.")]


def snapshot(
    source: SourceArgument,
    output: PictureOption = None,
    step: StepOption = None,
    phase: PhaseOption = None,
    movie: MovieOption = None,
    first: FromOption = None,
    last: ToOption = None,
    fps: FpsOption = 4.0,
    phases: PhasesOption = False,
    view: ViewOption = None,
    layout: LayoutOption = None,
    size: SizeOption = "1600x1000",
    force: ForceOption = False,
) -> None:
    """Take a picture or a movie of what the viewer shows of a saved run or a recording, without a screen."""
    if output is not None and (first is not None or last is not None or phases):
        raise typer.BadParameter("--from, --to and --phases go with --movie")
    if movie is not None and (step is not None or phase is not None):
        raise typer.BadParameter("--step and --phase go with -o; a movie has --from, --to and --phases")
    window = window_size(size)
    from ...app.snapshot import movie as film
    from ...app.snapshot import snapshot as take

    with one_line_errors(), listening() as listener:
        if output is not None and movie is None:
            made = take(
                source,
                to=output,
                step=step,
                phase=phase,
                view=view,
                layout=layout,
                size=window,
                force=force,
                listener=listener,
            )
        elif movie is not None and output is None:
            made = film(
                source,
                to=movie,
                first=first,
                last=last,
                phases=phases,
                fps=fps,
                view=view,
                layout=layout,
                size=window,
                force=force,
                listener=listener,
            )
        else:
            raise typer.BadParameter("give either -o OUT.png or --movie OUT.mp4")
    results.print(str(made), soft_wrap=True)


def window_size(text: str) -> tuple[int, int]:
    """Read a size like "1600x1000"; the function checks its limits. A usage error for anything else."""
    found = re.fullmatch(r"(\d{1,5})[xX](\d{1,5})", text)
    if found is None:
        raise typer.BadParameter(f"--size is like 1600x1000, found {text!r}")
    return int(found[1]), int(found[2])
