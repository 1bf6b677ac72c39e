"""Where the drawing of runs goes: a viewer where there is a display, else a file."""

from __future__ import annotations

import shlex
import shutil
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path

import rerun as rr
import rerun.blueprint as rrb

from maurice_mcl.library import Library
from maurice_mcl.session import SessionInfo

from ..cli.console import note
from ..cli.options import OutputOptions
from ..drawing.contact_sheet import cell_height
from ..errors import SinkError
from ..layouts.registry import runs_blueprint
from ..panels.detail import Detail
from ..panels.observer import Observer, RerunObserver
from ..scene import RunView, SceneInfo
from ..style import scale_for

# Runs drawn into a recording that somebody else opened: their layout, and an observer a run.


def layout_of(runs: Sequence[RunView], scene: Scene, first: str | None = None) -> rrb.Blueprint:
    """Give the layout of runs; `first` names the tab that is open."""
    arena = scene.library.arena
    scale, height = scale_for(scene.info.display_units, arena), cell_height(scene.library.pictures)
    shown = SceneInfo(arena, scale, scene.has_truth, scene.has_pictures, height)
    return runs_blueprint(runs, shown, first, live=scene.live)


@contextmanager
def observed(
    rec: rr.RecordingStream, runs: Sequence[RunView], scene: Scene, detail: Detail = Detail.FULL
) -> Iterator[dict[str, Observer]]:
    """Begin one observer a run, the first of which draws what they share; end them, also after a failure."""
    observers: dict[str, Observer] = {}
    for run in runs:
        observers[run.label] = RerunObserver(
            rec,
            run.label,
            {} if run.sensor is None else run.sensor.distances,
            scene=not observers,
            has_truth=scene.has_truth,
            detail=detail,
            sensor=run.sensor,
            updates=scene.updates,
            bookmarks=run.bookmarks,
        )
    for observer in observers.values():
        observer.begin(scene.info, scene.library)
    try:
        yield observers
    finally:
        for observer in observers.values():
            observer.end()


# Where the drawing of runs goes: a viewer where there is a display, else a file.

NEXT_KEYS = "Keys in the viewer: Ctrl or Cmd + arrow goes to the next data"
KEYS = f"{NEXT_KEYS}; choose the timeline `phase` to walk through one update."

LARGE = 50_000_000  # bytes of a recording that one is told about beforehand


@dataclass(frozen=True, slots=True)
class Scene:
    """What is known of a drawing before its first step."""

    info: SessionInfo
    library: Library
    has_truth: bool
    updates: int = 0  # how many there will be; 0 when that is not known
    has_pictures: bool = True
    live: bool = False  # the drive is going on: viewers may come and go, and nobody is waited for


@contextmanager
def recording(runs: Sequence[RunView], scene: Scene, output: OutputOptions) -> Iterator[dict[str, Observer]]:
    """Open where the drawing goes, and one observer a run; none when no recording is wanted."""
    if output.no_recording:
        yield {}
        return
    from ..panels.detail import Detail

    with (
        _sink(runs, scene, output) as rec,
        observed(rec, runs, scene, Detail(output.detail)) as observers,
    ):
        yield observers


@contextmanager
def _sink(runs: Sequence[RunView], scene: Scene, output: OutputOptions) -> Iterator[rr.RecordingStream]:

    info, layout = scene.info, layout_of(runs, scene, output.layout)
    if scene.live:
        path = _path(output)
        with _live(path, info.name, layout, output) as rec:
            yield rec
        _say_written(path)
        return
    with opened(output, info.name, layout, lambda path: _say_size(runs, scene, output, path)) as rec:
        yield rec


@contextmanager
def opened(
    output: OutputOptions,
    name: str,
    layout: rrb.Blueprint,
    beforehand: Callable[[Path], None] = lambda path: None,
    keys: str = KEYS,
) -> Iterator[rr.RecordingStream]:
    """Open a viewer where there is a display, else a file, of which something is said `beforehand`.

    At the end which `keys` to press in the viewer.
    """
    from ..viewer import sinks

    if output.save is None and not output.headless and sinks.has_display():
        try:
            port = sinks.bring_up_viewer()
        except SinkError as problem:
            note(f"{problem}; writing a file instead")
        else:
            with sinks.to_viewer(port, name, layout) as rec:
                yield rec
            note(keys)
            return
    path = _path(output)
    beforehand(path)
    with sinks.to_file(path, name, layout, force=output.force) as rec:
        yield rec
    _say_written(path, keys)


def _path(output: OutputOptions) -> Path:
    return output.save or Path(f"{output.stem}.rrd")


def _live(
    path: Path, name: str, layout: rrb.Blueprint, output: OutputOptions
) -> AbstractContextManager[rr.RecordingStream]:
    from ..viewer import sinks
    from ..viewer import sinks as live_sink

    window = output.save is None and not output.headless and sinks.has_display()
    return live_sink.to_file_and_viewers(
        path, name, layout, force=output.force, window=window, viewer=_viewer_command()
    )


def _say_written(path: Path, keys: str = KEYS) -> None:
    note(f"{path} written; open it with: {_viewer_command()} {shlex.quote(str(path))}")
    note(keys)


def _say_size(runs: Sequence[RunView], scene: Scene, output: OutputOptions, path: Path) -> None:
    """Say about how large the file will be, where that is known and it is large."""
    from ..panels.detail import Detail, expected_bytes

    detail = Detail(output.detail)
    parts = [expected_bytes(detail, scene.updates, run.particles, len(run.channels)) for run in runs]
    if (total := sum(parts)) >= LARGE:
        smaller = "" if detail is Detail.LIGHT else "; --detail events or light makes it smaller"
        note(f"{path} will be about {total / 1e6:.0f} MB{smaller}")


def _viewer_command() -> str:
    """Name the viewer as this shell can find it: by its word, or beside our own Python."""
    if shutil.which("rerun"):
        return "rerun"
    beside = Path(sys.executable).parent / "rerun"
    return str(beside.relative_to(Path.cwd())) if beside.is_relative_to(Path.cwd()) else str(beside)
