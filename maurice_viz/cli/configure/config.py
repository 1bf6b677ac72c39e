"""`maurice-replay config show|check`: what is in force and where it came from, and checking a file."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from maurice_loaders.config_files import configuration_of, read_config, to_toml
from maurice_loaders.errors import InputError
from maurice_mcl.config.schema import Configuration, Setting
from maurice_mcl.filter.motion import MauriceParameters, OdometryParameters

from ..console import results
from ..errors import one_line_errors
from ..options import ConfigOption, JsonOption, PresetOption

config = typer.Typer(
    help="Show the configuration in force, or check a configuration file.", no_args_is_help=True
)

MOTION_MODELS: Mapping[str, Callable[[Mapping[str, Any]], object]] = {
    "maurice": MauriceParameters.from_header,
    "odometry": OdometryParameters.from_header,
}


@config.command()
def show(
    origin: Annotated[bool, typer.Option("--origin", help="Say where each value came from.")] = False,
    preset: PresetOption = None,
    file: ConfigOption = None,
    json_output: JsonOption = False,
) -> None:
    """Print what is in force as TOML that --config reads back."""
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
    """Say whether a configuration file is valid; the environment is left out."""
    with one_line_errors():
        values = configuration_of(None, file, {}, {}).values()
        _check_motion(file, values["motion"])
        count = len(read_config(file).values)
    results.print(f"{file}: valid, {count} {'value' if count == 1 else 'values'} set", soft_wrap=True)


def _as_json(found: Configuration, *, origin: bool) -> dict[str, Any]:
    def value(setting: Setting) -> Any:
        return {"value": setting.value, "origin": setting.origin} if origin else setting.value

    return {setting.key: value(setting) for setting in found.settings}


def _check_motion(file: Path, motion: Mapping[str, Any] | None) -> None:
    if motion is None:
        return
    model = motion.get("model", "maurice")
    if not isinstance(model, str) or model not in MOTION_MODELS:
        raise InputError(file, f"motion.model: found {model!r}, expected one of {', '.join(MOTION_MODELS)}")
    try:
        MOTION_MODELS[model](motion)
    except ValueError as problem:
        raise InputError(file, str(problem)) from None
