"""The command `maurice-replay`: the one list of its commands, each imported when it is called."""

from __future__ import annotations

import difflib
import os
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from importlib import import_module
from inspect import Parameter, Signature, signature
from pathlib import Path
from typing import Annotated, Any, get_args, get_type_hints

import typer
from typer.core import TyperCommand, TyperGroup
from typer.main import get_command_from_info
from typer.models import CommandInfo

from .shared.errors import errors_end_the_command, fail, stop_by_exception
from .shared.visible import visible_output


@dataclass(frozen=True, slots=True)
class Listed:
    """A command as the list has it: the function of its last word in a module of this package."""

    name: str  # one word, or two of a group of commands: "library build"
    module: str
    what: str  # one line
    page: str = ""  # of the documentation, about it
    first: bool = False  # whether it stands on the first page of the help


COMMANDS = {
    command.name: command
    for command in (
        Listed("replay", "replay", "Replay a session, a saved run or a live source.", first=True),
        Listed("demo", "replay", "Replay a simulated kidnapping; needs no recording.", "tutorial", True),
        Listed("compare", "replay", "Replay two to four runs side by side.", "explain", True),
        Listed("drive", "drive", "Drive the simulated robot yourself, live.", "simulate", True),
        Listed("inspect", "recordings", "List what a recording or a saved run holds.", "formats", True),
        Listed("doctor", "recordings", "Find what is wrong in a recording, and the fix.", "doctor", True),
        Listed("diagnose", "runs", "Say why a filter was lost.", "diagnose", True),
        Listed("explain", "runs", "Explain one step of a saved run.", "explain", True),
        Listed("report", "runs", "Write one page about a saved run.", "share", True),
        Listed("what-if", "runs", "Branch a saved run with a change; rank remedies.", "what-if"),
        Listed("check", "check", "Test whether a filter meets demands on drives, for CI.", "trials"),
        Listed("budget", "runs", "Find the part of a filter that costs most accuracy.", "what-if"),
        Listed("verify", "replay", "Filter a saved run again: is it the same to the bit?", "saved-runs"),
        Listed("open", "replay", "Open a Rerun recording or a saved run in the viewer."),
        Listed("snapshot", "runs", "Take a picture or a movie.", "share"),
        Listed("export", "convert", "Write a saved run for other tools.", "share"),
        Listed("convert", "convert", "Write a recording as a log or as MCAP.", "share"),
        Listed("record", "convert", "Record a live source into a session log.", "your-robot"),
        Listed("simulate", "simulate", "Simulate a drive and its survey.", "simulate"),
        Listed("survey", "simulate", "Survey a simulated world.", "simulate"),
        Listed("config", "config", "Show the effective configuration; check a file.", "configuration"),
        Listed("library build", "library", "Build a library of reference pictures.", "library"),
        Listed("library show", "library", "Show what a library holds.", "library"),
        Listed("library check", "library", "Find gaps, look-alikes, and what to add.", "library"),
        Listed("library tune", "library", "Tune channels to a library.", "library"),
        Listed("map build", "convert", "Build a laser's map from scans with true poses.", "library"),
        Listed("import pictures", "convert", "Make logs of pictures and poses.", "your-robot"),
        Listed("calibrate motion", "calibrate", "Fit the motion parameters.", "calibrate"),
        Listed("calibrate noise", "calibrate", "Measure the camera's noise floor.", "calibrate"),
        Listed("calibrate belief", "calibrate", "Check whether clouds hold the truth.", "lost-signal"),
        Listed("calibrate drive", "calibrate", "Fit the odometry's noise to drives.", "calibrate"),
        Listed("trials run", "trials", "Make many runs over drives, filters and seeds.", "trials"),
        Listed("trials table", "trials", "Print grouped figures with intervals.", "trials"),
        Listed("trials report", "trials", "Write one page about trials.", "trials"),
    )
}
FAMILIES = {
    "library": "Build, show, check or tune a library of reference pictures.",
    "map": "Build the map that a robot with a laser is localized on.",
    "import": "Turn other data into session and survey logs.",
    "calibrate": "Fit the motion model, the camera's noise and the belief.",
    "trials": "Make many runs, and print their figures or a page.",
}
ONE_SLASH = re.compile(r"(tcp|wss?):/?(?=[^/])")  # of an address; a path would lose the second one as well
HELP = "help"  # a command, for who does not know --help
OWN_OPTIONS = {"--help", "--version", "--install-completion", "--show-completion"}


def name_of(argument: Any) -> str:
    """Return what stands for an argument: SESSION, or SESSION... of which there may be several."""
    many = "..." if argument.nargs == -1 else ""
    return f"{(argument.metavar or argument.name.upper()).removesuffix('...')}{many}"


def help_record(parameter: Any, ctx: Any) -> tuple[str, str] | None:
    """Return how a parameter is typed and what it means, without words of Python; None if it is hidden."""
    record = parameter.get_help_record(ctx)
    if record is None:
        return None
    typed, text = record
    for pattern, words in AS_WORDS:
        text = pattern.sub(words, text)
    if parameter.param_type_name == "argument":
        return name_of(parameter), text.removesuffix("[required]").rstrip()
    return typed, text


AS_WORDS = (  # how Typer describes a value, and how we do
    (re.compile(r"(-?[\d.]+)<=x<=(-?[\d.]+)"), r"\1 to \2"),
    (re.compile(r"x>=(-?[\d.]+)"), r"at least \1"),
    (re.compile(r"\[default: \((.*?)\)"), r"[default: \1"),
    (re.compile(r"\] +\["), "; "),
)


class PanelCommand(TyperCommand):
    """A command whose help lists its options by panel, and whose errors end in one line."""

    def collect_usage_pieces(self, ctx: Any) -> list[str]:
        """Return the words of the usage: SESSION has to be there, [SESSION] may be."""
        arguments = [each for each in self.get_params(ctx) if each.param_type_name == "argument"]
        names = [name_of(each) if each.required else f"[{name_of(each)}]" for each in arguments]
        return ["[OPTIONS]", *names]

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write the arguments, then the options of each panel."""
        panels: dict[str, list[tuple[str, str]]] = {"Arguments": [], "Options": []}
        for parameter in self.get_params(ctx):
            record = help_record(parameter, ctx)
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
        """Write the commands, without importing them."""
        _write_rows(formatter, "Commands", {name: listed.what for name, listed in self._listed.items()})


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

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the first page: the main commands, the groups, and the names of the others."""
        formatter.write_usage(ctx.command_path, "[COMMAND] SESSION [OPTIONS]")
        self.format_help_text(ctx, formatter)
        alone = {name: listed for name, listed in COMMANDS.items() if " " not in name}
        _write_rows(
            formatter, "Commands", {name: listed.what for name, listed in alone.items() if listed.first}
        )
        _write_rows(formatter, "Groups, each of which lists its commands", FAMILIES)
        with formatter.section(f"More: `{ctx.command_path} {HELP} more`"):
            formatter.write_text(", ".join(name for name, listed in alone.items() if not listed.first))
        formatter.write_paragraph()
        formatter.write_text(f"Options of a command: `{ctx.command_path} COMMAND --help`. Of this one:")
        formatter.write_text("--version, --install-completion, --show-completion, --help")

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
            if len(args) == 2 and args[1] in TOPICS and not ctx.resilient_parsing:
                formatter = ctx.make_formatter()
                TOPICS[args[1]](formatter)
                typer.echo(formatter.getvalue().strip("\n"))
                raise typer.Exit
            topics = difflib.get_close_matches(args[1], TOPICS, n=1) if len(args) == 2 else []
            if topics and not difflib.get_close_matches(args[1], self.list_commands(ctx)):
                fail(f"{args[1]}: there is no such page; did you mean `help {topics[0]}`?")
            args = [*args[1:], "--help"]
        for word in args if not ctx.resilient_parsing else ():
            if (scheme := ONE_SLASH.match(word)) and not Path(word).exists():
                fail(f"{word}: expected two slashes, as in {scheme[1]}://{word[scheme.end() :]}")
        if args and args[0] not in OWN_OPTIONS and args[0] not in self.list_commands(ctx):
            word = args[0]  # neither an option, an address nor a file: a mistyped command, probably
            is_path = word.startswith("-") or "://" in word or "--follow" in args or Path(word).exists()
            if not is_path and not ctx.resilient_parsing:
                from maurice_loaders.files.paths import nearest_path

                path = nearest_path(Path(word))
                nearest = _nearest(word, self.list_commands(ctx), [] if path is None else [str(path)])
                fail(f"{word}: there is no session or command of that name; {nearest}")
            args = ["replay", *args]
        return super().parse_args(ctx, args)


def _write_rows(formatter: Any, title: str, rows: Mapping[str, str]) -> None:
    with formatter.section(title):
        formatter.write_dl([*rows.items()])


def _write_others(formatter: Any) -> None:
    """Write the commands that the first page of the help only names."""
    others = {
        name: command.what for name, command in COMMANDS.items() if not command.first and " " not in name
    }
    _write_rows(formatter, "More commands", others)


def _write_reading(formatter: Any) -> None:
    """Write the keys of --reading by group."""
    from maurice_loaders.reading.options import FIELDS

    from .shared.values import KEYS

    formatter.write_text("--reading KEY=VALUE, which may be repeated, says how a recording is read.")
    groups: dict[str, dict[str, str]] = {}
    for key, name in KEYS.items():
        meaning = FIELDS[name]
        choices = f" One of {', '.join(meaning.choices)}." if meaning.choices else ""
        groups.setdefault(meaning.group.capitalize(), {})[key] = meaning.text + choices
    for title, rows in groups.items():
        _write_rows(formatter, title, rows)


TOPICS = {"more": _write_others, "reading": _write_reading}  # of `maurice-replay help`


def _join_pairs_of_bash() -> None:
    """Let KEY=VALUE be one word of the line to complete: bash makes three of it."""
    line = os.environ.get("COMP_WORDS", "")
    joined = re.sub(r" ?= ?", "=", line)
    if joined != line and os.environ.get("_MAURICE_REPLAY_COMPLETE") == "complete_bash":
        words = len(line.split(" ")) - len(joined.split(" "))
        os.environ |= {"COMP_WORDS": joined, "COMP_CWORD": str(int(os.environ["COMP_CWORD"]) - words)}


def _nearest(word: str, commands: Sequence[str], paths: Sequence[str] = ()) -> str:
    matches = difflib.get_close_matches(word, [*paths, *commands], n=1)
    if not matches:
        return "maurice-replay --help lists commands"
    return f"did you mean {matches[0]}?" if matches[0] in paths else f"did you mean the command {matches[0]}?"


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
    for option in options:
        _name_value(option.annotation)

    def call(**values: Any) -> None:
        for name, kind in sets.items():
            values[name] = kind(**{field.name: values.pop(field.name) for field in fields(kind)})
        command(**values)

    call.__doc__ = command.__doc__
    call.__signature__ = Signature(options)  # type: ignore[attr-defined]  # what `signature` reads
    return call


VALUES = ((int, "N"), (float, "X"), (Path, "PATH"))  # what stands for an option's value that has no name


def _name_value(annotation: Any) -> None:
    kind, info = get_args(annotation)
    kinds = {each for outer in (kind, *get_args(kind)) for each in (outer, *get_args(outer))}
    words = [word for python, word in VALUES if python in kinds]
    if info.metavar is None and words:
        info.metavar = words[0]


app = typer.Typer(
    cls=ReplayByDefault,
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    help="Replay a robot's recording through Monte Carlo localization, and see every step in the Rerun "
    "viewer. A SESSION without a command is replayed.",
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
