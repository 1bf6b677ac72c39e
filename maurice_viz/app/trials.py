"""Filters tried on drives with many seeds: a plan of trials from Python values."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from maurice_datasets.trials.engine import run_plan
from maurice_datasets.trials.plan import (
    MOST_SEEDS,
    Part,
    Plan,
    SessionSpec,
    Variant,
    Variants,
    configuration_of,
    reading_text,
)
from maurice_datasets.trials.table import TrialsResult, load_trials
from maurice_loaders.errors import InputError
from maurice_loaders.reading.options import Reading
from maurice_loaders.session_log.header import drive_name

from ..errors import SILENT, Listener, OptionError, progress_of
from ..running.filters import AnyFilter, Filter, filter_of, names_of, read_as_amcl, told_apart
from ..running.open import GLOBAL, open_library_for, open_session, preset_for, unique_labels

NAME = "trials"  # of the plan and its one part


def trials(
    session: str | Path | Sequence[str | Path],
    library: str | Path | None = None,
    filters: AnyFilter | Sequence[AnyFilter] = None,
    *,
    seeds: int = 20,
    reading: Reading | None = None,
    to: str | Path | None = None,
    workers: int | None = None,
    listener: Listener = SILENT,
) -> TrialsResult:
    """Run filters over a drive, or over several, with seeds 0, 1, 2, ..., on all cores (`workers`: so many).

    Each run is that of `replay` with the same filter and seed, but for scales that a replay fits to a drive
    whose pictures mislead (docs/trials.md). `to` is a folder that keeps the runs: the same call goes on with
    it, and adds `seeds`; `maurice-replay trials` and `trials_report` take it. All filters begin where the
    session says, or all anywhere.

    InputError for files that cannot be used, and where no run could be made; OptionError for filters that
    begin elsewhere or have a seed.

        >>> import maurice_viz as mv
        >>> few, more = mv.Filter(particles=50), mv.Filter(particles=100)
        >>> result = mv.trials("session.log", filters=[few, more], seeds=2)
        >>> result, result.paired(against="each")["against_label"].to_list()
        (TrialsResult(4 runs of particles 50, particles 100), ['particles 50'])
    """
    if isinstance(seeds, bool) or not isinstance(seeds, int) or not 1 <= seeds <= MOST_SEEDS:
        raise OptionError(f"seeds: found {seeds!r}, expected a whole number from 1 to {MOST_SEEDS:,}")
    paths = [Path(session)] if isinstance(session, (str, Path)) else [Path(path) for path in session]
    filter_list = [filters] if filters is None or isinstance(filters, (str, Filter)) else list(filters)
    if not paths or not filter_list:
        raise OptionError(f"found no {'filter' if paths else 'session'} to try")
    options, specs = read_as_amcl(paths[0], reading or Reading(), list(map(filter_of, filter_list)), listener)
    start = _start_of(specs)
    at = None if library is None else str(Path(library).resolve())
    for path in paths:  # a drive that cannot be used is refused before any run is made
        opened = open_session(path, options, listener)
        specs = preset_for(
            open_library_for(opened, None if at is None else Path(at), keep_going=False), specs
        )
    sessions = tuple(
        SessionSpec(
            label, path=str(path.resolve()), library=at or "", reading=reading_text(options), start=start
        )
        for label, path in zip(_names(paths), paths, strict=True)
    )
    labels = unique_labels([spec.label for spec in told_apart(specs)])
    listed = tuple(Variant(label, settings_of(spec)) for label, spec in zip(labels, specs, strict=True))
    part = Part(NAME, "filters on the same drives and seeds", sessions, Variants(listed=listed), seeds)
    plan = Plan(NAME, part.title, (part,))
    if to is not None:
        return _made(plan, Path(to), workers, listener)
    with TemporaryDirectory(prefix="maurice-trials-") as folder:
        return _made(plan, Path(folder), workers, listener)


def _made(plan: Plan, folder: Path, workers: int | None, listener: Listener) -> TrialsResult:
    """Make the runs that a folder does not hold yet. InputError where none could be made."""
    progress = progress_of(listener, NAME)
    outcome = run_plan(plan, folder, workers=workers or os.cpu_count() or 1, resume=True, progress=progress)
    runs = load_trials(folder).sort("variant", "session", "seed")
    if runs["error"].null_count() == 0:
        raise InputError(None, f"no run could be made: {outcome.error or runs['error'][0]}")
    if outcome.error is not None:
        listener.warning(f"{outcome.failed:,} of {plan.runs:,} runs failed, the first: {outcome.error}")
    return TrialsResult(runs)


def _start_of(specs: Sequence[Filter]) -> str:
    """Return where all runs begin, as a plan has it. OptionError."""
    for spec in specs:
        if spec.start not in (None, GLOBAL):
            expected = f'expected none, for that of the session, or "{GLOBAL}"'
            raise OptionError(f"start: found {spec.start!r}; {expected}")
        if spec.seed:
            raise OptionError(f"seed: found {spec.seed}, expected none: trials run with seeds from 0 on")
    starts = {spec.start for spec in specs}
    if len(starts) > 1:
        raise OptionError("start: found filters with different starts; compare them from the same one")
    return "anywhere" if starts == {GLOBAL} else ""


def _names(paths: Sequence[Path]) -> list[str]:
    """Return a name for each drive; drives of one name are told apart by their folders."""
    names = [drive_name(path) for path in paths]
    return unique_labels(names if len(set(names)) == len(names) else names_of(paths))


def settings_of(spec: Filter) -> dict[str, Any]:
    """Return a filter as a plan has it: preset and feature, and the settings that differ from these."""
    named = {"preset": spec.preset, "feature": spec.feature}
    settings: dict[str, Any] = {name: value for name, value in named.items() if value is not None}
    usual, values = configuration_of(settings).values(), spec.configuration().values()
    return settings | {key: value for key, value in values.items() if value != usual[key]}
