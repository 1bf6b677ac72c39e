"""The gate: whether a filter does on drives what is demanded of it, with many seeds, no worse than before."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from maurice_loaders.files.writing import expect_absent, write_whole
from maurice_loaders.reading.options import Reading
from maurice_loaders.reading.session import RecordedSession
from maurice_mcl.scoring.demands import Demands
from maurice_mcl.values import Library, Plain

from ...errors import SILENT, Listener, OptionError
from ...running.filters import AnyFilter, filter_of
from ...running.output import by_suffix
from .drive import CheckedFilter, DriveCheck, check_drive
from .failure import expect_new_artifacts
from .rules import LEAST_PAIRS, baseline_bytes, read_baseline

MOST_SEEDS = 10_000
NOTHING_DEMANDED = Demands()
WRITTEN = (".xml", ".parquet", "")  # JUnit, a baseline, a folder of artifacts: endings of what is written


@dataclass(frozen=True, slots=True, eq=False)
class CheckResult(Plain):
    """Whether a filter passed, drive by drive.

    >>> import maurice_viz as mv
    >>> demands = mv.Demands(max_error_m=0.3, localized_by=5)
    >>> result = mv.check("session.log", filter=mv.Filter(particles=50), demands=demands)
    >>> result.passed, [demand.title for demand in result.drives[0].demands]
    (True, ['localized by step 5', 'not lost from then on', 'mean error at most 0.3 m'])
    """

    also = ("passed",)
    drives: tuple[DriveCheck, ...]

    @property
    def passed(self) -> bool:
        """Whether every drive passed."""
        return all(drive.passed for drive in self.drives)

    def to_junit(self) -> str:
        """Return JUnit XML: a suite for each drive, a test case for each demand."""
        return junit_xml(self.drives)


def check(
    session: str | Path | RecordedSession | Sequence[str | Path],
    library: str | Path | Library | None = None,
    filter: AnyFilter = None,  # noqa: A002
    *,
    demands: Demands = NOTHING_DEMANDED,
    seeds: int = 1,
    reading: Reading | None = None,
    against: str | Path | None = None,
    to: str | Path | Sequence[str | Path] = (),
    force: bool = False,
    listener: Listener = SILENT,
) -> CheckResult:
    """Test whether a filter does on a drive, or on several, what is demanded of it, with seeds 0, 1, 2, ...

    Each of the `demands` holds where enough of the runs meet it. `against` is a baseline that an earlier call
    wrote: fails where errors grew or rates fell, by paired seeds. `to` is what to write, by its ending: .xml,
    the result as JUnit; .parquet, a baseline; none, a folder for why a run failed and a recording of it. The
    filter is chosen as in `replay`.

    Raises InputError for files that cannot be used and drives without the truth that a demand needs,
    OptionError for demands that make no sense. A check that fails raises nothing: see `passed`.

        >>> import maurice_viz as mv
        >>> mv.check("session.log", demands=mv.Demands(max_error_m=0.001), seeds=2).passed
        False
    """
    spec, files = filter_of(filter), by_suffix([to] if isinstance(to, (str, Path)) else to, WRITTEN)
    junit, save_baseline, folder = map(files.get, WRITTEN)
    _expect_sense(demands, seeds, against is not None, save_baseline is not None)
    for file in (save_baseline, junit):
        if file is not None:
            expect_absent(file, force=force)
    if folder is not None:
        expect_new_artifacts(folder, force=force)
    baseline = None if against is None else read_baseline(Path(against))
    at = Path(library) if isinstance(library, str) else library
    checked_filter = CheckedFilter(spec, at, demands, seeds, baseline, folder, reading or Reading())
    drives = [session] if isinstance(session, (str, Path, RecordedSession)) else session
    result = CheckResult(_checked(checked_filter, drives, listener))
    if junit is not None:
        _write(junit, result.to_junit().encode(), force)
    if save_baseline is not None:
        _write(save_baseline, baseline_bytes(drive.made for drive in result.drives), force)
    return result


def _write(file: Path, data: bytes, force: bool) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    write_whole(file, data, force=force)


def _checked(
    asked: CheckedFilter, sessions: Sequence[str | Path | RecordedSession], listener: Listener
) -> tuple[DriveCheck, ...]:
    if not sessions:
        raise OptionError("found no session to check")
    drives: list[DriveCheck] = []
    for source in sessions:
        drives.append(check_drive(asked, source, [drive.session for drive in drives], listener))
    return tuple(drives)


def _expect_sense(demands: Demands, seeds: int, is_compared: bool, is_saved: bool) -> None:
    """Refuse demands that no run could meet, or that demand nothing. OptionError."""
    if not (demands.kinds or is_compared or is_saved):
        raise OptionError("nothing is demanded; give --max-error, --localized-by or --converged-by")
    if demands.max_error_m is not None and not 0 < demands.max_error_m < np.inf:
        raise OptionError(f"--max-error is a length above 0, found {demands.max_error_m:g} m")
    for name, value in (("localized", demands.localized_by), ("converged", demands.converged_by)):
        if value is not None and value < 1:
            raise OptionError(f"--{name}-by is a number of steps from 1, found {value}")
    if not 0 < demands.min_localized <= 1:
        raise OptionError(f"--min-localized is a rate above 0 and up to 1, found {demands.min_localized:g}")
    if not 1 <= seeds <= MOST_SEEDS:
        raise OptionError(f"--seeds is 1 to {MOST_SEEDS:,}, found {seeds}")
    if is_compared and seeds < LEAST_PAIRS:
        raise OptionError(f"--against compares runs seed by seed; give --seeds {LEAST_PAIRS} or more")


# The result as JUnit XML, which build servers read.

NOT_XML = re.compile("[^\\t\\n\\r\\x20-\\ud7ff\\ue000-\\ufffd\\U00010000-\\U0010ffff]")


def junit_xml(drives: Sequence[DriveCheck]) -> str:
    """Return JUnit XML: a suite for each drive, a case for each demand and for each change."""
    suites = ET.Element("testsuites", name="maurice-replay check")
    for drive in drives:
        cases = [(demand.kind, demand.title, demand.passed, demand.text) for demand in drive.demands]
        changes = zip(drive.changes, drive.change_texts, strict=True)
        cases += [
            (f"{change.kind} worse", f"{change.title}, against the baseline", change.passed, text)
            for change, text in changes
        ]
        suite = ET.SubElement(suites, "testsuite", name=_plain(drive.session))
        suite.set("time", f"{drive.took_s:.3f}")
        properties = ET.SubElement(suite, "properties")
        for name, value in (("seeds", len(drive.runs)), ("updates", len(drive.steps)), ("file", drive.path)):
            ET.SubElement(properties, "property", name=name, value=_plain(str(value)))
        for kind, title, passed, text in cases:
            case = ET.SubElement(suite, "testcase", name=_plain(title), time="0")
            case.set("classname", _plain(f"maurice-replay.{drive.session}"))
            if not passed:
                failure = ET.SubElement(case, "failure", message=_plain(text), type=kind)
                failure.text = _plain("" if drive.failure is None else drive.failure.text)
        _count(suite, [suite])
    _count(suites, list(suites))
    suites.set("time", f"{sum(drive.took_s for drive in drives):.3f}")
    ET.indent(suites)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{ET.tostring(suites, encoding="unicode")}\n'


def _count(into: ET.Element, suites: Sequence[ET.Element]) -> None:
    """Write how many cases there are and how many failed."""
    into.set("tests", str(sum(len(suite.findall("testcase")) for suite in suites)))
    into.set("failures", str(sum(len(suite.findall("testcase/failure")) for suite in suites)))
    into.set("errors", "0")
    into.set("skipped", "0")


def _plain(text: str) -> str:
    """Return a text without the characters that XML cannot hold."""
    return NOT_XML.sub("?", text)
