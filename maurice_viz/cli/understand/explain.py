"""`maurice-replay explain RUN`: one update of a saved run, and why its references are believed or not."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from maurice_loaders.errors import InputError
from maurice_mcl.analysis.explanation import Asked, explain_step
from maurice_mcl.library import Library
from maurice_mcl.records import StepRecord
from maurice_mcl.session import Moment

from ...app.open import typed_pose
from ...app.restoring import Restored
from ...app.saved import Opened, open_saved
from ...explain.table import to_json
from ...explain.words import say_step
from ...style import Units, scale_for
from ..console import results
from ..errors import one_line_errors
from ..options import ForceOption, HeadlessOption, JsonOption, NoRecordingOption, OutputOptions, SaveOption


@dataclass(frozen=True, slots=True)
class Wanted:
    """What was asked for, still as typed."""

    step: int | None
    at: str | None
    entry: int | None
    particle: int | None
    run_label: str | None


def explain(
    run: Annotated[Path, typer.Argument(help="A saved run's folder.", show_default=False, metavar="RUN")],
    step: Annotated[
        int | None, typer.Option("--step", min=1, help="Which update. [default: the last one]")
    ] = None,
    at: Annotated[
        str | None,
        typer.Option(
            "--at", metavar="X,Y,HEADING", help="Explain this pose too, in display units and degrees."
        ),
    ] = None,
    entry: Annotated[
        int | None, typer.Option("--entry", min=0, help="Explain this library entry too.")
    ] = None,
    particle: Annotated[
        int | None,
        typer.Option(
            "--particle", min=0, help="Explain this particle too, by its number in the saved cloud."
        ),
    ] = None,
    run_label: Annotated[
        str | None, typer.Option("--run-label", metavar="LABEL", help="Which run of a comparison.")
    ] = None,
    save: SaveOption = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="OUT.png", help="Write a picture of the panel to this file."),
    ] = None,
    headless: HeadlessOption = False,
    no_recording: NoRecordingOption = False,
    force: ForceOption = False,
    json_output: JsonOption = False,
) -> None:
    """Say and show why the filter believed what it believed at one update of a saved run."""
    if sum(given is not None for given in (at, entry, particle)) > 1:
        raise typer.BadParameter("--at, --entry and --particle exclude each other")
    wanted = Wanted(step, at, entry, particle, run_label)
    goes = OutputOptions(run.absolute().stem, save, headless, no_recording, force, json_output)
    with one_line_errors():
        _explain(run, wanted, goes, output)


def _explain(folder: Path, wanted: Wanted, output: OutputOptions, picture: Path | None) -> None:
    from ...app.explanation_show import check_picture, show
    from ...panels.explanation_screen import ExplainedUpdate

    if picture is not None:
        check_picture(picture, force=output.force)
    opened = open_saved(folder)
    chosen = _chosen(opened, folder, wanted.run_label)
    library = opened.scene.library
    scale = scale_for(opened.scene.info.display_units, library.arena)
    moment, record = _update(opened, chosen, folder, wanted.step)
    if chosen.sensor is None or not len(record.sighting.comparison.quality):
        raise InputError(folder, "cannot be explained without its session and library; put them back")
    asked = _asked(wanted, record, library, scale.units)
    step = explain_step(record, chosen.sensor, moment.truth, asked, weigh=True)
    label = chosen.saved.manifest.label
    if output.json:
        results.print_json(json.dumps(to_json(label, step)))
    else:
        typer.echo("\n\n".join([f"{label}, step {step.step}", *say_step(step, scale)]))
    show(ExplainedUpdate(moment, record, step, library, scale), label, output, picture)


def _chosen(opened: Opened, folder: Path, label: str | None) -> Restored:
    labels = [one.saved.manifest.label for one in opened.restored]
    if label is None and len(labels) > 1:
        raise InputError(folder, f"holds the runs {', '.join(labels)}; choose one with --run-label")
    if label is not None and label not in labels:
        raise InputError(folder, f"holds no run {label!r}; it holds {', '.join(labels)}")
    return opened.restored[labels.index(label) if label is not None else 0]


def _update(opened: Opened, chosen: Restored, folder: Path, number: int | None) -> tuple[Moment, StepRecord]:
    """Find one update; only pictures up to it are read."""
    alone = Opened([chosen.saved], [chosen], opened.session, opened.scene)
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


def _asked(wanted: Wanted, record: StepRecord, library: Library, units: Units) -> Asked | None:
    if wanted.entry is not None:
        _check_number("entry", wanted.entry, library.size)
        return Asked(entry=wanted.entry)
    if wanted.particle is not None:
        _check_number("particle", wanted.particle, record.weighted.size)
        return Asked(pose=record.weighted.world_poses[wanted.particle])
    return None if wanted.at is None else Asked(pose=typed_pose(wanted.at, units, "--at is X,Y,HEADING"))


def _check_number(what: str, number: int, count: int) -> None:
    if number >= count:
        raise typer.BadParameter(f"there is no {what} {number}; they are 0 to {count - 1}")
