"""`maurice-replay config show|check`: show the effective configuration and its origin, or check a file."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

from maurice_loaders.config_files import check_config, configuration_of, to_toml

from .shared import options as opt
from .shared.console import print_json, results


def show(
    preset: opt.Preset = None,
    file: opt.Config = None,
    json_output: opt.Json = False,
) -> None:
    """Print the effective configuration, each value with its origin, as TOML that --config can read."""
    found = configuration_of(preset, file, os.environ, {})
    if json_output:
        print_json({one.key: {"value": one.value, "origin": one.origin} for one in found.settings})
    else:
        typer.echo(to_toml(found, origins=True), nl=False)


def check(file: Annotated[Path, opt.argument("FILE", "A configuration file.")]) -> None:
    """Check whether a configuration file is valid; the environment is left out."""
    count = check_config(file)
    results.print(f"{file}: valid, {count} {'value' if count == 1 else 'values'} set", soft_wrap=True)
