"""Explaining one update of a saved run, as text, numbers and a panel: why the filter believed what it did."""

from __future__ import annotations

import shlex
import shutil
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import rerun.blueprint as rrb

from maurice_loaders.errors import InputError
from maurice_loaders.files import expect_absent, temporary_folder, write_whole
from maurice_mcl.analysis.explanation import Asked, StepExplanation, explain_step
from maurice_mcl.arrays import F64
from maurice_mcl.records import StepRecord
from maurice_mcl.session import Moment

from ...entities import STEP, RunPaths
from ...errors import OptionError, SinkError
from ...layouts.explanation_screen import ExplainedUpdate, draw_explanation, explanation_blueprint
from ...listener import SILENT, Listener
from ...scene import SceneInfo
from ...style import scale_for
from ...text.explanation import say_step
from ...text.explanation_table import to_json
from ...viewer import sinks
from ...viewer.open_viewers import viewer_binary
from ...viewer.snapshot import expect_driver, headless_viewer
from ...viewer.web import WebViewer
from ..convert import chosen_label
from ..open import typed_pose
from ..output import OutputOptions, serving
from ..saved import Opened, open_saved
from ..saved_steps import Restored

SIZE = (1600, 1000)


@dataclass(frozen=True, slots=True, eq=False)
class Explanation:
    """One explained update of a saved run."""

    label: str  # of the run
    step: StepExplanation  # every number, per channel and reference
    update: ExplainedUpdate  # what the panel shows

    @property
    def text(self) -> str:
        """The explanation in sentences, paragraphs separated by blank lines."""
        update = self.update
        paragraphs = say_step(self.step, update.scale) + update.of_sensors
        return "\n\n".join([f"{self.label}, step {self.step.step}", *paragraphs])

    def __str__(self) -> str:
        return self.text

    def to_json(self) -> dict[str, object]:
        """Return every number as JSON, lengths in meters and angles in radians."""
        return to_json(self.label, self.step)

    def save(self, to: str | Path, *, force: bool = False) -> Path:
        """Write the panel to a Rerun recording (.rrd) or a picture (.png) and return the path.

        Raises InputError for another ending, a file that exists (unless `force`), or where no picture can be
        drawn.
        """
        path = Path(to)
        _check_target(path, force=force)
        if path.suffix == ".rrd":
            self.record(path, force=force)
            return path
        with temporary_folder("maurice-explain") as folder:
            recording = folder / "explain.rrd"
            self.record(recording, force=False)
            with headless_viewer(recording, SIZE) as viewer:
                write_whole(path, viewer.picture(STEP, self.step.step), force=force)
        return path

    def show(self, port: int | None = None) -> None:
        """Show the panel in the viewer on a port, or in a new one. Raises SinkError if none comes up."""
        port = sinks.bring_up_viewer() if port is None else port
        with sinks.to_viewer(port, self._name, self._layout) as rec:
            draw_explanation(rec, RunPaths(self.label), self.update)

    def record(self, path: Path, *, force: bool = False) -> None:
        """Write the panel to a Rerun recording. Raises SinkError if it exists (unless `force`)."""
        with sinks.to_file(path, self._name, self._layout, force=force) as rec:
            draw_explanation(rec, RunPaths(self.label), self.update)

    @property
    def _name(self) -> str:
        return f"{self.update.library.name}, {self.label}: step {self.step.step}"

    @property
    def _layout(self) -> rrb.Blueprint:
        update = self.update
        scene = SceneInfo(update.library.arena, update.scale, update.has_truth)
        return explanation_blueprint(RunPaths(self.label), self.step, scene)


def explain(
    run: str | Path,
    step: int | None = None,
    *,
    at: F64 | str | None = None,
    entry: int | None = None,
    particle: int | None = None,
    run_label: str | None = None,
    to: str | Path | None = None,
    force: bool = False,
    listener: Listener = SILENT,
) -> Explanation:
    """Explain one update of a saved run, the last one without `step`.

    The references nearest to the truth and to the estimate are compared with the one that matches best. One
    more may be asked for: the one nearest to the pose `at`, (3,) in meters and radians or as text
    "X,Y,HEADING" in display units and degrees; the library's `entry`; or the one of a `particle`, by its
    number in the saved cloud. `run_label` chooses a run of a comparison. `to` also saves the panel as a
    recording (.rrd) or a picture (.png).

    Raises OptionError for arguments out of range and InputError for a folder that is no saved run, a step
    that it does not have, or where its session or library is gone.

        >>> import maurice_viz as mv
        >>> explanation = mv.explain("my-run", 12)
        >>> print(explanation.text.splitlines()[0])
        blended, step 12
    """
    if sum(given is not None for given in (at, entry, particle)) > 1:
        raise OptionError("--at, --entry and --particle exclude each other")
    if to is not None:
        _check_target(Path(to), force=force)
    folder = Path(run)
    opened = open_saved(folder, listener)
    labels = [one.saved.manifest.label for one in opened.restored]
    chosen = opened.restored[labels.index(chosen_label(folder, labels, run_label))]
    library = opened.scene.library
    scale = scale_for(opened.scene.info.display_units, library.arena)
    moment, record = _update(opened, chosen, folder, step)
    if chosen.sensor is None or not len(record.sighting.comparison.quality):
        raise InputError(folder, "cannot be explained without its session and library; put them back")
    if not record.sighting.comparison.channels:
        raise InputError(folder, _of_readings(record, moment, library.origin))
    if entry is not None:
        _check_number("entry", entry, library.size)
    if particle is not None:
        _check_number("particle", particle, record.weighted.size)
        at = record.weighted.world_poses[particle]
    if isinstance(at, str):
        at = typed_pose(at, scale.units, "--at is X,Y,HEADING")
    asked = None
    if at is not None or entry is not None:
        asked = Asked(entry=entry) if at is None else Asked(pose=np.asarray(at, float))
    explained = explain_step(record, chosen.sensor, moment.truth, asked, weigh=True)
    label = chosen.saved.manifest.label
    explanation = Explanation(label, explained, ExplainedUpdate(moment, record, explained, library, scale))
    if to is not None:
        explanation.save(to, force=force)
    return explanation


def _of_readings(record: StepRecord, moment: Moment, origin: F64) -> str:
    """Return why an update that compared no picture is not explained, and what its sensors say of it."""
    poses = {"estimate": record.estimate.pose}
    if moment.truth is not None:
        poses["truth"] = moment.truth
    sensed, said = record.sighting.comparison.sensed, []
    for one in sensed:
        at = np.stack(list(poses.values())) - np.append(origin, 0)
        nats = one.sensor.log_likelihood(one.reading, at.astype(np.float32), origin)
        each = ", ".join(f"{value:.2f} at the {name}" for name, value in zip(poses, nats, strict=True))
        said.append(f"{one.shown(poses).words} (nats: {each})")
    found = "; ".join(said) or "its sensors read nothing"
    where = "the tab `sensors` shows it for every step"
    why = f"step {record.frame.step} compared no picture with references, so none is explained"
    return f"{why}; {found}; {where}"


def show(explanation: Explanation, file: Path, *, force: bool = False, listener: Listener = SILENT) -> None:
    """Show the panel in a new viewer, or write it to `file` (.rrd) where there is no display.

    Raises SinkError and InputError when it cannot be written.
    """
    if sinks.has_display():
        try:
            explanation.show()
        except SinkError as problem:
            listener.warning(f"{problem}; writing a file instead")
        else:
            return
    record(explanation, file, force=force, listener=listener)


def serve(explanation: Explanation, listener: Listener = SILENT) -> None:
    """Show the panel in browsers until Ctrl-C. Raises SinkError when it cannot be served."""
    web = WebViewer()
    with serving(OutputOptions(web=web), listener):
        web.serve(listener.remark)
        explanation.show(web.data)


def record(explanation: Explanation, file: Path, *, force: bool = False, listener: Listener = SILENT) -> None:
    """Write the panel to a recording and remark how to open it. Raises SinkError."""
    explanation.record(file, force=force)
    program = "rerun" if shutil.which("rerun") else str(viewer_binary())
    listener.remark(f"{file} written; open it with: {shlex.quote(program)} {shlex.quote(str(file))}")


def check_picture(picture: Path, *, force: bool) -> None:
    """Refuse a picture that cannot be written or drawn here, before any work. Raises InputError."""
    if picture.suffix != ".png":
        raise InputError(picture, f"a picture's name ends in .png; use {picture.name}.png")
    expect_absent(picture, force=force)
    expect_driver(picture)


def _check_target(path: Path, *, force: bool) -> None:
    if path.suffix == ".rrd":
        expect_absent(path, force=force)
    else:
        check_picture(path, force=force)


def _update(opened: Opened, chosen: Restored, folder: Path, number: int | None) -> tuple[Moment, StepRecord]:
    """Find one update; only pictures up to it are read."""
    alone = replace(opened, runs=[chosen.saved], restored=[chosen])
    found: tuple[Moment, StepRecord] | None = None
    for moment, records in alone.updates():
        found = moment, records[chosen.saved.manifest.label]
        if moment.frame.step == number:
            return found
    if found is None:
        raise InputError(folder, "holds no update")
    if number is not None:
        raise InputError(folder, f"has no step {number}; it has 1 to {found[0].frame.step}")
    return found


def _check_number(what: str, number: int, count: int) -> None:
    if not 0 <= number < count:
        raise OptionError(f"there is no {what} {number}; they are 0 to {count - 1}")
