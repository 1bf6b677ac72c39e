"""`maurice-replay demo`: color beside blended on the simulated Maurice arena."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from ..console import note, progress, results
from ..errors import one_line_errors
from ..options import (
    ForceOption,
    HeadlessOption,
    JsonOption,
    NoRecordingOption,
    OutputOptions,
    RunOptions,
    SaveOption,
)
from .compare import COLOR_AND_BLENDED

DEMO_SEED = 0  # the first, for arena, survey, drive and filter alike
SessionOnlyOption = Annotated[
    Path | None,
    typer.Option("--session-only", metavar="DIR", help="Only write session and survey to this folder."),
]


def demo(
    session_only: SessionOnlyOption = None,
    save: SaveOption = None,
    headless: HeadlessOption = False,
    no_recording: NoRecordingOption = False,
    force: ForceOption = False,
    json_output: JsonOption = False,
) -> None:
    """Compare color and blended features on a drive through a simulated two-room arena."""
    from maurice_datasets.sessions import demo_paths, write_demo

    from ...app.open import RunSpec
    from ...app.run import replay_runs

    with one_line_errors():
        if session_only is not None:
            with progress("arena") as advance:
                written = write_demo(session_only, DEMO_SEED, force=force, progress=advance)
            if json_output:
                results.print_json(
                    json.dumps({"session": str(written.session), "survey": str(written.survey)})
                )
            else:
                results.print(f"{written.session}\n{written.survey}")
            note(f"now try: maurice-replay {written.session}")
            return
        with progress("arena") as advance:
            paths = demo_paths(DEMO_SEED, progress=advance)
    options = RunOptions(DEMO_SEED)
    output = OutputOptions("demo", save, headless, no_recording, force, json_output)
    wanted = [RunSpec(feature=feature) for feature in COLOR_AND_BLENDED]
    replay_runs(paths.session, None, wanted, options, output, keep_going=False)
