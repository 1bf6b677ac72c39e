"""In what runs differ: exactly one kind of option is given several times, and names the runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import typer

from .compare import COLOR_AND_BLENDED
from .opening import Wanted

Given = Mapping[str, Sequence[Any]]  # by the names of Wanted's fields, what was typed of each option

KINDS = "--feature, --preset, --resampler, --seed and --config"


def wanted_runs(given: Given) -> list[Wanted]:
    """Give a run for each value of the one option that is given several times; the others hold for all.

    Without any such option and without a feature, color and blended are compared. A usage error for others.
    """
    several = [kind for kind, values in given.items() if len(values) > 1]
    if len(several) > 1:
        words = " and ".join(f"--{kind}" for kind in several)
        raise typer.BadParameter(f"{words} are given several times; give exactly one option several times")
    if not several and given["feature"]:
        raise typer.BadParameter(f"found 1 run to compare; give one of {KINDS} several times")
    kind = several[0] if several else "feature"
    values = given[kind] if several else COLOR_AND_BLENDED
    common = {name: typed[0] for name, typed in given.items() if typed and name != kind}
    named = zip(values, _names(kind, values), strict=True)
    return [Wanted(**common, **{kind: value}, name=name) for value, name in named]


def one_filter(given: Given) -> Wanted:
    """Give the filter that several sessions are replayed with. A usage error where there would be several."""
    for kind, values in given.items():
        if len(values) > 1:
            raise typer.BadParameter(f"sessions are compared with one filter; give --{kind} once")
    return Wanted(**{kind: values[0] for kind, values in given.items() if values})


def _names(kind: str, values: Sequence[Any]) -> list[str]:
    if kind == "config":
        return names_of([value.with_suffix("") for value in values])
    return [f"seed {value}" if kind == "seed" else str(value) for value in values]


def names_of(paths: Sequence[Path]) -> list[str]:
    """Name paths by the last part in which they differ, and as many before it as tell them apart.

    `a/session` and `b/session` are "a" and "b". What cannot be told apart (the same path twice) keeps one
    name; `unique_labels` numbers those.
    """
    whole = [path.absolute().parts[1:] for path in paths]
    different = len(set(whole))
    typed = [tuple(part for part in path.parts if part not in (path.anchor, "..")) for path in paths]
    parts = typed if all(typed) and len(set(typed)) == different else whole
    while different > 1 and min(map(len, parts)) > 1 and len({one[-1] for one in parts}) == 1:
        parts = [one[:-1] for one in parts]
    depths = range(1, max(map(len, parts)) + 1)
    named = ([" ".join(one[-depth:]) for one in parts] for depth in depths)
    return next(names for names in named if len(set(names)) == different)
