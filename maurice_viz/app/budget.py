"""The error budget of a session, or of a folder of trials: which part of a filter costs most."""

from __future__ import annotations

from pathlib import Path

from maurice_datasets.trials.budget import BudgetDrive, ErrorBudget, budget_of
from maurice_datasets.trials.folder import TrialsFolder
from maurice_datasets.trials.rows import is_trials
from maurice_loaders.errors import InputError
from maurice_loaders.reading.options import Reading
from maurice_loaders.reading.session import RecordedSession
from maurice_mcl.values import Library

from ..errors import SILENT, Listener, OptionError, progress_of
from ..running.filters import AnyFilter, Filter, filter_of, read_as_amcl
from ..running.open import make_runs, open_library_for, open_session

MOST_DRIVES = 10  # of a folder of trials
WORKING = "error budget"


def error_budget(
    source: str | Path | RecordedSession,
    library: str | Path | Library | None = None,
    filter: AnyFilter = None,  # noqa: A002
    *,
    reading: Reading | None = None,
    seeds: int = 5,
    listener: Listener = SILENT,
) -> ErrorBudget:
    """Run a filter with true movements, with a perfect sensor, with dense references, with 100,000 particles.

    `source` is a session with truth, which is run with `seeds` seeds, or a folder of `trials run`: of
    it, the first part's first filter over ten of its drives. The other arguments are those of `replay`.
    InputError for a session without truth.

        >>> import maurice_viz as mv
        >>> budget = mv.error_budget("session.log", filter=mv.Filter(particles=50), seeds=2)
        >>> [share.part for share in budget.parts][:2]
        ['as it is', 'true movements']
    """
    options = reading or Reading()
    spec = filter_of(filter)
    if isinstance(source, (str, Path)) and is_trials(Path(source)):
        if library is not None or spec != Filter() or options != Reading():
            raise OptionError(f"{source} holds trials: their filter is used, no option of a filter applies")
        return _of_trials(Path(source), listener)
    options, (spec,) = read_as_amcl(source, options, [spec], listener)
    session = open_session(source, options, listener)
    library_or_path = Path(library) if isinstance(library, str) else library
    references = open_library_for(session, library_or_path, keep_going=options.keep_going, listener=listener)
    (run,) = make_runs(session, references, [spec], listener)
    localizer = run.localizer.of_session(session)
    drive = BudgetDrive.of(localizer, session, run.start, range(seeds), 0)
    if not any(moment.truth is not None for moment in drive.runs.moments):
        raise InputError(session.path, "found no truth; an error budget is made from the errors")
    advance = progress_of(listener, WORKING)
    return budget_of(session.info.name, run.label, session.info.display_units, [drive], advance)


def _of_trials(folder: Path, listener: Listener) -> ErrorBudget:
    trials = TrialsFolder(folder)
    first = trials.rows.row(0, named=True)
    rows = trials.part(first["part"], session=first["session"], variant=first["variant"])
    chosen = rows.sort("seed").head(MOST_DRIVES)
    seeds = {row["seed"]: [row["seed"]] for row in chosen.iter_rows(named=True)}
    if first["arena"] is None:  # seeds of one recorded drive
        chosen, seeds = chosen.head(1), {chosen["seed"][0]: chosen["seed"].to_list()}
    drives = []
    for row in chosen.iter_rows(named=True):
        drive, localizer = trials.drive_of(row), trials.localizer_of(row)
        of_row = localizer, drive.session, drive.start, seeds[row["seed"]], row["arena"] or 0
        drives.append(BudgetDrive.of(*of_row))
    label, units = f"{first['part']}, {first['label']}", drive.session.info.display_units
    return budget_of(folder.name, label, units, drives, progress_of(listener, WORKING))
