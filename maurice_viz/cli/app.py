"""The command `maurice-replay`: the one list of its commands, each imported when it is called."""

from __future__ import annotations

import difflib
import os
import re
import sys
from collections.abc import Callable
from dataclasses import dataclass, fields, is_dataclass
from importlib import import_module
from inspect import Parameter, Signature, signature
from pathlib import Path
from typing import Annotated, Any, get_type_hints

import typer
from typer.core import TyperCommand, TyperGroup
from typer.main import get_command_from_info
from typer.models import CommandInfo

from .shared.errors import errors_end_the_command, fail, stop_by_exception
from .shared.visible import visible_output

GROUPS = (
    "Replay and compare",
    "Understand",
    "Recordings and files",
    "Library",
    "Simulate and calibrate",
    "Trials and configuration",
)


@dataclass(frozen=True, slots=True)
class Listed:
    """A command as the list has it: the function of its last word in a module of this package."""

    name: str  # one word, or two of a group of commands: "library build"
    module: str
    what: str  # one line
    group: str
    page: str = ""  # of the documentation, about it


_REPLAY, _WHY, _DATA, _LIBRARY, _SIMULATE, _TRIALS = GROUPS
COMMANDS = {
    command.name: command
    for command in (
        Listed("replay", "replay", "Replay a session, a saved run or a live source.", _REPLAY),
        Listed("open", "replay", "Open a Rerun recording or a saved run in the viewer.", _REPLAY),
        Listed("compare", "replay", "Replay two to four runs side by side.", _REPLAY, "explain"),
        Listed("demo", "replay", "Replay a simulated kidnapping, or two features.", _REPLAY, "tutorial"),
        Listed(
            "verify", "replay", "Filter a saved run again: is it the same to the bit?", _REPLAY, "saved-runs"
        ),
        Listed("diagnose", "runs", "Say why a filter was lost.", _WHY, "diagnose"),
        Listed("what-if", "runs", "Branch a saved run with a change; rank remedies.", _WHY, "what-if"),
        Listed("explain", "runs", "Explain one step of a saved run.", _WHY, "explain"),
        Listed("budget", "runs", "Find the part of a filter that costs most accuracy.", _WHY, "what-if"),
        Listed("check", "check", "Test whether a filter meets demands on drives, for CI.", _WHY, "trials"),
        Listed("report", "runs", "Write one page about a saved run.", _WHY, "share"),
        Listed("snapshot", "runs", "Take a picture or a movie.", _WHY, "share"),
        Listed("inspect", "recordings", "List what a recording or a saved run holds.", _DATA, "formats"),
        Listed("doctor", "recordings", "Find what is wrong in a recording, and the fix.", _DATA, "doctor"),
        Listed("record", "convert", "Record a live source into a session log.", _DATA, "your-robot"),
        Listed("convert", "convert", "Write a recording as a log or as MCAP.", _DATA, "share"),
        Listed("export", "convert", "Write a saved run for other tools.", _DATA, "share"),
        Listed("import pictures", "convert", "Make logs of pictures and poses.", _DATA, "your-robot"),
        Listed("library build", "library", "Build a library of reference pictures.", _LIBRARY, "library"),
        Listed("library show", "library", "Show what a library holds.", _LIBRARY, "library"),
        Listed("library check", "library", "Find gaps, look-alikes, and what to add.", _LIBRARY, "library"),
        Listed("library tune", "library", "Tune channels to a library.", _LIBRARY, "library"),
        Listed(
            "map build", "convert", "Build a laser's map from scans with true poses.", _LIBRARY, "library"
        ),
        Listed("simulate", "simulate", "Simulate a drive and its survey.", _SIMULATE, "simulate"),
        Listed("drive", "drive", "Drive the simulated robot yourself, live.", _SIMULATE, "simulate"),
        Listed("survey", "simulate", "Survey a simulated world.", _SIMULATE, "simulate"),
        Listed("calibrate motion", "calibrate", "Fit the motion parameters.", _SIMULATE, "calibrate"),
        Listed("calibrate noise", "calibrate", "Measure the camera's noise floor.", _SIMULATE, "calibrate"),
        Listed(
            "calibrate belief", "calibrate", "Check whether clouds hold the truth.", _SIMULATE, "lost-signal"
        ),
        Listed("calibrate drive", "calibrate", "Fit the odometry's noise to drives.", _SIMULATE, "calibrate"),
        Listed("trials run", "trials", "Make many runs over drives, filters and seeds.", _TRIALS, "trials"),
        Listed("trials table", "trials", "Print grouped figures with intervals.", _TRIALS, "trials"),
        Listed("trials report", "trials", "Write one page about trials.", _TRIALS, "trials"),
        Listed(
            "config", "config", "Show the effective configuration; check a file.", _TRIALS, "configuration"
        ),
    )
}
FAMILIES = {
    "trials": "Make many runs, print their figures, or write a page about them.",
    "library": "Build, show or check a library of reference pictures, or tune channels to it.",
    "map": "Build the map that a robot with a laser is localized on.",
    "import": "Convert other data to session and survey logs.",
    "calibrate": "Calibrate the motion model, the camera's noise and the belief.",
}
HELP = "help"  # a command, for who does not know --help
OWN_OPTIONS = {"--help", "--version", "--install-completion", "--show-completion"}


class PanelCommand(TyperCommand):
    """A command whose help lists its options by panel, and whose errors end in one line."""

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write the arguments, then the options of each panel."""
        panels: dict[str, list[tuple[str, str]]] = {"Arguments": [], "Options": []}
        for parameter in self.get_params(ctx):
            record = parameter.get_help_record(ctx)
            if record is not None:
                usual = "Arguments" if parameter.param_type_name == "argument" else "Options"
                panels.setdefault(getattr(parameter, "rich_help_panel", None) or usual, []).append(record)
        panels["Options"] = panels.pop("Options")  # those without a panel, and --help, come last
        for panel, rows in panels.items():
            if rows:
                with formatter.section(panel):
                    formatter.write_dl(rows)

    def invoke(self, ctx: Any) -> Any:
        """Run the command; bad input ends in one line and status 1, a request to stop in 130 or 143."""
        with errors_end_the_command():
            stop_by_exception()
            channels = sys.modules.get("maurice_mcl.sensor.descriptors.registry")
            for text in getattr(channels, "BROKEN", ()):  # of the user's own
                typer.echo(text, err=True)
            return super().invoke(ctx)


class CommandList(TyperGroup):
    """Commands by name, imported when they are called; below a family's name those of that family."""

    @property
    def _listed(self) -> dict[str, Listed]:
        family = self.name if self.name in FAMILIES else ""
        if not family:
            return COMMANDS
        return {name.split()[1]: command for name, command in COMMANDS.items() if name.split()[0] == family}

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the names, including those of the families."""
        return list(dict.fromkeys(name.split()[0] for name in self._listed))

    def get_command(self, ctx: Any, name: str) -> Any:
        """Import the command of that name; None where there is none."""
        listed = self._listed.get(name)
        if listed is not None:
            return load(listed)
        if self.name in FAMILIES or name not in FAMILIES:
            return None
        return CommandList(name=name, help=FAMILIES[name], no_args_is_help=True, rich_markup_mode=None)

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Find the command of the first word. If there is none, a usage error suggests one."""
        if args[0] not in self.list_commands(ctx) and not ctx.resilient_parsing:  # completion asks so
            ctx.fail(f"there is no command {args[0]!r}; {_nearest(args[0], self.list_commands(ctx))}")
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the commands by group, without importing them."""
        width = max(map(len, self._listed))
        for group in GROUPS:
            rows = [
                (f"{name:{width}}", command.what)
                for name, command in self._listed.items()
                if command.group == group
            ]
            if rows:
                with formatter.section(group):
                    formatter.write_dl(rows)


class ReplayByDefault(CommandList):
    """`maurice-replay SESSION` is `maurice-replay replay SESSION`, with options before or after.

    `maurice-replay help COMMAND` is `maurice-replay COMMAND --help`.
    """

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the names of all commands, and `help`."""
        return [*super().list_commands(ctx), HELP]

    def get_command(self, ctx: Any, name: str) -> Any:
        """Import the command of that name; `help` is an empty one, for the completion of its name."""
        return TyperCommand(HELP) if name == HELP else super().get_command(ctx, name)

    def main(self, *args: Any, **how: Any) -> Any:
        """Run; control characters in what is printed, also by a usage error, are shown as marks."""
        _join_pairs_of_bash()
        with visible_output():
            try:
                return super().main(*args, **how)
            except OSError as problem:  # of the output itself: a help page on a full disk
                typer.echo(f"maurice-replay: cannot print: {problem.strerror or problem}", err=True)
                sys.exit(1)

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Put `replay` in front of what is neither a command nor an option of the app's own."""
        if args[:1] == [HELP]:
            args = [*args[1:], "--help"]
        if args and args[0] not in OWN_OPTIONS and args[0] not in self.list_commands(ctx):
            word = args[0]  # neither an option, an address nor a file: a mistyped command, probably
            is_path = word.startswith("-") or "://" in word or Path(word).exists()
            if not is_path and not ctx.resilient_parsing:
                nearest = _nearest(word, self.list_commands(ctx))
                fail(f"{word}: there is no session or command of that name; {nearest}")
            args = ["replay", *args]
        return super().parse_args(ctx, args)


def _join_pairs_of_bash() -> None:
    """Let KEY=VALUE be one word of the line to complete: bash makes three of it."""
    line = os.environ.get("COMP_WORDS", "")
    joined = re.sub(r" ?= ?", "=", line)
    if joined != line and os.environ.get("_MAURICE_REPLAY_COMPLETE") == "complete_bash":
        words = len(line.split(" ")) - len(joined.split(" "))
        os.environ |= {"COMP_WORDS": joined, "COMP_CWORD": str(int(os.environ["COMP_CWORD"]) - words)}


def _nearest(word: str, commands: list[str]) -> str:
    matches = difflib.get_close_matches(word, commands, n=1)
    return f"did you mean the command {matches[0]}?" if matches else "maurice-replay --help lists commands"


def load(listed: Listed) -> TyperCommand:
    """Import a command."""
    name = listed.name.split()[-1]
    callback = getattr(import_module(f".{listed.module}", __package__), name.replace("-", "_"))
    info = CommandInfo(name=name, cls=PanelCommand, callback=with_options(callback))
    command = get_command_from_info(info, pretty_exceptions_short=False, rich_markup_mode=None)
    assert isinstance(command, TyperCommand)
    return command


def with_options(command: Callable[..., None]) -> Callable[..., None]:
    """Return a command in which every field of a dataclass among its arguments is an option of its own."""
    sets: dict[str, Any] = {}
    options: list[Parameter] = []
    for parameter in signature(command, eval_str=True).parameters.values():
        kind = parameter.annotation
        if is_dataclass(kind):
            sets[parameter.name] = kind
            hints = get_type_hints(kind, include_extras=True)
            options += [
                Parameter(
                    field.name, Parameter.KEYWORD_ONLY, default=field.default, annotation=hints[field.name]
                )
                for field in fields(kind)
            ]
        else:
            options.append(parameter.replace(kind=Parameter.KEYWORD_ONLY))

    def call(**values: Any) -> None:
        for name, kind in sets.items():
            values[name] = kind(**{field.name: values.pop(field.name) for field in fields(kind)})
        command(**values)

    call.__doc__ = command.__doc__
    call.__signature__ = Signature(options)  # type: ignore[attr-defined]  # what `signature` reads
    return call


app = typer.Typer(
    cls=ReplayByDefault,
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    help="Replay a robot session through vision-based Monte Carlo localization and look at every step in "
    "Rerun. `maurice-replay SESSION` is short for `maurice-replay replay SESSION`. Is the filter lost? "
    "`maurice-replay diagnose SESSION` says why.",
)


def _version(asked: bool) -> None:
    if asked:
        from importlib.metadata import version

        typer.echo(f"maurice-replay {version('maurice-replay')}")
        raise typer.Exit


@app.callback()
def _root(
    show_version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    """Read the options that precede a command."""
