"""Options that several commands take, written once: a decorator puts them in place of one parameter."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Mapping, Sequence
from typing import Any

Command = Callable[..., None]
Options = Mapping[str, tuple[Any, Any]]  # by parameter name: what typer reads, and the default


def in_place_of(
    parameter: str,
    options: Options,
    gather: Callable[..., Any],
    command: Command,
    also: Sequence[str] = (),
) -> Command:
    """Give a command these options where one of its parameters stands, which then gets `gather(**typed)`.

    `also` names parameters of the command's own that are gathered as well, where it has them.
    """
    signature = inspect.signature(command, eval_str=True)

    @functools.wraps(command)
    def with_options(**given: Any) -> None:
        typed = {name: given.pop(name) for name in options}
        typed |= {name: given[name] for name in also if name in given}
        command(**given, **{parameter: gather(**typed)})

    keyword = inspect.Parameter.KEYWORD_ONLY
    shared = [
        inspect.Parameter(name, keyword, default=default, annotation=kind)
        for name, (kind, default) in options.items()
    ]
    parameters: list[inspect.Parameter] = []
    for one in signature.parameters.values():
        parameters += shared if one.name == parameter else [one.replace(kind=keyword)]
    with_options.__signature__ = signature.replace(parameters=parameters)  # type: ignore[attr-defined]  # what typer reads
    with_options.__annotations__ = {one.name: one.annotation for one in parameters}
    return with_options
