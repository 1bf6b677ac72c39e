"""The error that bad input raises, in every package: one line that a person can act on."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import is_dataclass
from functools import cache, wraps
from importlib import import_module
from inspect import getsource, isfunction, signature
from pathlib import Path
from textwrap import indent
from typing import Any

MOST_CHARACTERS = 2000  # of a message


class InputError(Exception):
    """Input that is not what it should be: what was found, where, what was expected, what to do.

    `str()` is one line: `session.log:17: found ..., expected ...; what to do`.

        >>> import maurice_mcl as mcl
        >>> str(mcl.InputError(None, "particles: found -1, expected a whole number from 1 to 10000000"))
        'particles: found -1, expected a whole number from 1 to 10000000'
    """

    def __init__(self, file: Path | None, message: str, line: int | None = None) -> None:
        """Take the file (None for values from no file) and the line, counted from 1."""
        message = " ".join(message.splitlines())  # one line, whatever names and system messages contain
        if len(message) > MOST_CHARACTERS:  # of a value that was found
            message = f"{message[: MOST_CHARACTERS // 2]} ... {message[-MOST_CHARACTERS // 2 :]}"
        place = f"{file or ''}" if line is None else f"{file}:{line}"
        super().__init__(f"{place}: {message}" if place else message)
        self.file = file
        self.line = line  # None when the error concerns the entire file
        self.message = message

    def __reduce__(self) -> tuple[Any, ...]:
        """Let the error come back from a worker process: subclasses take other arguments than `args`."""
        return _again, (type(self), self.args), self.__dict__


def _again(kind: type[InputError], args: tuple[Any, ...]) -> InputError:
    error = kind.__new__(kind, *args)
    error.args = args
    return error


# The front page of every package: where names and paths enter.


FrontPage = tuple[list[str], Callable[[str], Any], Callable[[], list[str]]]
_SHOWN = re.compile(r"^    from ([\w.]+) import (\w+) as \2$", re.MULTILINE)


def front_page(package: str) -> FrontPage:
    """Return `__all__`, `__getattr__` and `__dir__` of a package whose names are imported when first used.

    They are the names that its front page imports for type checkers, the one list of them.
    """
    homes = {name: module for module, name in _SHOWN.findall(getsource(sys.modules[package]))}
    names = sorted(homes)

    def lookup(name: str) -> Any:
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return public(getattr(import_module(homes[name], package), name))

    return names, lookup, lambda: names


def public(value: Any) -> Any:
    """Return a function of a front page so that names and paths which no system takes are an InputError.

    So are all errors of the system, such as a path that is too long. Messages, which name options of the
    command line, name parameters here. Other values are returned unchanged.
    """
    if isinstance(value, type) and is_dataclass(value):
        _explain_fields(value)
    return _checked(value) if isfunction(value) else value


@cache
def _explain_fields(kind: type) -> None:
    """Add the fields to a class's docstring, each with the comment beside it: `help` shows them so."""
    lines = [match.groups() for match in _FIELD.finditer(getsource(kind)) if match[1][0] != "_"]
    if lines and kind.__doc__:
        listing = "\n".join(f"    {name}: {comment}" for name, comment in lines)
        kind.__doc__ = f"{kind.__doc__.rstrip()}\n\n    Fields:\n\n{indent(listing, '    ')}\n    "


_FIELD = re.compile(r"^    (\w+): [^\n#]*  # ([^\n]+)$", re.MULTILINE)


@cache
def _checked(function: Callable[..., Any]) -> Callable[..., Any]:
    names = list(signature(function).parameters)

    @wraps(function)
    def checked(*args: Any, **named: Any) -> Any:
        for name, argument in [*zip(names, args, strict=False), *named.items()]:
            for text in _texts(argument):
                _expect_usable(name, text)
        try:
            return function(*args, **named)
        except OSError as problem:
            where = _short(str(problem.filename)) + ": " if problem.filename else ""
            raise InputError(None, f"{where}{problem.strerror or problem}; check the path") from problem
        except InputError as problem:
            problem.message = by_parameters(problem.message)
            problem.args = tuple(by_parameters(str(text)) for text in problem.args)
            raise

    return checked


# Parameters that are called otherwise than their option.
PARAMETERS = {
    "from": "from_step",
    "map": "map_file",
    "max-error": "max_error_m",
    "output": "to",
    "set": "settings",
    "yaw": "yaw_rad",
}
_VALUE = r"(?: (?=truth|tracking|global|none|[A-Z0-9]))?"  # what follows is what the option is set to
_OPTION = re.compile(rf"maurice-replay [^;]*|--reading (\w+)=([^\s,;]+)|--([a-z][a-z-]*){_VALUE}")


def by_parameters(text: str) -> str:
    """Return a message in which parameters replace options, but in a command to type.

    >>> by_parameters("name one with --library; maurice-replay inspect --json")
    'name one with library=; maurice-replay inspect --json'
    >>> by_parameters("give --reading plane=xz")
    'give reading=Reading(plane=xz)'
    """
    return _OPTION.sub(_parameter, text)


def _parameter(match: re.Match[str]) -> str:
    key, value, option = match.groups()
    if key is not None:
        return f"reading=Reading({key}={value})"
    return match[0] if option is None else f"{PARAMETERS.get(option, option.replace('-', '_'))}="


def _texts(value: Any) -> Iterator[str]:
    """Yield a text or path, and those in a list or mapping."""
    if isinstance(value, (str, Path)):
        yield str(value)
    elif isinstance(value, Mapping):
        yield from (text for pair in value.items() for part in pair for text in _texts(part))
    elif isinstance(value, (list, tuple, set, frozenset)):
        yield from (text for part in value for text in _texts(part))


def _expect_usable(name: str, text: str) -> None:
    try:
        usable = b"\0" not in os.fsencode(text)
    except UnicodeEncodeError:
        usable = False
    if not usable:
        raise InputError(
            None, f"{name}: found {_short(repr(text))}, expected whole characters, none of them NUL"
        )


def _short(text: str) -> str:
    return text if len(text) <= 60 else f"{text[:57]}..."
