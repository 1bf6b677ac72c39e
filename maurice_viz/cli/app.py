"""The command `maurice-replay`: the app and its default command, no logic."""

from __future__ import annotations

from importlib.metadata import version
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from maurice_mcl.sensor.descriptors import BROKEN

from .configure.config import config
from .console import note
from .convert.convert import convert
from .convert.export import export
from .convert.formats import formats
from .convert.imports import imports
from .convert.record import record
from .library.build import library
from .replay.compare import compare
from .replay.demo import demo
from .replay.replay import replay
from .replay.verify import verify
from .simulate.calibrate import calibrate
from .simulate.simulate import simulate
from .simulate.survey import survey
from .understand.doctor import doctor
from .understand.events import events
from .understand.explain import explain
from .understand.inspect import inspect
from .understand.jump import jump
from .understand.report import report
from .understand.snapshot import snapshot

OWN_OPTIONS = {"--help", "--version", "--install-completion", "--show-completion"}


class ReplayByDefault(TyperGroup):
    """`maurice-replay SESSION` is `maurice-replay replay SESSION`, with options before or after."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Put `replay` in front of what is neither a command nor an option of the app's own."""
        if args and args[0] not in OWN_OPTIONS and args[0] not in self.commands:
            args = ["replay", *args]
        return super().parse_args(ctx, args)


app = typer.Typer(
    cls=ReplayByDefault,
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    help="Replay a robot session through vision-based Monte Carlo localization and look at every step in "
    "Rerun. `maurice-replay SESSION` is short for `maurice-replay replay SESSION`.",
)
app.command()(replay)
app.command()(compare)
app.command()(demo)
app.command()(events)
app.command()(explain)
app.command()(snapshot)
app.command()(report)
app.command()(jump)
app.command()(inspect)
app.command()(doctor)
app.command()(formats)
app.command()(convert)
app.command()(export)
app.command()(record)
app.command()(simulate)
app.command()(survey)
app.command()(verify)
app.add_typer(library, name="library")
app.add_typer(config, name="config")
app.add_typer(imports, name="import")
app.add_typer(calibrate, name="calibrate")


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"maurice-replay {version('maurice-replay')}")
        raise typer.Exit


@app.callback()
def _root(
    show_version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    for text in BROKEN:
        note(text)
