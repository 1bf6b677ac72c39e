"""The gate: whether a filter does on drives what is demanded of it, with many seeds, no worse than before."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from maurice_loaders.files.writing import expect_absent, write_whole
from maurice_loaders.reading.options import ReadingOptions
from maurice_loaders.reading.session import RecordedSession
from maurice_mcl.scoring.demands import Demands
from maurice_mcl.values import F64, Library

from ...errors import OptionError
from ...listener import SILENT, Listener
from ...running.run_spec import RunSpec
from .baseline import baseline_bytes, read_baseline
from .drive import CheckedFilter, DriveCheck, check_drive
from .failure import expect_new_artifacts
from .junit import junit_xml
from .rules import LEAST_PAIRS

MOST_SEEDS = 10_000


@dataclass(frozen=True, slots=True, eq=False)
class CheckResult:
    """Whether a filter passed, drive by drive.

    >>> import maurice_viz as mv
    >>> result = mv.check("session.log", max_error_m=0.3, localized_by=5, particles=50)
    >>> result.passed, [demand.title for demand in result.drives[0].demands]
    (True, ['localized by step 5', 'not lost from then on', 'mean error at most 0.3 m'])
    """

    drives: tuple[DriveCheck, ...]

    @property
    def passed(self) -> bool:
        """Whether every drive passed."""
        return all(drive.passed for drive in self.drives)

    def to_json(self) -> dict[str, Any]:
        """Return everything as JSON, lengths in meters."""
        return {"passed": self.passed, "drives": [drive.to_json() for drive in self.drives]}

    def to_junit(self) -> str:
        """Return JUnit XML: a suite for each drive, a test case for each demand."""
        return junit_xml(self.drives)


@dataclass(frozen=True, slots=True)
class CheckFiles:
    """What a check is compared with, and what it writes."""

    against: Path | None = None
    save_baseline: Path | None = None
    junit: Path | None = None
    artifacts: Path | None = None
    force: bool = False

    def check(self) -> None:
        """Refuse what exists before any run is made. InputError."""
        for file in (self.save_baseline, self.junit):
            if file is not None:
                expect_absent(file, force=self.force)
        if self.artifacts is not None:
            expect_new_artifacts(self.artifacts, force=self.force)

    def write(self, result: CheckResult) -> None:
        """Write the baseline and the JUnit XML."""
        texts = {self.junit: result.to_junit().encode()} if self.junit else {}
        if self.save_baseline is not None:
            texts[self.save_baseline] = baseline_bytes(drive.made for drive in result.drives)
        for file, data in texts.items():
            file.parent.mkdir(parents=True, exist_ok=True)
            write_whole(file, data, force=self.force)


def check(
    session: str | Path | RecordedSession | Sequence[str | Path],
    library: str | Path | Library | None = None,
    *,
    max_error_m: float | None = None,
    localized_by: int | None = None,
    converged_by: int | None = None,
    min_localized: float = 0.95,
    seeds: int = 1,
    preset: str | None = None,
    feature: str | None = None,
    particles: int | None = None,
    start: str | F64 | None = None,
    config: str | Path | None = None,
    settings: Mapping[str, Any] | None = None,
    sensors: Sequence[str] = (),
    reading: ReadingOptions | None = None,
    against: str | Path | None = None,
    save_baseline: str | Path | None = None,
    junit: str | Path | None = None,
    artifacts: str | Path | None = None,
    force: bool = False,
    listener: Listener = SILENT,
) -> CheckResult:
    """Test whether a filter does on a drive, or on several, what is demanded of it, with seeds 0, 1, 2, ...

    Each demand holds where at least the share `min_localized` of the runs meets it: to be localized within
    `localized_by` steps and not lost after that, to be off by at most `max_error_m` in the mean, or to have
    converged within `converged_by` steps, which needs no true poses. `against` is a baseline that a call
    wrote to `save_baseline` (.parquet) earlier: fails where errors grew or rates fell, by paired seeds.
    `junit` is an XML file to write, `artifacts` a folder for why a run failed and a recording of it. The
    filter is chosen as in `replay`.

    Raises InputError for files that cannot be used and drives without the truth that a demand needs,
    OptionError for demands that make no sense. A check that fails raises nothing: see `passed`.

        >>> import maurice_viz as mv
        >>> mv.check("session.log", max_error_m=0.001, seeds=2, particles=50).passed
        False
    """
    demands = Demands(max_error_m, localized_by, converged_by, min_localized)
    files = CheckFiles(_path(against), _path(save_baseline), _path(junit), _path(artifacts), force)
    spec = RunSpec.of(preset, feature, particles, 0, start, config, settings, sensors)
    _expect_sense(demands, seeds, files)
    files.check()
    baseline = None if files.against is None else read_baseline(files.against)
    at = Path(library) if isinstance(library, str) else library
    asked = CheckedFilter(spec, at, demands, seeds, baseline, files.artifacts, reading or ReadingOptions())
    drives = [session] if isinstance(session, (str, Path, RecordedSession)) else session
    result = CheckResult(_checked(asked, drives, listener))
    files.write(result)
    return result


def _path(given: str | Path | None) -> Path | None:
    return None if given is None else Path(given)


def _checked(
    asked: CheckedFilter, sessions: Sequence[str | Path | RecordedSession], listener: Listener
) -> tuple[DriveCheck, ...]:
    if not sessions:
        raise OptionError("found no session to check")
    drives: list[DriveCheck] = []
    for source in sessions:
        drives.append(check_drive(asked, source, [drive.session for drive in drives], listener))
    return tuple(drives)


def _expect_sense(demands: Demands, seeds: int, files: CheckFiles) -> None:
    """Refuse demands that no run could meet, or that demand nothing. OptionError."""
    if not demands.kinds and files.against is None and files.save_baseline is None:
        raise OptionError("nothing is demanded; give --max-error, --localized-by or --converged-by")
    if demands.max_error_m is not None and not 0 < demands.max_error_m < np.inf:
        raise OptionError(f"--max-error is a length above 0, found {demands.max_error_m:g} m")
    for name, value in (("localized", demands.localized_by), ("converged", demands.converged_by)):
        if value is not None and value < 1:
            raise OptionError(f"--{name}-by is a number of steps from 1, found {value}")
    if not 0 < demands.min_rate <= 1:
        raise OptionError(f"--min-localized is a rate above 0 and up to 1, found {demands.min_rate:g}")
    if not 1 <= seeds <= MOST_SEEDS:
        raise OptionError(f"--seeds is 1 to {MOST_SEEDS:,}, found {seeds}")
    if files.against is not None and seeds < LEAST_PAIRS:
        raise OptionError(f"--against compares runs seed by seed; give --seeds {LEAST_PAIRS} or more")
