"""`rerun-importer-maurice`: on the PATH it makes `rerun session.log` show a replay.

Rerun starts every importer for every file that it opens. Files of other programs are declined quickly:
until the file is recognized, only the standard library is loaded. Exit status 66 means "not supported".
"""

from __future__ import annotations

import argparse
import os
import select
import sys
import threading
import time
from pathlib import Path
from typing import TYPE_CHECKING

from maurice_loaders.files.text import read_json

from .shared.visible import visible

if TYPE_CHECKING:
    import rerun as rr

    from maurice_loaders.reading.session import RecordedSession
    from maurice_loaders.session_log.reader import SurveyLog

    from ..running.run import Playback

NOT_MINE = 66
MANIFEST = "manifest.json"  # stands for a saved run: Rerun opens a folder file by file
GONE = "the viewer went away before everything was shown"
LOOK_S = 0.5  # between two looks whether the viewer is still there
HEADER_BYTES = 2**20  # a header with a large map is a few hundred kB
LOG, RUNS = b'"maurice-session-log"', ("maurice-run", "maurice-runs")


def main() -> None:
    """Draw a log, or a saved run by its manifest.json, as a Rerun recording on standard output."""
    path, recording_id = _arguments(sys.argv[1:])
    if not is_ours(path):
        sys.exit(NOT_MINE)
    if sys.stdout.isatty():
        sys.stderr.write("rerun-importer-maurice: rerun starts this itself; type: rerun FILE\n")
        sys.exit(2)
    if hasattr(select, "poll"):
        threading.Thread(target=_end_with_reader, daemon=True).start()
    try:
        status = _import(path, recording_id)
    except KeyboardInterrupt:
        status = 130
    sys.exit(status)


def _arguments(words: list[str]) -> tuple[Path, str | None]:
    """Return the file and the recording that Rerun wants it in; its other options do not matter here."""
    parser = argparse.ArgumentParser("rerun-importer-maurice", description=main.__doc__, allow_abbrev=False)
    parser.add_argument("file", type=Path)
    parser.add_argument("--recording-id")
    known, _ = parser.parse_known_args(words)
    return known.file, known.recording_id


def is_ours(path: Path) -> bool:
    """Return whether a path is a native log or a saved run, by first line or manifest; never raises."""
    try:
        if not path.is_file():
            return False
        if path.name == MANIFEST:
            return _is_run(path)
        with path.open("rb") as file:
            line = file.readline(HEADER_BYTES).removeprefix(b"\xef\xbb\xbf")
    except (OSError, ValueError):
        return False
    return line.lstrip().startswith(b"{") and LOG in line


def _is_run(manifest: Path) -> bool:
    if manifest.stat().st_size > HEADER_BYTES:
        return False
    content = read_json(manifest.read_bytes())
    return isinstance(content, dict) and content.get("format") in RUNS


def _import(path: Path, recording_id: str | None) -> int:
    """Draw it; an error ends in one line and status 1."""
    from maurice_loaders.errors import InputError

    try:
        _draw(path, recording_id)
    except InputError as problem:
        text = str(problem)
    except OSError as problem:
        where = f"{problem.filename}: " if problem.filename else ""
        text = f"{where}{problem.strerror or problem}"
    else:
        return 0
    sys.stderr.write(visible(f"maurice-replay: {' '.join(text.split())}\n"))
    return 1


def _draw(path: Path, recording_id: str | None) -> None:
    from maurice_loaders.formats.registry import open_session
    from maurice_loaders.session_log.reader import SurveyLog, is_survey

    from ..running.saved import open_saved, playback_of
    from .shared.console import TO_CONSOLE

    if path.name == MANIFEST:
        _play(playback_of(open_saved(path.parent, TO_CONSOLE), TO_CONSOLE), recording_id)
        return
    if is_survey(path):
        _draw_alone(SurveyLog(path), recording_id)
        return
    session = open_session(path)
    survey = session.info.survey
    if survey is not None and survey.exists():
        _play(_usual_run(session), recording_id)
    else:
        _draw_alone(session, recording_id)


def _usual_run(log: RecordedSession) -> Playback:
    from ..app.replay import playback_of_session
    from ..running.filters import Filter
    from ..running.open import make_runs, open_library_for
    from .shared.console import TO_CONSOLE

    library = open_library_for(log, None, keep_going=False, listener=TO_CONSOLE)
    runs = make_runs(log, library, [Filter()], TO_CONSOLE)
    return playback_of_session(log, library, runs, log.overview(), TO_CONSOLE)


def _play(playback: Playback, recording_id: str | None) -> None:
    """Draw runs as they go, so that the viewer shows the first steps at once."""
    from ..running.observer import SceneObserver
    from ..running.output import layout_of
    from ..running.run import collector_of, step_through
    from ..viewer.sinks import recording
    from .shared.console import TO_CONSOLE

    rec = recording(playback.scene.info.name, recording_id)
    rec.stdout(default_blueprint=layout_of(playback.views, playback.scene))
    collector = collector_of(playback)
    observer = SceneObserver(rec, playback.views, playback.scene)
    step_through(playback, observer, {}, collector, TO_CONSOLE)
    playback.remarks(collector)
    _finish(rec)


def _draw_alone(log: RecordedSession | SurveyLog, recording_id: str | None) -> None:
    from maurice_loaders.errors import ReadingNotes
    from maurice_loaders.reading.session import RecordedSession

    from ..layouts.drive import drive_blueprint
    from ..panels.drive import DriveView, draw_drive, drive_paths
    from ..running.drive import moments_of
    from ..viewer.sinks import recording
    from .shared.console import note

    advice = "This is a survey: a library is built from it."
    if isinstance(log, RecordedSession):
        missing = log.info.survey or 'no "survey" in its header'
        advice = f"Its library is not there ({missing}), so that only the drive itself is shown."
        note(f"{log.path}: {advice[0].lower()}{advice[1:]}")
    notes = ReadingNotes(keep_going=True)
    known = log.glances(notes) if isinstance(log, RecordedSession) else moments_of(log)
    drive = DriveView(log.info, drive_paths(known, log.info), log.count_pictures() > 0, advice)
    rec = recording(log.info.name, recording_id)
    rec.stdout(default_blueprint=drive_blueprint(drive))
    draw_drive(rec, drive, moments_of(log))
    _finish(rec)


def _finish(rec: rr.RecordingStream) -> None:
    """Write out. OSError when that is not possible."""
    try:
        rec.flush()
    except (RuntimeError, ValueError):
        raise OSError(GONE if _is_left() else "not everything could be written to standard output") from None
    if _is_left():
        raise OSError(GONE)


def _end_with_reader() -> None:
    """End this process when the viewer has gone away: the SDK would wait for a closed pipe forever."""
    while not _nobody_reads():
        time.sleep(LOOK_S)
    sys.stderr.write(f"maurice-replay: {GONE}\n")
    sys.stderr.flush()
    os._exit(1)


def _is_left() -> bool:
    return hasattr(select, "poll") and _nobody_reads()  # not on Windows


def _nobody_reads() -> bool:
    """Return whether standard output is a pipe whose other end was closed."""
    poll = select.poll()
    poll.register(sys.stdout.fileno(), 0)
    return any(event & (select.POLLERR | select.POLLHUP) for _, event in poll.poll(0))
