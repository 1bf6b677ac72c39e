"""`maurice-replay library tune`: scales and weights of channels, fitted to a library and its robot."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from maurice_loaders.errors import InputError
from maurice_loaders.io.files import expect_absent, write_whole
from maurice_loaders.libraries.files import hash_file
from maurice_loaders.libraries.store import open_library
from maurice_mcl.calibration.tuning import (
    Measuring,
    Sample,
    drive_samples,
    judge,
    library_samples,
    pooled,
    rows_of,
    spread_out,
    tune,
)
from maurice_mcl.library import Library
from maurice_mcl.sensor.descriptors import CHANNELS
from maurice_mcl.sensor.features import FEATURES
from maurice_mcl.sensor.model import SensorParameters
from maurice_mcl.sensor.references import nearest_reference

from ...app.open import open_session
from ...text.tuning import Report, tuned_json, tuned_table, tuned_toml
from ..console import note, progress, results
from ..errors import one_line_errors
from ..options import ForceOption, JsonOption, KeepGoingOption

BEFORE = SensorParameters(FEATURES["blended"])  # what is measured against: the default


def tune_library(
    path: Annotated[
        Path, typer.Argument(metavar="LIBRARY", help="A library folder or a survey log.", show_default=False)
    ],
    session: Annotated[
        list[Path] | None,
        typer.Option("--session", metavar="FIT.log", help="A drive with truth to fit on; may be repeated."),
    ] = None,
    score: Annotated[
        list[Path] | None,
        typer.Option("--score", metavar="TEST.log", help="A drive with truth to score on; may be repeated."),
    ] = None,
    channels: Annotated[
        str | None, typer.Option("--channels", metavar="A,B,C", help="Fit these. [default: all there are]")
    ] = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="TUNED.toml", help="Write what was fitted here.")
    ] = None,
    force: ForceOption = False,
    keep_going: KeepGoingOption = False,
    json_output: JsonOption = False,
) -> None:
    """Fit scales and weights of channels by log score, on drives with truth or on the library alone."""
    fit, test = session or [], score or []
    with one_line_errors():
        if output is not None:
            expect_absent(output, force=force)
        _refuse_fitted(fit, test)
        with progress("library") as advance:
            library = open_library(path, progress=advance, warn=note)
        report = _tuned(_Tuning(path, library, _wanted(path, library, channels), keep_going), fit, test)
        toml = tuned_toml(report)
        if output is not None:
            write_whole(output, toml.encode(), force=force)
    if not test:
        where = "the drives fitted on" if fit else "the library itself"
        note(f"scored on {where}, which flatters; --score a drive that was not fitted on")
    if json_output:
        results.print_json(json.dumps(tuned_json(report)))
        return
    results.print(tuned_table(report))
    if output is None:
        typer.echo(toml, nl=False)
    else:
        note(f"{output} written; now try: maurice-replay SESSION --config {output}")


@dataclass(frozen=True, slots=True, eq=False)
class _Tuning:
    """What is tuned."""

    path: Path
    library: Library
    channels: tuple[str, ...]
    keep_going: bool

    @property
    def rows(self) -> tuple[str, ...]:
        """The channels that are measured: those to be tuned first, then what else the default needs."""
        return tuple(dict.fromkeys([*self.channels, *self.before]))

    @property
    def before(self) -> dict[str, float]:
        """What a unit of distance costs in the default blend, as far as the library has its channels."""
        there = [name for name in BEFORE.weights if name in self.library.index]
        return {name: BEFORE.weights[name] / BEFORE.scale_of(name) for name in there}

    @property
    def measuring(self) -> Measuring:
        """How pictures are compared."""
        return Measuring(self.library, {name: BEFORE.distance_of(name) for name in self.rows})


def _refuse_fitted(fit: Sequence[Path], test: Sequence[Path]) -> None:
    fitted = {hash_file(path): path for path in fit}
    for path in test:
        same = fitted.get(hash_file(path))
        if same is not None:
            which = "is fitted on" if path == same else f"is the same drive as {same}, which is fitted on"
            raise InputError(path, f"{which}, and would flatter the result; score another drive")


def _wanted(path: Path, library: Library, channels: str | None) -> tuple[str, ...]:
    there = [name for name in library.index if name in CHANNELS]
    if channels is None:
        return tuple(there)
    wanted = tuple(dict.fromkeys(name.strip() for name in channels.split(",") if name.strip()))
    for name in wanted:
        if name not in CHANNELS:
            raise typer.BadParameter(f"no channel called {name!r}; there are {', '.join(CHANNELS)}")
        if name not in there:
            raise InputError(path, f"holds {', '.join(there)}, and {name} is wanted; build the library again")
    if not wanted:
        raise typer.BadParameter("--channels names no channel")
    return wanted


def _tuned(tuning: _Tuning, fit: Sequence[Path], test: Sequence[Path]) -> Report:
    samples = _fitting(tuning, fit)
    with progress("fit") as advance:
        tuned = tune(tuning.channels, rows_of(samples, range(len(tuning.channels))), advance)
    before = np.array([tuning.before.get(name, 0.0) for name in tuning.rows])
    fitted = judge(tuned, samples, before)
    del samples  # the drives to score on are measured one at a time
    scored = [judge(tuned, _drive(tuning, path), before) for path in test]
    return Report(
        tuned=tuned,
        distances=tuning.measuring.distances,
        library=tuning.library.name,
        fitted_on=tuple(path.name for path in fit),
        fitted=fitted,
        scored_on=tuple(path.name for path in test),
        scored=pooled(scored) if scored else None,
    )


def _fitting(tuning: _Tuning, fit: Sequence[Path]) -> list[Sample]:
    if fit:
        return [sample for path in fit for sample in _drive(tuning, path, len(fit))]
    with progress("library") as advance:
        found = library_samples(tuning.measuring, tuning.measuring.most_pictures(), advance)
    if not found:
        raise InputError(
            tuning.path, "found no two references near each other that look one way; fit on a --session"
        )
    return found


def _drive(tuning: _Tuning, path: Path, among: int = 1) -> list[Sample]:
    """Measure a drive; of a long one, or where it is one among many, evenly chosen pictures."""
    log, measuring = open_session(path, keep_going=tuning.keep_going), tuning.measuring
    pictures, _ = log.overview()
    taken = spread_out(pictures, max(1, measuring.most_pictures() // among))
    nearest = nearest_reference(tuning.library.poses, tuning.library.arena)
    with progress(path.name) as advance:
        found = drive_samples(measuring, nearest, log.moments(), taken, advance)
    for warning in log.warnings:
        note(warning)
    if log.problem_count:
        note(f"{path}: skipped {log.problem_count} broken records, the first: {log.problems[0]}")
    if not found:
        raise InputError(path, "found no picture with a true pose in the library's free space to tune with")
    return found
