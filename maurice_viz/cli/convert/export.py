"""`maurice-replay export RUN`: a saved run as files for other tools."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from maurice_loaders.export.tables import PATHS

from ...app.convert import export as export_run
from ..console import listening, results
from ..errors import one_line_errors
from ..options import ForceOption, JsonOption

FILES = "Files to write"

RunArgument = Annotated[
    Path, typer.Argument(metavar="RUN", show_default=False, help="A saved run's folder, or a comparison's.")
]
RunLabelOption = Annotated[
    str | None, typer.Option("--run-label", metavar="LABEL", help="Which run of a comparison.")
]


def export(
    run: RunArgument,
    tum: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Paths as TUM: t x y z qx qy qz qw.", rich_help_panel=FILES),
    ] = None,
    kitti: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Paths as KITTI: 12 numbers.", rich_help_panel=FILES),
    ] = None,
    csv: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="A table with one row per update.", rich_help_panel=FILES),
    ] = None,
    parquet: Annotated[
        Path | None, typer.Option(metavar="FILE", help="The same table as Parquet.", rich_help_panel=FILES)
    ] = None,
    mcap: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="ROS 2 messages: pictures, poses, clouds. Needs maurice-replay[ros].",
            rich_help_panel=FILES,
        ),
    ] = None,
    evo: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Position errors as `evo_ape --save_results` has them.",
            rich_help_panel=FILES,
        ),
    ] = None,
    only: Annotated[
        str | None,
        typer.Option(help=f"Only one path for TUM and KITTI: {' | '.join(PATHS)}. [default: all three]"),
    ] = None,
    scored: Annotated[
        bool, typer.Option("--scored", help="Leave out the first three updates, as the table of scores does.")
    ] = False,
    t_offset: Annotated[
        float, typer.Option(metavar="SECONDS", help="Add this to every time; the clock is the session's.")
    ] = 0.0,
    run_label: RunLabelOption = None,
    force: ForceOption = False,
    json_output: JsonOption = False,
) -> None:
    """Write estimate, truth and odometry of a saved run as files for other tools, without filtering again."""
    with one_line_errors(), listening() as listener:
        exported = export_run(
            run,
            tum=tum,
            kitti=kitti,
            csv=csv,
            parquet=parquet,
            mcap=mcap,
            evo=evo,
            only=only,
            scored=scored,
            t_offset_s=t_offset,
            run_label=run_label,
            force=force,
            listener=listener,
        )
    if json_output:
        results.print_json(json.dumps({"runs": [exported.to_json()]}))
        return
    for file in exported.files:
        results.print(str(file), soft_wrap=True)
