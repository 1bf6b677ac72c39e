"""Parts of a filter that a user writes: functions, classes and objects, by module, name and source hash.

Settings hold names. A part of the user has the name `module:name@hash`, so that configurations, saved runs
and trials tell it like any other setting, and another part under the same name is refused.
"""

from __future__ import annotations

import inspect
import sys
from collections.abc import Callable, Iterable, Mapping
from hashlib import sha256
from importlib import import_module
from itertools import chain
from pathlib import Path
from types import CodeType
from typing import Any

import numpy as np

from ..errors import InputError
from .setting_rules import Rule, expected_one_of

ANY_ERROR = (Exception, SystemExit)  # other people's code may raise anything, and may end as a script does
HASH_DIGITS = 12
DEEPEST = 6  # levels of an object that are hashed
_GIVEN: dict[str, Any] = {}  # by name: the parts that this process was given as objects


def is_own(name: str) -> bool:
    """Return whether the name of a part is that of a user's: `module:name`, with or without a hash."""
    module, colon, rest = name.partition(":")
    return bool(colon and module and rest.partition("@")[0])


def name_of(part: Any) -> str:
    """Return the name of a function, a class or an object, `module:name@hash`, by which `own_part` finds it.

    That of a script is a module named after its file: where that can be imported, so can the part.
    """
    kind = part if isinstance(part, type) or inspect.isroutine(part) else type(part)
    module = kind.__module__
    if module == "__main__":
        module = Path(getattr(sys.modules["__main__"], "__file__", None) or module).stem
    digest = sha256("\n".join(_told(part, DEEPEST)).encode()).hexdigest()[:HASH_DIGITS]
    name = f"{module}:{kind.__qualname__}@{digest}"
    _GIVEN[name] = part
    return name


def given_parts(settings: Any) -> dict[str, Any]:
    """Return the parts that this process was given, and settings name, to send them to another process."""
    if isinstance(settings, str):
        return {settings: _GIVEN[settings]} if settings in _GIVEN else {}
    inner = settings.values() if isinstance(settings, Mapping) else settings
    if not isinstance(settings, (Mapping, list, tuple)):
        return {}
    return {name: part for value in inner for name, part in given_parts(value).items()}


def give_parts(parts: Mapping[str, Any]) -> None:
    """Make parts known that another process was given, by their names (`given_parts`)."""
    _GIVEN.update(parts)


def own_part(what: str, name: str) -> Any:
    """Return the part of a name. ValueError if it is not available, or its source has changed.

    `what` it is goes into the message, such as "resampler".
    """
    if name in _GIVEN:
        return _GIVEN[name]
    spelled, _, digest = name.partition("@")
    part = _imported(what, spelled)
    now = name_of(part)
    if digest and now != name and isinstance(part, type):
        part = made(what, part)  # it may have been given as an object
        now = name_of(part)
    if digest and now != name:
        fault = f"found the source {now.partition('@')[2]}, expected {digest}"
        advice = "it was changed, or made with other values: restore it, or make it in the script that asks"
        raise ValueError(f"{what} {spelled}: {fault}; {advice}")
    return part


def _imported(what: str, spelled: str) -> Any:
    module, _, path = spelled.partition(":")
    if not all(word.isidentifier() for word in (*module.split("."), *path.split("."))):
        advice = "give the object itself, or run this where it is made"
        raise ValueError(f"{what} {spelled}: is not at hand in this process; {advice}")
    try:
        part: Any = import_module(module)
    except ModuleNotFoundError as problem:
        advice = "put its folder on PYTHONPATH"
        raise ValueError(f"{what} {spelled}: no module named {problem.name!r}; {advice}") from problem
    except ANY_ERROR as problem:
        raise ValueError(f"{what} {spelled}: its module raised {told(problem)}") from problem
    for word in path.split("."):
        if not hasattr(part, word):
            raise ValueError(f"{what} {spelled}: found no {word} in the module {module}")
        part = getattr(part, word)
    return part


def made(what: str, part: Any) -> Any:
    """Return a part ready for use: of a class, an object made without arguments. ValueError if that fails."""
    if not isinstance(part, type):
        return part
    try:
        return part()
    except ANY_ERROR as problem:
        raise ValueError(f"{what} {part.__qualname__}: making it raised {told(problem)}") from problem


def _told(value: Any, levels: int) -> Iterable[str]:
    """Yield texts that differ where two parts do: their sources, and the values that they hold."""
    if levels == 0:
        return
    inner: Iterable[Any] = ()
    if isinstance(value, np.ndarray):
        yield f"{value.dtype} {value.shape} {sha256(np.ascontiguousarray(value).data).hexdigest()}"
    elif isinstance(value, Mapping):
        inner = chain.from_iterable(value.items())
    elif isinstance(value, (list, tuple)):
        inner = value
    elif isinstance(value, type) or inspect.isroutine(value):
        yield _source_of(value)
        cells = getattr(value, "__closure__", None) or ()
        inner = [*(cell.cell_contents for cell in cells), *(getattr(value, "__defaults__", None) or ())]
    elif type(value).__module__ == "builtins" or isinstance(value, np.generic):
        yield repr(value)
    else:
        yield _source_of(type(value))
        slots = getattr(type(value), "__slots__", ())
        inner = [getattr(value, "__dict__", {}), [getattr(value, name, None) for name in slots]]
    for part in inner:
        yield from _told(part, levels - 1)


def _source_of(part: Any) -> str:
    """Return the text of a function or class; of one without a text or a name, what it compiles to."""
    code = getattr(part, "__code__", None)
    try:
        source = "" if part.__name__ == "<lambda>" else inspect.getsource(part)
    except (OSError, TypeError):  # typed into an interpreter, built in, or compiled
        source = ""
    return source or f"{part.__qualname__} {_compiled(code) if isinstance(code, CodeType) else ''}"


def _compiled(code: CodeType) -> str:
    constants = [_compiled(value) if isinstance(value, CodeType) else repr(value) for value in code.co_consts]
    return f"{code.co_code.hex()} {constants} {code.co_names}"


def own_or(what: str, known: Iterable[str]) -> Rule:
    """Accept one of several words, or a part of the user's: an object, or its name `module:name`."""
    words = tuple(known)

    def rule(key: str, value: Any) -> str:
        if not isinstance(value, str):
            return _name(key, what, value)
        if value in words or (is_own(value) and "@" in value):  # of a saved run: found when a filter is made
            return value
        if is_own(value):
            return _name(key, what, own_part(what, value))
        raise ValueError(f"{key}: found {value!r}, {expected_one_of(value, words)}; or module:name, yours")

    return rule


def _name(key: str, what: str, part: Any) -> str:
    if not callable(part):
        raise ValueError(f"{key}: found {part!r:.60}, expected a name, or a {what}: a function or a class")
    return name_of(part)


def called(name: str, function: Callable[..., Any], *given: Any) -> Any:
    """Return what a user's function returns. InputError of one line for what it raises."""
    try:
        return function(*given)
    except ANY_ERROR as problem:
        raise InputError(None, f"{name} raised {told(problem)}") from problem


def told(problem: BaseException) -> str:
    """Return an error's kind and text."""
    return f"{type(problem).__name__}: {problem}"
