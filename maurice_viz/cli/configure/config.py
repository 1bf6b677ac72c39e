"""`maurice-replay config show|check`: the configuration in force and its origin, and checking a file."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Annotated, Any

import typer

from maurice_loaders.config_files import check_config, configuration_of, to_toml
from maurice_mcl.config.parameters import Configuration, Setting

from ..console import results
from ..errors import one_line_errors
from ..options import ConfigOption, JsonOption, PresetOption

config = typer.Typer(
    help="Show the configuration in force, or check a configuration file.", no_args_is_help=True
)


@config.command()
def show(
    origin: Annotated[bool, typer.Option("--origin", help="Show where each value comes from.")] = False,
    preset: PresetOption = None,
    file: ConfigOption = None,
    json_output: JsonOption = False,
) -> None:
    """Print the configuration in force as TOML that --config reads back."""
    with one_line_errors():
        found = configuration_of(preset, file, os.environ, {})
    if json_output:
        results.print_json(json.dumps(_as_json(found, origin=origin), default=str))
    else:
        typer.echo(to_toml(found, origins=origin), nl=False)


@config.command()
def check(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A configuration file.", show_default=False)],
) -> None:
    """Check whether a configuration file is valid; the environment is left out."""
    with one_line_errors():
        count = check_config(file)
    results.print(f"{file}: valid, {count} {'value' if count == 1 else 'values'} set", soft_wrap=True)


def _as_json(found: Configuration, *, origin: bool) -> dict[str, Any]:
    def value(setting: Setting) -> Any:
        return {"value": setting.value, "origin": setting.origin} if origin else setting.value

    return {setting.key: value(setting) for setting in found.settings}
