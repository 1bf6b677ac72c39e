"""Why a filter was lost: one cause for each time, of a saved run, or of a session that is filtered for it."""

from __future__ import annotations

import json
import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from maurice_loaders.doctor.gathering import Gathering
from maurice_loaders.doctor.plausibility import implausible
from maurice_loaders.errors import InputError, ReadingNotes
from maurice_loaders.files.paths import A_RUN
from maurice_loaders.files.writing import FolderKind, check_target, new_folder
from maurice_loaders.formats.registry import open_recording, unlike
from maurice_loaders.reading.options import Reading
from maurice_loaders.reading.recording import Recording, checked
from maurice_loaders.runs.manifest import is_saved
from maurice_mcl.reasons.causes import Failure, title_of
from maurice_mcl.reasons.verdict import RunVerdict
from maurice_mcl.scoring.table import SEARCHING
from maurice_mcl.values import plain

from ..entities import Phase, Place, open_command
from ..errors import SILENT, Listener, OptionError
from ..running.filters import AnyFilter
from ..style import Scale, units_named
from ..text.causes import say_evidence, say_failure, say_remedy
from ..text.findings import brief
from ..text.summary import failure_json
from ..text.verdict import headline, off_map
from .replay import replay

if TYPE_CHECKING:
    from maurice_loaders.runs.store import SavedRun

NEVER_LOST = "No failure: it was never lost."
IN_TIME = "No failure: it was localized again in time."
FOUND = "No failure: it was localized after a search."
NO_TRUTH = "There is no truth to judge by; what follows rests on the evidence alone."
NONE_WITHOUT_TRUTH = "There is no truth to judge by, and no sign that it was lost."
NO_SCAN_SIGNAL = "There is no truth to judge by: whether it was lost is not known."
NOT_SAVED = "pictures are drawn of a saved run: replay the session with --save-run first"
PICTURE = r"[^/]+-step-\d+-[\w-]+(?:-explained)?\.png"
MARK = "diagnosis.json"
DRAWN = FolderKind("pictures of failures", MARK, "maurice-diagnosis", rf"{MARK}|{PICTURE}")


@dataclass(frozen=True, slots=True, eq=False)
class RunDiagnosis:
    """Why one run failed, if it did."""

    label: str
    verdict: RunVerdict
    source: Path | None  # the saved run; None: nothing is saved
    display_units: str = "m"
    recorded: bool = False  # another localizer's: no step of it can be explained

    @property
    def failures(self) -> tuple[Failure, ...]:
        """Each time it was lost or not localized, in order."""
        return self.verdict.failures

    @property
    def text(self) -> str:
        """The diagnosis in lines."""
        scale = Scale(units_named(self.display_units))
        lines = [f"{self.label}: {headline({self.label: self.verdict}, scale)}"]
        lines += [left] if (left := off_map(self.verdict)) else []
        if not self.verdict.has_truth:
            none = NO_SCAN_SIGNAL if self.verdict.has_laser else NONE_WITHOUT_TRUTH
            lines.append(NO_TRUTH if self.failures else none)
        if not self.failures and self.verdict.has_truth:
            lines.append(self._no_failure)
        for failure in self.failures:
            lines += ["", say_failure(failure, scale)]
            lines += [f"  {line}" for line in say_evidence(failure, scale)]
            if failure.also:
                titles = (title_of(kind, self.verdict.has_laser) for kind in failure.also)
                lines.append(f"  also true: {', '.join(titles)}")
            if remedy := say_remedy(failure, self.verdict):
                lines.append(f"  try: {remedy}")
            lines += [f"  see: {command}" for command in self.commands(failure)]
        return "\n".join(lines)

    @property
    def _no_failure(self) -> str:
        kinds = {episode.kind for episode in self.verdict.episodes}
        return IN_TIME if kinds - {SEARCHING} else FOUND if kinds else NEVER_LOST

    def commands(self, failure: Failure) -> list[str]:
        """Return the commands that show a failure of a saved run; none where nothing is saved."""
        if self.source is None:
            return []
        run, step = shlex.quote(str(self.source)), failure.first
        explained = [] if self.recorded else [f"maurice-replay explain {run} --step {step}"]
        return [
            *explained,
            open_command(self.source, Place(step, Phase.PREDICT)),
            f"maurice-replay snapshot {run} --step {step} -o step-{step}.png",
        ]

    def to_json(self) -> dict[str, Any]:
        """Return everything as JSON: numbers in meters, texts in the units of the session."""
        scale = Scale(units_named(self.display_units))
        return {
            "label": self.label,
            "truth_known": self.verdict.has_truth,
            "updates": self.verdict.updates,
            "verdict": headline({self.label: self.verdict}, scale),
            "failures": [failure_json(failure, scale) for failure in self.failures],
        }


@dataclass(frozen=True, slots=True, eq=False)
class Diagnoses:
    """The diagnosis of each run of a source."""

    name: str  # of the session
    runs: tuple[RunDiagnosis, ...]
    recording: tuple[str, ...] = ()  # what is wrong with its numbers, asked before any filter is blamed

    @property
    def text(self) -> str:
        """All of it in lines, runs separated by blank lines; what is wrong with the recording first."""
        doubts = "\n".join(f"The recording: {text}" for text in self.recording)
        return "\n\n".join([*([doubts] if doubts else []), *(run.text for run in self.runs)])

    def __str__(self) -> str:
        return self.text

    def to_json(self) -> dict[str, Any]:
        """Return `{"session": ..., "recording": [...], "runs": [...]}`."""
        values = plain(self)
        return {"session": values.pop("name"), **values}


def diagnose(
    source: str | Path,
    library: str | Path | None = None,
    filter: AnyFilter = None,  # noqa: A002
    *,
    reading: Reading | None = None,
    listener: Listener = SILENT,
) -> Diagnoses:
    """Say why a filter was lost: one cause for each time, with the numbers that decided (docs/diagnose.md).

    `source` is a saved run or a comparison, or a session of any format, which is then filtered with the
    other arguments, those of `replay`. Raises OptionError for arguments that do not apply to a saved run,
    and InputError for bad files.

        >>> import maurice_viz as mv
        >>> found = mv.diagnose("my-run")
        >>> [failure.kind for failure in found.runs[0].failures]
        []
    """
    source = Path(source)
    if source.suffix == ".rrd":
        raise unlike(source, A_RUN)
    scores = replay(source, library, filter, reading=reading, listener=listener)
    runs = _runs_of(source)
    recorded = {run.manifest.label for run in runs if run.manifest.recorded}
    several = len(scores.runs) > 1
    return Diagnoses(
        scores.name,
        tuple(
            RunDiagnosis(
                run.label,
                run.verdict,
                (source / run.label if several else source) if runs else None,
                scores.display_units,
                run.label in recorded,
            )
            for run in scores.runs
        ),
        _doubts(source, runs, reading or Reading()),
    )


def _doubts(source: Path, runs: Sequence[SavedRun], reading: Reading) -> tuple[str, ...]:
    """Return what is wrong with a recording, by its numbers alone; nothing of one that is gone."""
    try:
        recording = _recording_of(runs[0]) if runs else open_recording(source, reading)
        gathering = Gathering()
        for record in checked(recording, ReadingNotes(keep_going=True)):
            gathering.add(record)
    except InputError:
        return ()
    return tuple(map(brief, implausible(gathering.drive(), gathering.scans)))


def _recording_of(run: SavedRun) -> Recording:
    """Open what a run was made from, as it was read then. InputError when it is gone or was changed."""
    from ..running.saved import recording_path, session_of

    if run.manifest.recorded:
        return open_recording(recording_path(run), run.manifest.reading)
    return session_of(run).recording


def _runs_of(source: Path) -> Sequence[SavedRun]:
    """Return the saved runs in a folder; none of what is no saved run."""
    if not is_saved(source):
        return ()
    from maurice_loaders.runs.store import open_runs  # loads polars, which a plain replay does without

    return open_runs(source)


def expect_drawable(source: Path, folder: Path, *, force: bool) -> None:
    """Refuse, before anything is run, what `draw` would refuse. OptionError, InputError."""
    if source.exists() and not is_saved(source):
        raise OptionError(NOT_SAVED)
    check_target(folder, DRAWN, force=force)


def draw(found: Diagnoses, folder: Path, *, force: bool = False, listener: Listener = SILENT) -> list[Path]:
    """Draw what shows each failure of saved runs into a new folder: the update at which its cause shows.

    Two pictures a failure: the references of that update, explained, and the viewer's first screen; only the
    latter of a recorded localizer. Raises OptionError if nothing is saved, and InputError for a folder that
    holds something.
    """
    from .explain import explain
    from .snapshot import snapshot

    shown = [(run, failure) for run in found.runs for failure in run.failures]
    if any(run.source is None for run in found.runs):
        raise OptionError(NOT_SAVED)
    pictures: list[Path] = []
    with new_folder(folder, DRAWN, force=force) as filling:
        (filling / DRAWN.mark).write_text(json.dumps({"format": DRAWN.format}) + "\n")
        for run, failure in shown:
            assert run.source is not None
            stem = f"{run.label}-step-{failure.first}-{failure.kind}"
            explained, screen = filling / f"{stem}-explained.png", filling / f"{stem}.png"
            snapshot(run.source, to=screen, step=failure.first, listener=listener)
            pictures.append(folder / screen.name)
            if not run.recorded:
                explain(run.source, failure.first, to=explained, listener=listener)
                pictures.append(folder / explained.name)
    return pictures
