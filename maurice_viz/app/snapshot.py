"""Pictures and movies of the real viewer, of a saved run or a recording, without a screen."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from maurice_loaders.errors import InputError
from maurice_loaders.files.paths import look_again
from maurice_loaders.files.writing import expect_absent, temporary_folder, write_whole
from maurice_loaders.runs.store import open_runs
from maurice_mcl.values import expected_one_of

from ..entities import PHASE, PHASE_NAMES, PHASES_PER_STEP, SEEN, STEP, Phase, Place
from ..errors import SILENT, Listener, OptionError
from ..layouts import INSIDE
from ..running.observer import SceneObserver
from ..running.output import layout_of
from ..running.run import collector_of, step_through
from ..running.saved import open_saved, playback_of
from ..viewer import sinks
from ..viewer.movie import MOST_IN_GIF, film, from_png
from ..viewer.movie import SUFFIXES as MOVIES
from ..viewer.snapshot import Viewer, expect_driver, expect_whole_frames, headless_viewer, recorded_steps

SMALLEST_PX, LARGEST_PX = 200, 8000
SIZE = (1600, 1000)
EQUAL_PICTURES = 2  # equal pictures that a frame waits for: its step number stands in it, so that it moved on


def snapshot(
    source: str | Path,
    *,
    to: str | Path,
    step: int | None = None,
    phase: str | None = None,
    view: str | None = None,
    layout: str | None = None,
    label: str | None = None,
    size: tuple[int, int] = SIZE,
    force: bool = False,
    listener: Listener = SILENT,
) -> Path:
    """Write a picture (.png) of the viewer at one step of a saved run or a recording, and return its path.

    `step` is the last one by default, `phase` one of PHASE_NAMES within it. `layout` and `view` are names as
    the viewer shows them: a tab, and the one view to fill the window of `size` (width, height) pixels.
    `label` is that of the run whose tab is open in that layout. With a phase and without either the layout is
    inside-a-step, where the recording has that.

    Raises OptionError for arguments out of range and InputError if the step, view or layout does not
    exist, the file exists (unless `force`), or no Vulkan driver is installed.

        >>> import maurice_viz as mv
        >>> mv.snapshot("my-run", to="step-4.png", step=4).name  # doctest: +SKIP
        'step-4.png'
    """
    target = _checked(Path(to), (".png",), size, force=force)
    if phase is not None and phase not in PHASE_NAMES:
        raise OptionError(f"no phase called {phase!r}; {expected_one_of(phase, PHASE_NAMES)}")
    _check_saved_steps(Path(source), step)
    with _viewer_on(Path(source), (layout, label), view, size, listener, inside=phase is not None) as viewer:
        last = _span(viewer, Path(source), step, step)[-1]
        place = Place(last, None if phase is None else Phase[phase.upper()])
        png = viewer.picture(place.timeline, place.number)
        write_whole(target, png, force=force)
    return target


def movie(
    source: str | Path,
    *,
    to: str | Path,
    first: int | None = None,
    last: int | None = None,
    phases: bool = False,
    fps: float = 4.0,
    view: str | None = None,
    layout: str | None = None,
    label: str | None = None,
    size: tuple[int, int] = SIZE,
    force: bool = False,
    listener: Listener = SILENT,
) -> Path:
    """Write a movie (.mp4 or .gif) of a range of steps and return its path.

    One picture per step from `first` to `last`, or with `phases` six per step; `fps` pictures per second. The
    other arguments are those of `snapshot`. A movie that was interrupted is not written. Raises OptionError
    and InputError as `snapshot` does.

        >>> import maurice_viz as mv
        >>> mv.movie("my-run", to="turn.gif", first=3, last=5).name  # doctest: +SKIP
        'turn.gif'
    """
    target = _checked(Path(to), MOVIES, size, force=force)
    if first is not None and last is not None and first > last:
        raise OptionError(f"--from {first} is after --to {last}")
    _check_saved_steps(Path(source), first, last)
    with _viewer_on(Path(source), (layout, label), view, size, listener, inside=phases) as viewer:
        steps = _span(viewer, Path(source), first, last)
        timeline, values = STEP, steps
        if phases:
            timeline = PHASE
            values = range(PHASES_PER_STEP * steps.start, PHASES_PER_STEP * steps.stop)
        if target.suffix == ".gif" and len(values) > MOST_IN_GIF:
            count = f"found {len(values)} pictures for {target}, expected at most {MOST_IN_GIF} in a GIF"
            raise OptionError(f"{count}; write an .mp4, or fewer steps")
        try:
            with film(target, fps, force=force) as frames:
                for number, value in enumerate(values, start=1):
                    frames.add(from_png(viewer.picture(timeline, value, EQUAL_PICTURES)))
                    listener.progress(number, len(values), "movie")
        except KeyboardInterrupt:
            listener.warning(f"stopped; {target} was not written")
            raise
    return target


def draw_saved(folder: Path, recording: Path, layout: str | None = None, listener: Listener = SILENT) -> None:
    """Draw a saved run, or those of a comparison, into a new recording; `layout` names the tab that is open.

    Raises InputError for a folder that holds no saved run.
    """
    playback = playback_of(open_saved(folder, listener))
    runs, scene = playback.views, playback.scene
    with sinks.to_file(recording, scene.info.name, layout_of(runs, scene, layout), force=True) as rec:
        step_through(playback, SceneObserver(rec, runs, scene), {}, collector_of(playback), listener)


def _checked(target: Path, suffixes: tuple[str, ...], size: tuple[int, int], *, force: bool) -> Path:
    if target.suffix not in suffixes:
        raise OptionError(f"{target.name!r} should end in {' or '.join(suffixes)}")
    if not all(SMALLEST_PX <= side <= LARGEST_PX for side in size):
        limits = f"each from {SMALLEST_PX} to {LARGEST_PX}"
        raise OptionError(f"--size is like 1600x1000, {limits}, found {size[0]}x{size[1]}")
    expect_absent(target, force=force)
    return target


def _check_saved_steps(source: Path, *steps: int | None) -> None:
    """Refuse steps that a saved run or a recording does not have before it is drawn, which takes long.

    Raises InputError. A recording that cannot be read to its end is left to the viewer, which can.
    """
    numbers = [step for step in steps if step is not None]
    if not numbers:
        return
    if source.suffix == ".rrd":
        span = _recorded_span(source, numbers)
    else:
        manifests = [run.manifest for run in open_runs(source)]
        counts = [manifest.pictures if manifest.steps is None else manifest.steps for manifest in manifests]
        span = (1, max(counts))
    if span is not None:
        for step in numbers:
            _check_step(source, step, *span)


def _recorded_span(source: Path, asked: Sequence[int]) -> tuple[int, int] | None:
    """Return the first and last step of a recording, or any span within that holds all steps asked for."""
    _expect_recording(source)
    first, last = min(asked), max(asked)  # a part of the recording is quick to read and mostly tells enough
    quick = recorded_steps(source, SEEN)
    return quick if quick and quick[0] <= first and last <= quick[1] else recorded_steps(source)


def _expect_recording(source: Path) -> None:
    if not source.is_file():
        advice = look_again(source, "replay a session with -o FILE.rrd to make one")
        raise InputError(source, f"found no such recording; {advice}")
    expect_whole_frames(source)


def _check_step(source: Path, step: int, start: int, end: int) -> None:
    if not start <= step <= end:
        raise InputError(source, f"found no step {step}, expected one from {start} to {end}")


def _span(viewer: Viewer, source: Path, first: int | None, last: int | None) -> range:
    """Return the steps meant, None for the recording's own ends. InputError for steps outside them."""
    start, end = viewer.span(STEP)
    first, last = start if first is None else first, end if last is None else last
    for step in (first, last):
        _check_step(source, step, start, end)
    return range(first, last + 1)


@contextmanager
def _viewer_on(
    source: Path,
    tab: tuple[str | None, str | None],
    view: str | None,
    size: tuple[int, int],
    listener: Listener,
    *,
    inside: bool,
) -> Iterator[Viewer]:
    """Open a headless viewer on a recording or a saved run, arranged as asked for; `inside` a step or not."""
    expect_driver(source)  # before a long run is drawn in vain
    with _recording_of(source, listener) as recording, headless_viewer(recording, size) as viewer:
        layout, label = tab
        if layout is not None:
            viewer.show_layout(layout, label)
        elif inside and view is None:
            with suppress(InputError):  # with little detail, and of recorded localizers, there is none
                viewer.show_layout(INSIDE, label)
        if view is not None:
            viewer.show_only(view)
        yield viewer


@contextmanager
def _recording_of(source: Path, listener: Listener) -> Iterator[Path]:
    """Yield the recording itself, or a temporary one that a saved run is drawn into."""
    if source.suffix == ".rrd":
        _expect_recording(source)
        yield source
        return
    with temporary_folder("maurice-snapshot") as folder:
        recording = folder / "run.rrd"
        draw_saved(source, recording, listener=listener)
        yield recording
