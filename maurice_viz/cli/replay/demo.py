"""`maurice-replay demo`: color beside blended on the simulated Maurice arena."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from ..console import listening, note, results
from ..options import ForceOption, JsonOption, RrdOption, output_of
from ..scores import printed

DEMO_SEED = 0  # the first, for arena, survey, drive and filter alike
SessionOnlyOption = Annotated[
    Path | None,
    typer.Option("--session-only", metavar="DIR", help="Only write session and survey to this folder."),
]


def demo(
    session_only: SessionOnlyOption = None,
    rrd: RrdOption = None,
    force: ForceOption = False,
    json_output: JsonOption = False,
) -> None:
    """Compare color and blended features on a drive through a simulated two-room arena."""
    from maurice_datasets.sessions import demo_paths, write_demo

    from ...app.compare import COLOR_AND_BLENDED, compare_any

    with listening() as listener:
        if session_only is None:
            session = demo_paths(DEMO_SEED, progress=listener.progress).session
            given = {"feature": COLOR_AND_BLENDED, "seed": [DEMO_SEED]}
            output = output_of("demo", rrd, force=force)
            compare_any([session], None, given, output, listener=listener, report=printed(json_output))
            return
        written = write_demo(session_only, DEMO_SEED, force=force, progress=listener.progress)
    if json_output:
        results.print_json(json.dumps({"session": str(written.session), "survey": str(written.survey)}))
    else:
        results.print(f"{written.session}\n{written.survey}")
    note(f"now try: maurice-replay {written.session}")
