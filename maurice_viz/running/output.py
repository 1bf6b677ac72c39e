"""Where runs are drawn to: a viewer where there is a display, else a file.

Rerun and the panels take half a second to import, so functions that draw import them: a replay without a
recording does without.
"""

from __future__ import annotations

import re
import shlex
import shutil
import sys
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from maurice_loaders.errors import InputError
from maurice_loaders.files.paths import look_again
from maurice_loaders.session_log.header import drive_name

from ..entities import VERDICT, Phase, Place, open_command
from ..errors import Listener, OptionError, SinkError
from ..layouts import COMPARE, DETAILS, LAYOUT_NAMES, LIGHT_NAMES
from ..scene import Detail, RunView, Scene
from ..viewer.open_viewers import LayoutError, Window, has_display, look_at
from .filters import check_name

if TYPE_CHECKING:
    import rerun as rr
    import rerun.blueprint as rrb

    from ..viewer.web import WebViewer
    from .observer import SceneObserver


def layout_of(
    runs: Sequence[RunView],
    scene: Scene,
    first: str | None = None,
    *,
    light: bool = False,
) -> rrb.Blueprint:
    """Return the layout of runs; `first` names the tab that is open, `light` is for little detail."""
    from ..layouts.registry import runs_blueprint, tabs_of

    names = tabs_of(runs, scene)[1]
    if first is not None and first not in names:
        raise OptionError(f"--layout: found {first}, expected what these runs have: {', '.join(names)}")
    return runs_blueprint(runs, scene, first, light=light)


NEXT_KEYS_HINT = "Keys in the viewer: Ctrl or Cmd + arrow goes to the next data"
KEYS_HINT = f"{NEXT_KEYS_HINT}; choose the timeline `phase` to walk through one step."

LONGEST_STEM = 80  # characters of a recording's name
LARGE_BYTES = 50_000_000  # bytes of a recording whose size and time are remarked beforehand
SOME_MINUTES_S = 120.0


AUTO = "auto"  # in place of a recording's path: named after what it holds


@dataclass(frozen=True, slots=True)
class Output:
    """What is written and shown of runs. OptionError for names that are not known.

    `to`, `save_run` and `force` are arguments of the functions as well; a whole one says more, such as that a
    viewer may open. Without `to` and `viewer` nothing is drawn.

        >>> import maurice_viz as mv
        >>> output = mv.Output(to="out.rrd", detail="light")
        >>> mv.compare("session.log", output=output).rrd.name
        'out.rrd'
    """

    to: str | Path | None = None  # the Rerun recording (.rrd) to write; "auto": named after what it holds
    save_run: str | Path | None = None  # the folder to save every step to
    layout: str | None = None  # the one that is open at first: story, compare, overview, ...
    detail: str = DETAILS[0]  # how much of each step is drawn: full, events, light
    force: bool = False  # overwrite what is there
    viewer: bool = False  # open a viewer where there is a display and `to` is None; else as "auto"
    run: str | None = None  # whose tab is open in that layout
    place: Place | None = None  # where the viewer stands in the end; None: where its verdict says
    stem: str = "replay"  # of the recording, where `to` does not name it
    fixed_stem: bool = field(default=False, repr=False)  # the stem is the whole name, whatever is drawn
    alone: bool = field(default=True, repr=False)  # draw a drive without a library; else that is an error
    web: WebViewer | None = field(default=None, repr=False)  # show it in browsers: no window opens
    window: Window | None = field(default=None, repr=False)  # a viewer that was started ahead
    is_temporary: bool = field(default=False, repr=False)  # the recording is shown and not kept

    def __post_init__(self) -> None:
        check_name(self.layout, LAYOUT_NAMES, "layout")
        check_name(self.detail, DETAILS, "detail")
        if self.detail == Detail.LIGHT.value and self.layout not in (None, *LIGHT_NAMES):
            names = " and ".join(LIGHT_NAMES)
            raise OptionError(f"--detail light has the layouts {names}, found {self.layout!r}")

    @property
    def draws(self) -> bool:
        """Whether anything is drawn."""
        return self.to is not None or self.viewer or self.web is not None

    @property
    def file(self) -> Path:
        """The Rerun recording that is written, where no viewer shows it."""
        return Path(f"{self.stem}.rrd") if self.to in (None, AUTO) else Path(str(self.to))

    @property
    def folder(self) -> Path | None:
        """Where the run is saved."""
        return None if self.save_run is None else Path(self.save_run)

    @property
    def opens_window(self) -> bool:
        """Whether a viewer opens on this display."""
        return self.viewer and self.to is None and self.web is None and has_display()

    def named(self, words: Iterable[str]) -> Output:
        """Name the recording after its stem and what it holds, so that another one does not replace it."""
        if self.fixed_stem:
            return self
        parts = (self.stem, *(re.sub(r"[^\w.+]+", "-", word).strip("-.") for word in words))
        return replace(self, stem="-".join(parts)[:LONGEST_STEM])


def output_of(
    source: object,
    output: Output | None,
    to: str | Path | None = None,
    save_run: str | Path | None = None,
    *,
    force: bool = False,
) -> Output:
    """Return `output`, or what the other arguments ask for. OptionError for both."""
    if output is None:
        stem = drive_name(Path(source)) if isinstance(source, (str, Path)) else "replay"
        return Output(to, save_run, force=force, stem=stem)
    if (to, save_run, force) != (None, None, False):
        raise OptionError("`output` says all that `to`, `save_run` and `force` do; give one")
    return output


def by_suffix(files: Iterable[str | Path] | None, suffixes: Sequence[str]) -> dict[str, Path]:
    """Return the files of a repeated -o by their endings. OptionError for others, and for two alike."""
    outputs: dict[str, Path] = {}
    for file in map(Path, files or ()):
        if file.suffix not in suffixes:
            endings = " or ".join(suffix or "nothing (a folder)" for suffix in suffixes)
            raise OptionError(f"-o ends in {endings}, found {str(file)!r}")
        if file.suffix in outputs:
            raise OptionError(f"-o gives two files that end in {file.suffix}; give one")
        outputs[file.suffix] = file
    return outputs


@contextmanager
def window_ahead(output: Output) -> Iterator[Output]:
    """Start the viewer that the block will draw to: it comes up meanwhile. It is closed after an error."""
    window = None
    if output.opens_window:
        with suppress(SinkError):  # it is tried again, and told, when there is something to draw
            window = Window()
    try:
        yield replace(output, window=window)
    except BaseException:
        if window is not None and not window.is_shown:
            window.close()
        raise


@dataclass(slots=True)
class Drawn:
    """What is drawn, and what is known of it only in the end."""

    observer: SceneObserver | None = None  # None: nothing is drawn
    step: int | None = None  # to look at; set before the end, it moves a viewer there
    file: Path | None = None  # the recording, once it is written


@contextmanager
def drawing(runs: Sequence[RunView], scene: Scene, output: Output, listener: Listener) -> Iterator[Drawn]:
    """Open what is drawn to, and begin to draw there; nothing when no recording is wanted. SinkError."""
    drawn = Drawn()
    if not output.draws:
        yield drawn
        return
    from .observer import SceneObserver

    scene = replace(scene, opens=_kept(output, scene))
    detail = Detail(output.detail)
    layout = layout_of(runs, scene, output.layout, light=detail is Detail.LIGHT)
    if scene.live:
        sink = _live_sink(drawn, output, scene.info.name, layout, listener)
    else:
        remark_size = partial(_remark_size, runs, scene, detail, listener)
        sink = sink_of(drawn, output, scene.info.name, layout, listener, remark_size)
    with sink as rec:
        drawn.observer = SceneObserver(rec, runs, scene, detail)
        yield drawn
        if drawn.step is not None:  # the layout of runs that are over
            ended = drawn.observer.ended()
            rec.send_blueprint(layout_of(runs, ended, output.layout, light=detail is Detail.LIGHT))


@contextmanager
def _live_sink(
    drawn: Drawn, output: Output, name: str, layout: rrb.Blueprint, listener: Listener
) -> Iterator[rr.RecordingStream]:
    """Open a file, and a server that viewers may come to at any time."""
    from ..viewer import sinks

    path = output.file
    with sinks.to_file_and_viewers(
        path,
        name,
        layout,
        force=output.force,
        window=output.viewer and output.to is None and has_display(),
        viewer=_command("rerun"),
        web=output.web,
        remark=listener.remark,
    ) as rec:
        yield rec
    drawn.file = path
    if output.web is not None:
        output.web.close()  # what it showed came from here
    _remark_written(path, KEYS_HINT, listener, output)


@contextmanager
def sink_of(
    drawn: Drawn,
    output: Output,
    name: str,
    layout: rrb.Blueprint,
    listener: Listener,
    before_file: Callable[[Path], None] = lambda path: None,
    keys: str = KEYS_HINT,
) -> Iterator[rr.RecordingStream]:
    """Open a page for browsers if that is asked for, a viewer where there is a display, else a file.

    `before_file` is called with the path of a file that is about to be written. Remarks at the end which
    `keys` to press in the viewer.
    """
    from ..viewer import sinks

    if output.web is not None:
        shown = output.web.file()
        with sinks.to_file(shown, name, layout) as rec:
            yield rec
        _serve(output.web, shown, output.place or _place(drawn.step), listener, output)
        return
    if output.opens_window:
        try:
            port = (output.window or Window()).port()
        except SinkError as problem:
            listener.warning(f"{problem}; writing a file instead")
        else:
            with sinks.to_viewer(port, name, layout) as rec:
                yield rec
            _look_at(port, output.place or _place(drawn.step), keys, listener, output)
            return
    path = output.file
    before_file(path)
    with sinks.to_file(path, name, layout, force=output.force, remark=listener.remark) as rec:
        yield rec
    drawn.file = path
    _remark_written(path, keys, listener, output, drawn.step)


def _kept(output: Output, scene: Scene) -> str:
    """Return the recording, else the saved run, that shows again what is drawn; empty: none is kept."""
    is_file = scene.live or (output.web is None and not output.opens_window)
    if is_file and not output.is_temporary:
        return str(output.file)
    return scene.opens if output.folder is None else str(output.folder)


def _place(step: int | None) -> Place | None:
    return None if step is None else Place(step)


def _look_at(port: int, place: Place | None, keys: str, listener: Listener, output: Output) -> None:
    """Move the viewer on a port to a place; remark it, and keys to press. OptionError: it has no such tab."""
    try:
        if place is not None and look_at(port, place, output.layout, output.run):
            listener.remark(f"the viewer stands at {place}")
    except LayoutError as problem:
        raise OptionError(str(problem)) from None
    listener.remark(keys)


def _remark_written(
    path: Path, keys: str, listener: Listener, output: Output, step: int | None = None
) -> None:
    command = _command("maurice-replay")
    opens = f"maurice-replay {shlex.quote(str(path))}"
    if output.place is not None:
        opens = open_command(path, output.place)
        opens += "" if output.run is None else f" --run {shlex.quote(output.run)}"
    listener.remark(f"{path} written; open it with: {opens.replace('maurice-replay', command, 1)}")
    if step is None or output.place is not None:
        listener.remark(keys)
    else:
        tab = output.layout if output.layout == COMPARE else None  # else the tab of phases
        walk = open_command(path, Place(step, Phase.PREDICT), tab).replace("maurice-replay", command, 1)
        listener.remark(f"walk through step {step}, phase by phase with Ctrl or Cmd + right arrow: {walk}")


@contextmanager
def serving(output: Output, listener: Listener) -> Iterator[None]:
    """Keep on serving what was shown in a browser after the block, until Ctrl-C."""
    if output.web is None:
        yield
        return
    try:
        yield
        if output.web.is_serving:
            output.web.wait(listener.remark)
    finally:
        output.web.close()


def _serve(web: WebViewer, recording: Path, place: Place | None, listener: Listener, output: Output) -> None:
    """Serve a recording to browsers, which open it at a place; remark how."""
    web.serve(recording, place, output.layout, output.run)
    web.remark(listener.remark)
    if place is not None:
        listener.remark(f"it opens at {place}")


def show_recording(path: Path, listener: Listener, output: Output) -> None:
    """Open a Rerun recording in the viewer, where the output says or its verdict; with `web`, in browsers.

    InputError, OptionError, SinkError.
    """
    decisive = decisive_step_of(path)  # which refuses what is no recording
    web, place = output.web, output.place or _place(decisive)
    if web is not None:
        _serve(web, path, place, listener, output)
        return
    if not has_display():
        how = "found no display to open it on; add --web for a browser, or copy it to where there is one"
        raise SinkError(path, how)
    _look_at(Window([str(path)]).port(), place, KEYS_HINT, listener, output)


def decisive_step_of(path: Path) -> int | None:
    """Return the step that a recording's verdict names; None where it has none. InputError if unreadable."""
    steps = _of_verdict(path, "decisive_step")
    return int(steps[0]) if steps else None


def verdict_of(path: Path) -> str:
    """Return the verdict of a recording as Markdown, empty where it has none. InputError if unreadable."""
    texts = _of_verdict(path, "TextDocument:text")
    return str(texts[-1]) if texts else ""


def _of_verdict(path: Path, column: str) -> list[Any]:
    """Return all values of a column that a recording's verdict has, as they were logged. InputError."""
    from rerun.chunk import RrdReader

    from ..viewer.snapshot import unreadable

    if not path.is_file():
        raise InputError(path, f"found no such file, expected a Rerun recording (.rrd); {look_again(path)}")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # that a killed recording lacks its end
            stream = RrdReader(path).stream().filter(content=VERDICT)
            batches = [chunk.to_record_batch() for chunk in stream]
    except (RuntimeError, ValueError, OSError) as problem:
        raise unreadable(path, problem) from None
    columns = [batch.column(column).to_pylist() for batch in batches if column in batch.schema.names]
    return [value for rows in columns for row in rows if row for value in row]


def _remark_size(
    runs: Sequence[RunView], scene: Scene, detail: Detail, listener: Listener, path: Path
) -> None:
    """Report how large the file will be and how long it takes, where that is known and it is large."""
    from .observer import expected_bytes, expected_seconds

    parts = [expected_bytes(detail, scene.updates, run.particles, len(run.channels)) for run in runs]
    if (total := sum(parts)) >= LARGE_BYTES:
        smaller = "" if detail is Detail.LIGHT else "; --detail events or light takes less of both"
        seconds = sum(expected_seconds(detail, scene.updates, run.particles) for run in runs)
        takes = f"{seconds / 60:.0f} minutes" if seconds >= SOME_MINUTES_S else f"{seconds:.0f} seconds"
        listener.remark(f"{path} will be about {total / 1e6:.0f} MB and take about {takes}{smaller}")


def _command(name: str) -> str:
    """Return a command as this shell can find it: by name, or beside our own Python."""
    path = Path(sys.executable).parent / name
    near = path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path
    return name if shutil.which(name) else str(near)
