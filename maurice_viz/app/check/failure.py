"""The run that failed a check: replayed once more, to say why, and to draw the steps around the failure."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from maurice_loaders.errors import InputError
from maurice_loaders.files.writing import write_whole
from maurice_loaders.reading.session import RecordedSession
from maurice_loaders.runs.store import SavedRun
from maurice_mcl.values import Library, Plain

from ...errors import Listener
from ...playback import FilterRun, run_together, shared
from ...running.output import Output
from ...running.run import Playback, play
from ...scene import Detail, RunView, Scene
from ..diagnose import RunDiagnosis, diagnose

STEPS_AROUND = 10  # steps drawn before and after the first that failed
HARMLESS = "Only what is demanded was not met."
DIAGNOSIS = "diagnosis"  # file, as text and as JSON


@dataclass(frozen=True, slots=True, eq=False)
class Replayed:
    """What is needed to make a run again, picture by picture."""

    session: RecordedSession
    library: Library
    run: FilterRun
    steps: Sequence[int]  # numbers of the updates


@dataclass(frozen=True, slots=True)
class FailedRun(Plain):
    """One run that failed: why, and where that can be looked at."""

    seed: int
    step: int  # the first that failed
    diagnosis: RunDiagnosis
    recording: Path | None = None  # the steps around it

    @property
    def text(self) -> str:
        """The diagnosis in lines."""
        why = self.diagnosis.text if self.diagnosis.failures else f"{self.diagnosis.text} {HARMLESS}"
        return f"seed {self.seed}, first failed at step {self.step}\n{why}"


def failed_run(
    replayed: Replayed, seed: int, update: int, name: str, artifacts: Path | None, listener: Listener
) -> FailedRun:
    """Make the run of a seed again; say why it failed and, with a folder, draw the steps around an update."""
    step = replayed.steps[update]
    steps = replayed.steps[max(update - STEPS_AROUND, 0) : update + STEPS_AROUND + 1]
    folder = None if artifacts is None else artifacts / _words(name)
    file = None if folder is None else folder / f"seed-{seed}-step-{step}.rrd"
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
    run = replace(replayed.run, localizer=replace(replayed.run.localizer, seed=seed))
    session = replayed.session
    total, has_truth = session.overview()
    scene = Scene(session.info, replayed.library, has_truth, len(steps))
    playback = Playback(
        shared(run_together([run], session.moments())),
        total,
        [RunView.of(run.label, run.localizer, run.start)],
        scene,
        lambda collector: None,
        drawn=range(steps[0], steps[-1] + 1),
    )
    output = Output(file, force=True, detail=Detail.LIGHT.value)
    scores = play(playback, output, listener)
    result = scores.runs[0]
    diagnosis = RunDiagnosis(result.label, result.verdict, None, session.info.display_units)
    failed = FailedRun(seed, step, diagnosis, file)
    _write(failed, folder)
    return failed


def failed_recorded(saved: SavedRun, seed: int, step: int, name: str, artifacts: Path | None) -> FailedRun:
    """Say why a recorded localizer's run failed, of which nothing is made again."""
    folder = None if artifacts is None else artifacts / _words(name)
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
    failed = FailedRun(seed, step, diagnose(saved.folder).runs[0], None)
    _write(failed, folder)
    return failed


def _words(name: str) -> str:
    return re.sub(r"[^\w.+]+", "-", name).strip("-.") or "drive"


def _write(failed: FailedRun, folder: Path | None) -> None:
    if folder is not None:
        write_whole(folder / f"{DIAGNOSIS}.txt", f"{failed.text}\n".encode(), force=True)
        as_json = json.dumps(failed.to_json(), indent=1)
        write_whole(folder / f"{DIAGNOSIS}.json", as_json.encode(), force=True)


def expect_new_artifacts(folder: Path, *, force: bool) -> None:
    """Refuse a folder that holds something, unless `force`. InputError."""
    if folder.exists() and not folder.is_dir():
        raise InputError(folder, "found a file, expected a folder for artifacts")
    if not force and folder.is_dir() and any(folder.iterdir()):
        raise InputError(folder, "holds something already; choose another folder, or --force")
