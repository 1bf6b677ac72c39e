"""`maurice-replay config`: the effective configuration, each value with its origin."""

from __future__ import annotations

import os

import typer

from maurice_loaders.config_files import check_config, configuration_of, to_toml

from ..running.filters import Filter
from .shared import options as opt
from .shared.console import TO_CONSOLE, print_json
from .shared.values import settings_of


def config(
    preset: opt.Preset = None,
    file: opt.Config = None,
    settings: opt.Set = None,
    json_output: opt.Json = False,
) -> None:
    """Print the effective configuration, each value with its origin, as TOML that --config can read.

    A file of --config that is not valid is one line and exit status 1.
    """
    if file is not None:
        check_config(file)
        amcl = Filter(config=file).amcl
        for text in () if amcl is None else amcl.remarks:
            TO_CONSOLE.remark(f"{file}: {text}")
    effective = configuration_of(preset, file, os.environ, settings_of(settings))
    if json_output:
        print_json(
            {
                setting.key: {"value": setting.value, "origin": setting.origin}
                for setting in effective.settings
            }
        )
    else:
        typer.echo(to_toml(effective, origins=True), nl=False)
