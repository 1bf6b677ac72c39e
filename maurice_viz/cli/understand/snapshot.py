"""`maurice-replay snapshot RUN -o OUT.png`: what the viewer shows, in a picture or movie."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from maurice_loaders.errors import InputError
from maurice_loaders.io.files import expect_absent, write_whole

from ...entities import PHASE, PHASES_PER_STEP, STEP, Phase, phase_number
from ..console import note, notes, progress, results
from ..errors import one_line_errors
from ..options import ForceOption, LayoutOption, OutputOptions

if TYPE_CHECKING:
    from ...viewer.snapshot import Viewer

PHASES = [slot.name.lower() for slot in Phase]
SMALLEST_PX, LARGEST_PX = 200, 8000
MOVIE_SUFFIXES = (".mp4", ".gif")
ALIKE_IN_MOVIE = 2  # equal pictures that a frame waits for: its step number stands in it, so that it moved on

SourceArgument = Annotated[
    Path,
    typer.Argument(metavar="RUN|FILE.rrd", show_default=False, help="A saved run's folder, or a recording."),
]
PictureOption = Annotated[
    Path | None, typer.Option("-o", "--output", metavar="OUT.png", help="The picture to write.")
]
MovieOption = Annotated[
    Path | None,
    typer.Option("--movie", metavar="OUT.mp4|OUT.gif", help="Write a movie of a range of steps instead."),
]
StepOption = Annotated[
    int | None, typer.Option("--step", min=1, help="Which step. [default: the last]", show_default=False)
]
PhaseOption = Annotated[
    str | None, typer.Option("--phase", help=f"One phase of it: {' | '.join(PHASES)}.", show_default=False)
]
ViewOption = Annotated[
    str | None,
    typer.Option("--view", help="Only this view, by its title or how that begins.", show_default=False),
]
SizeOption = Annotated[str, typer.Option("--size", metavar="WxH", help="Size of the window in pixels.")]
FromOption = Annotated[
    int | None, typer.Option("--from", min=1, help="First step of a movie. [default: the first]")
]
ToOption = Annotated[int | None, typer.Option("--to", min=1, help="Its last step. [default: the last]")]
FpsOption = Annotated[float, typer.Option("--fps", min=0.1, max=50, help="Pictures a second of a movie.")]
PhasesOption = Annotated[
    bool, typer.Option("--phases", help="A movie with a picture a phase, six a step, instead of one a step.")
]


@dataclass(frozen=True, slots=True)
class Look:
    """What of a recording is looked at, and how large."""

    layout: str | None
    view: str | None
    size: tuple[int, int]


@dataclass(frozen=True, slots=True)
class Places:
    """The steps or phases that a picture or a movie is taken at; None: the recording's own ends."""

    first: int | None
    last: int | None
    phases: bool  # one picture a phase

    def on(self, viewer: Viewer, source: Path) -> tuple[str, range]:
        """Give the timeline and its values. InputError for steps that the recording does not have."""
        start, end = viewer.span(STEP)
        first = start if self.first is None else self.first
        last = end if self.last is None else self.last
        for step in (first, last):
            if not start <= step <= end:
                raise InputError(source, f"found no step {step}, expected one from {start} to {end}")
        if not self.phases:
            return STEP, range(first, last + 1)
        return PHASE, range(PHASES_PER_STEP * first, PHASES_PER_STEP * (last + 1))


def snapshot(
    source: SourceArgument,
    output: PictureOption = None,
    movie: MovieOption = None,
    step: StepOption = None,
    phase: PhaseOption = None,
    view: ViewOption = None,
    layout: LayoutOption = None,
    size: SizeOption = "1600x1000",
    first: FromOption = None,
    last: ToOption = None,
    fps: FpsOption = 4.0,
    phases: PhasesOption = False,
    force: ForceOption = False,
) -> None:
    """Take a picture or a movie of what the viewer shows of a saved run or a recording, without a screen."""
    if (output is None) == (movie is None):
        raise typer.BadParameter("give either -o OUT.png or --movie OUT.mp4")
    if phase is not None and phase not in PHASES:
        raise typer.BadParameter(f"no phase called {phase!r}; there are {', '.join(PHASES)}")
    look = Look(layout, view, window_size(size))
    if output is not None:
        if first is not None or last is not None or phases:
            raise typer.BadParameter("--from, --to and --phases go with --movie")
        _check_suffix(output, (".png",))
        with one_line_errors():
            _take_picture(source, output, step, phase, look, force)
        return
    if movie is None:
        return
    if step is not None or phase is not None:
        raise typer.BadParameter("--step and --phase go with -o; a movie has --from, --to and --phases")
    if first is not None and last is not None and first > last:
        raise typer.BadParameter(f"--from {first} is after --to {last}")
    _check_suffix(movie, MOVIE_SUFFIXES)
    with one_line_errors():
        _take_movie(source, movie, Places(first, last, phases), fps, look, force)


def window_size(text: str) -> tuple[int, int]:
    """Read a size like "1600x1000". A usage error for anything else."""
    found = re.fullmatch(r"(\d{1,5})[xX](\d{1,5})", text)
    size = (int(found[1]), int(found[2])) if found else (0, 0)
    if not all(SMALLEST_PX <= side <= LARGEST_PX for side in size):
        limits = f"each from {SMALLEST_PX} to {LARGEST_PX}"
        raise typer.BadParameter(f"--size is like 1600x1000, {limits}, found {text!r}")
    return size


def _check_suffix(path: Path, suffixes: tuple[str, ...]) -> None:
    if path.suffix not in suffixes:
        raise typer.BadParameter(f"{path.name!r} should end in {' or '.join(suffixes)}")


def _take_picture(
    source: Path, output: Path, step: int | None, phase: str | None, look: Look, force: bool
) -> None:
    expect_absent(output, force=force)
    with _viewer_on(source, look) as viewer:
        _, steps = Places(step, step, phases=False).on(viewer, source)
        if phase is None:
            png = viewer.picture(STEP, steps[-1])
        else:
            png = viewer.picture(PHASE, phase_number(steps[-1], Phase[phase.upper()]))
        write_whole(output, png, force=force)
    results.print(str(output), soft_wrap=True)


def _take_movie(source: Path, movie: Path, places: Places, fps: float, look: Look, force: bool) -> None:
    from ...viewer.movie import film, from_png

    expect_absent(movie, force=force)
    with _viewer_on(source, look) as viewer:
        timeline, values = places.on(viewer, source)
        try:
            with film(movie, fps, force=force) as frames, progress("movie") as advance:
                for done, value in enumerate(values, start=1):
                    frames.add(from_png(viewer.picture(timeline, value, ALIKE_IN_MOVIE)))
                    advance(done, len(values))
        except KeyboardInterrupt:
            note(f"stopped; {movie} was not written")
            raise
    results.print(str(movie), soft_wrap=True)


@contextmanager
def _viewer_on(source: Path, look: Look) -> Iterator[Viewer]:
    """Open what is looked at in a headless viewer, arranged as asked for."""
    from ...viewer.snapshot import expect_driver, headless_viewer

    expect_driver(source)  # before a long run is drawn in vain
    with _recording_of(source) as recording, headless_viewer(recording, look.size) as viewer:
        if look.layout is not None:
            viewer.show_layout(look.layout)
        if look.view is not None:
            viewer.show_only(look.view)
        yield viewer


@contextmanager
def _recording_of(source: Path) -> Iterator[Path]:
    """Give the recording itself, or one that a saved run is drawn into for the while."""
    if source.suffix == ".rrd":
        if not source.is_file():
            raise InputError(source, "found no such recording; replay a session with --save to make one")
        yield source
        return
    with tempfile.TemporaryDirectory(prefix="maurice-snapshot-") as folder:
        recording = Path(folder) / "run.rrd"
        draw_saved(source, recording)
        yield recording


def draw_saved(folder: Path, recording: Path, layout: str | None = None) -> None:
    """Draw a saved run, or those of a comparison, into a new recording. InputError for anything else."""
    from ...app.output import recording as drawing
    from ...app.run import collector_of, step_through
    from ...app.saved import open_saved, playback_of

    playing = playback_of(open_saved(folder))
    output = OutputOptions("run", recording, True, False, force=True, json=False, layout=layout)
    with ExitStack() as stack:
        # what the recording says at its end, where it is and how to open it, is not for a temporary one
        stack.callback(setattr, notes, "quiet", notes.quiet)
        observers = stack.enter_context(drawing(playing.drawn, playing.scene, output))
        stack.callback(setattr, notes, "quiet", True)
        step_through(playing, observers, {}, collector_of(playing))
