"""`maurice-replay jump RUN --to lost`: move the open viewer to an event of a saved run."""

from __future__ import annotations

from typing import Annotated

import typer

from ...entities import Phase
from ..console import listening, results
from ..convert.export import RunArgument
from ..errors import one_line_errors

PHASES = " | ".join(phase.name.lower() for phase in Phase)

ToOption = Annotated[
    str | None,
    typer.Option("--to", metavar="KIND|NOTE", help="An event by its kind, or a bookmark by its text."),
]
NthOption = Annotated[int, typer.Option("--nth", min=1, help="The second, third ... of them.")]
StepOption = Annotated[int | None, typer.Option("--step", help="A step by its number.")]
PhaseOption = Annotated[str | None, typer.Option("--phase", help=f"Inside the step: {PHASES}.")]
LabelOption = Annotated[
    str | None, typer.Option("--run-label", help="Only events of this run of a comparison.")
]
PortOption = Annotated[
    int | None,
    typer.Option(
        "--port", min=1, max=65535, help="The port of a viewer that you opened. [default: the one we opened]"
    ),
]


def jump(
    run: RunArgument,
    to: ToOption = None,
    nth: NthOption = 1,
    step: StepOption = None,
    phase: PhaseOption = None,
    run_label: LabelOption = None,
    port: PortOption = None,
) -> None:
    """Move the open viewer to an event, a bookmark or a step of a saved run."""
    from ...app.events import jump as move

    with one_line_errors(), listening() as listener:
        place = move(
            run, to, nth=nth, step=step, phase=phase, run_label=run_label, port=port, listener=listener
        )
    results.print(f"step {place.step}{f', {phase}' if phase else ''}: {place.text}")
