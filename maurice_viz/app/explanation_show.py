"""Where the full panel of an explanation goes: a viewer, a recording, a picture."""

from __future__ import annotations

import shlex
import shutil
import tempfile
from pathlib import Path

import rerun.blueprint as rrb

from maurice_loaders.errors import InputError
from maurice_loaders.io.files import expect_absent, write_whole

from ..cli.console import note
from ..cli.options import OutputOptions
from ..entities import STEP, RunPaths
from ..errors import SinkError
from ..layouts.explanation_screen import full
from ..panels.explanation_screen import ExplainedUpdate, draw_explanation
from ..scene import SceneInfo
from ..viewer import sinks
from ..viewer.snapshot import expect_driver, headless_viewer
from ..viewer.spawn import viewer_binary

SIZE = (1600, 1000)


def check_picture(picture: Path, *, force: bool) -> None:
    """Raise InputError before any work where a picture cannot be written or cannot be drawn here."""
    if picture.suffix != ".png":
        raise InputError(picture, f"a picture's name ends in .png; use {picture.name}.png")
    expect_absent(picture, force=force)
    expect_driver(picture)


def show(update: ExplainedUpdate, label: str, output: OutputOptions, picture: Path | None) -> None:
    """Draw the panel where it was asked for; a picture alone opens no viewer and leaves no recording.

    SinkError and InputError when something cannot be written, or no picture can be drawn.
    """
    library, step = update.library, update.step
    paths, name = RunPaths(label), f"{library.name}, {label}: step {step.step}"
    layout = full(paths, step, SceneInfo(library.arena, update.scale, update.has_truth))
    if picture is not None:
        with tempfile.TemporaryDirectory(prefix="maurice-explain-") as place:
            file = Path(place) / "explain.rrd"
            _write(file, name, layout, paths, update, force=False)
            with headless_viewer(file, SIZE) as viewer:
                write_whole(picture, viewer.picture(STEP, step.step), force=output.force)
        note(f"{picture} written")
    if output.no_recording or (picture is not None and output.save is None):
        return
    if (
        output.save is None
        and not output.headless
        and sinks.has_display()
        and _opened(name, layout, paths, update)
    ):
        return
    path = output.save or Path(f"{output.stem}-step-{step.step}.rrd")
    _write(path, name, layout, paths, update, force=output.force)
    program = "rerun" if shutil.which("rerun") else str(viewer_binary())
    note(f"{path} written; open it with: {shlex.quote(program)} {shlex.quote(str(path))}")


def _write(
    path: Path, name: str, layout: rrb.Blueprint, paths: RunPaths, update: ExplainedUpdate, *, force: bool
) -> None:
    with sinks.to_file(path, name, layout, force=force) as rec:
        draw_explanation(rec, paths, update)


def _opened(name: str, layout: rrb.Blueprint, paths: RunPaths, update: ExplainedUpdate) -> bool:
    """Show it in a viewer of its own; tell whether one came up."""
    try:
        port = sinks.bring_up_viewer()
    except SinkError as problem:
        note(f"{problem}; writing a file instead")
        return False
    with sinks.to_viewer(port, name, layout) as rec:
        draw_explanation(rec, paths, update)
    return True
