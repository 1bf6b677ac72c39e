"""`maurice-replay diagnose SESSION|RUN`: why a filter was lost."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from rich.text import Text

from .shared import options as opt
from .shared.console import listening, print_json, results
from .shared.options import argument, option, reading_of, settings_of


def diagnose(
    source: Annotated[
        Path, argument("SESSION|RUN", "A saved run or a comparison, or a session, which is then filtered.")
    ],
    library: opt.Library = None,
    preset: opt.Preset = None,
    feature: opt.Feature = None,
    particles: opt.Particles = None,
    seed: opt.Seed = 0,
    start: opt.Start = None,
    config: opt.Config = None,
    settings: opt.Set = None,
    output: Annotated[
        Path | None,
        option("-o --output", "Draw what shows each failure of a saved run into this folder.", metavar="DIR"),
    ] = None,
    force: opt.Force = False,
    json_output: opt.Json = False,
    reading: opt.Reading = None,
    keep_going: opt.KeepGoing = False,
) -> None:
    """Say why a filter was lost: one cause for each time, with the step and the numbers that decided."""
    from ..app.diagnose import diagnose as diagnose_runs
    from ..app.diagnose import draw, expect_drawable

    with listening(usage=False) as listener:
        if output is not None:
            expect_drawable(source, output, force=force)
        found = diagnose_runs(
            source,
            library,
            feature=feature,
            preset=preset,
            particles=particles,
            seed=seed,
            start=start,
            config=config,
            settings=settings_of(settings),
            reading=reading_of(reading, keep_going=keep_going),
            listener=listener,
        )
        if json_output:
            print_json(found.to_json())
        else:
            results.print(Text(found.text), soft_wrap=not results.is_terminal)
        if output is not None:
            for picture in draw(found, output, force=force, listener=listener):
                listener.remark(f"{picture} written")
