"""`maurice-replay diagnose SESSION|RUN`: why a filter was lost."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from rich.text import Text

from .shared import options as opt
from .shared.console import listening, print_json, results
from .shared.options import argument, option


def diagnose(
    source: Annotated[
        Path, argument("SESSION|RUN", "A saved run or a comparison, or a session, which is then filtered.")
    ],
    chosen: opt.FilterSet,
    reading: opt.ReadingSet,
    seed: opt.Seed = 0,
    output: Annotated[
        Path | None,
        option("-o --output", "Draw what shows each failure of a saved run into this folder.", metavar="DIR"),
    ] = None,
    force: opt.Force = False,
    json_output: opt.Json = False,
) -> None:
    """Say why a filter was lost: one cause for each time, with the step and the numbers that decided."""
    from ..app.diagnose import diagnose as diagnose_runs
    from ..app.diagnose import draw, expect_drawable

    with listening(usage=False) as listener:
        if output is not None:
            expect_drawable(source, output, force=force)
        diagnoses = diagnose_runs(
            source, **chosen.arguments(), seed=seed, reading=reading.options(), listener=listener
        )
        if json_output:
            print_json(diagnoses.to_json())
        else:
            results.print(Text(diagnoses.text), soft_wrap=not results.is_terminal)
        if output is not None:
            for picture in draw(diagnoses, output, force=force, listener=listener):
                listener.remark(f"{picture} written")
