"""`maurice-replay record SOURCE -o DIR`: write down what a live source says, and nothing else."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from maurice_loaders.live.session import ListenOptions, LiveRecorder, LiveSession
from maurice_loaders.live.source import live_source
from maurice_loaders.reading import MAX_DT_S, ReadingOptions

from ...errors import Terminated
from ..console import note, progress, results
from ..errors import INTERRUPTED, TERMINATED, one_line_errors
from ..options import ForceOption, JsonOption

SourceArgument = Annotated[
    Path,
    typer.Argument(
        metavar="SOURCE",
        help="tcp://HOST:PORT, ws://HOST:PORT, - (standard input), or a file that grows.",
        show_default=False,
        allow_dash=True,
    ),
]
OutputOption = Annotated[
    Path, typer.Option("-o", "--output", metavar="DIR", help="Write session.log to this folder.")
]
LibraryOption = Annotated[
    Path | None,
    typer.Option("--library", help="Name this survey or library in the recorded header. [default: its own]"),
]
TopicOption = Annotated[
    str | None, typer.Option(help="Of ws://: which topic it is. [default: detected, printed]")
]
MaxDtOption = Annotated[
    float, typer.Option("--max-dt", min=0.0, help="Of ws://: most seconds between picture and odometry.")
]

PatienceOption = Annotated[
    float | None,
    typer.Option(
        "--patience",
        min=0.0,
        metavar="SECONDS",
        help="End when the source was away, or silent, for this long. [default: 30 away; silent forever]",
    ),
]


def record(
    source: SourceArgument,
    output: OutputOption,
    library: LibraryOption = None,
    image_topic: TopicOption = None,
    odometry_topic: TopicOption = None,
    truth_topic: TopicOption = None,
    max_dt: MaxDtOption = MAX_DT_S,
    patience: PatienceOption = None,
    force: ForceOption = False,
    json_output: JsonOption = False,
) -> None:
    """Record a live source into a session log, until it ends or you press Ctrl-C."""
    from ...app.replay import patience_of

    topics = ReadingOptions(
        image_topic=image_topic, odometry_topic=odometry_topic, truth_topic=truth_topic, max_dt_s=max_dt
    )
    stopped: KeyboardInterrupt | None = None
    with one_line_errors():
        listen = ListenOptions(patience=patience_of(patience), only_record=True, library=library)
        recorder = LiveRecorder(output, force=force)
        session = LiveSession(live_source(source, topics), listen, recorder, note)
        try:
            with session:
                _listen(session)
        except KeyboardInterrupt as stop:
            stopped = stop
            session.close()  # it may have been stopped while it began
        _tell(session, json_output)
    if stopped is not None:
        raise typer.Exit(TERMINATED if isinstance(stopped, Terminated) else INTERRUPTED)


def _listen(session: LiveSession) -> None:
    with progress("record") as advance:
        session.listen(lambda counts: advance(counts.records, 0))


def _tell(session: LiveSession, json_output: bool) -> None:
    for text in (*(session.info_if_any.notes if session.info_if_any else ()), *session.warnings):
        note(text)
    if session.ended:
        note(f"{session.ended}; ended")
    if session.problem_count:
        note(
            f"{session.problem_count} lines made no sense and were left out, the first: {session.problems[0]}"
        )
    counts = session.counts
    if session.info_if_any is None:
        note("stopped before a header came; nothing was written")
    if json_output:
        found = {"records": counts.records, "pictures": counts.pictures, "broken": counts.broken}
        results.print_json(json.dumps({"session": str(session.path), **found, "gaps": counts.gaps}))
    elif session.info_if_any is not None:
        results.print(f"{session.path}: {counts.records} records, {counts.pictures} of them pictures")
