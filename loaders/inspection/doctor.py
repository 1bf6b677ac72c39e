"""Diagnosing a session with truth, with a library, or by the numbers alone, and the options that fix it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from maurice_mcl.diagnosis.findings import Evidence, Finding, RecordedDrive, in_radians, turn_finding
from maurice_mcl.diagnosis.odometry import compared_with_truth
from maurice_mcl.diagnosis.pictures import ComparedPictures, doubted_by_pictures, seen_with_truth
from maurice_mcl.diagnosis.plausibility import clocks_apart, odometry_doubts, time_unit, truth_apart
from maurice_mcl.library import Library

from ..formats.registry import chosen
from ..io.fields import MOST
from ..reading import ReadingOptions
from .doctor_reading import Gathered, Progress, gather, look, movement_apart

# Diagnosing a session: what people get wrong, found with truth, with a library, or by the numbers alone.

WRONG_TRUTH = ("truth-degrees", "truth-scale", "truth-clock", "disagreement")  # no use for the pictures
HARMLESS = ("broken", "time-unit")  # the first left out, the second taken back before pictures are asked


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """What was looked at, and what is wrong."""

    path: Path
    name: str
    odometry: int  # records
    truth: int
    pictures: int
    cut: bool  # whether only the first 50,000 records of a kind were looked at
    said: tuple[str, ...]  # by the reader
    checks: tuple[str, ...]  # what could be asked
    not_asked: tuple[str, ...]  # what could not, and why
    findings: tuple[Finding, ...]
    fixed: ReadingOptions  # what to read it with; as it was read where no option fixes anything


def diagnose(
    path: Path, options: ReadingOptions, library: Library | None, progress: Progress | None = None
) -> Diagnosis:
    """Look for everything that is known to go wrong. Raises InputError for what cannot be read at all.

    Reads the records once, and with a library decodes at most 60 pictures. What an earlier check finds is
    taken back before the next one: times first, then what truth says, then what pictures say.
    """
    found = gather(path, options)
    factor, units = time_unit(found.drive)
    drive = found.drive.slowed(factor)
    if library is not None and not np.isfinite(drive.size_m):
        drive = replace(drive, size_m=max(library.arena.size_m))
    movement_s = movement_apart(drive)
    apart = clocks_apart(drive, movement_s) or truth_apart(drive)
    asked = _Asked(["times", "odometry by itself"], [])
    known = [*_about_reading(found), *units, *apart, *_about_odometry(drive, movement_s, asked)]
    if library is None:
        asked.without.append("pictures: no library was given")
    elif not len(drive.picture_t_s):
        asked.without.append("pictures: there are none")
    else:
        looks = look(path, options, library, found.info, drive, factor, progress)
        asked.checks.append(f"{len(looks.t_s)} pictures against the library")
        known = _about_pictures(looks, drive, found, known)
    return _diagnosis(path, options, found, drive, asked, known)


@dataclass(frozen=True, slots=True)
class _Asked:
    """What could be asked."""

    checks: list[str]
    without: list[str]  # what could not, and why


def _diagnosis(
    path: Path,
    options: ReadingOptions,
    found: Gathered,
    drive: RecordedDrive,
    asked: _Asked,
    known: Sequence[Finding],
) -> Diagnosis:
    """Put together what is reported; a delay of the pictures is why truth seems to be elsewhere in time."""
    delayed = any(one.code == "picture-delay" for one in known)
    format_name = chosen(path, options).name
    findings = [fixable(one, format_name) for one in known if not (delayed and one.code == "truth-apart")]
    return Diagnosis(
        path,
        found.info.name,
        drive.odometry.size,
        drive.truth.size,
        len(drive.picture_t_s),
        found.cut,
        found.warnings,
        tuple(asked.checks),
        tuple(asked.without),
        tuple(findings),
        fixed_options(options, findings),
    )


def _about_odometry(drive: RecordedDrive, movement_s: float | None, asked: _Asked) -> list[Finding]:
    """Compare odometry with truth; where one of the two is missing, ask whether odometry is plausible."""
    if drive.truth.size > 1 and drive.odometry.size > 1:
        asked.checks.append("odometry against truth")
        return compared_with_truth(drive, movement_s)
    asked.without.append(f"{_lacking(drive)}: there is none")
    return odometry_doubts(drive)


def _lacking(drive: RecordedDrive) -> str:
    """Name what a comparison of odometry with truth lacks."""
    return "truth" if drive.truth.size <= 1 else "odometry"


def _about_reading(found: Gathered) -> list[Finding]:
    """Return what a reader of this log would stumble over."""
    findings, truth = [], found.drive.truth.poses
    if found.falls:
        findings.append(Finding("times-fall", (Evidence("falling"),), details={"falls": found.falls}))
    large = sum(int((np.abs(v) > MOST).any(axis=1).sum()) for v in (found.drive.odometry.values, truth))
    if large:
        most = {"most": MOST}
        evidence = (Evidence("limits", most),)
        findings.append(Finding("too-large", evidence, {"records": large}, details=most))
    if found.skipped:
        evidence = (Evidence("first-problem", {"problem": found.first_problem}),)
        findings.append(Finding("broken", evidence, details={"records": found.skipped}))
    return findings


def _about_pictures(
    looks: ComparedPictures, drive: RecordedDrive, found: Gathered, known: list[Finding]
) -> list[Finding]:
    """Ask the pictures, with truth where there is any; not where the odometry is known to be wrong.

    Return what is known by then: degrees alone do not show in which direction they are counted.
    """
    if drive.truth.size > 1:
        truthful = not any(one.code in WRONG_TRUTH for one in known)
        return known + (seen_with_truth(looks, drive.truth) if truthful else [])
    doubts = [one for one in known if one.code not in HARMLESS]
    in_degrees = [one.code for one in doubts] == ["turn-degrees"]
    if not drive.odometry.size or (doubts and not in_degrees):
        return known
    asked = in_radians(drive) if in_degrees else drive
    more = doubted_by_pictures(looks, asked, found.info.start)
    if in_degrees and [one.code for one in more] == ["turn-clockwise"]:
        evidence = (*doubts[0].evidence, *more[0].evidence)
        both = turn_finding("clockwise degrees", *evidence, **doubts[0].numbers)
        return [both if one is doubts[0] else one for one in known]
    return known + more


# From what the doctor found to the options of reading that fix it.

UNITS_TAKEN = (
    "session-log",
    "table",
    "tum",
    "tum-trajectory",
    "openloris",
    "euroc",
)  # by --reading time_unit=...
FACTORS = (
    "odometry_scale",
    "turn_scale",
    "turn_gain",
    "truth_scale",
    "truth_turn_scale",
)  # what was read with one factor and needs another is read with their product


def fixable(finding: Finding, format_name: str) -> Finding:
    """Leave out of a finding the options that a format does not take."""
    if "time_unit" in finding.options and format_name not in UNITS_TAKEN:
        return replace(finding, options={})
    return finding


def fixed_options(options: ReadingOptions, findings: Iterable[Finding]) -> ReadingOptions:
    """Return the options with what fixes the findings, found in reading with these options."""
    for finding in findings:
        options = _with(options, finding.options)
    return options


def _with(options: ReadingOptions, changes: Mapping[str, float | str]) -> ReadingOptions:
    found: dict[str, float | str] = {}
    for name, value in changes.items():
        before = getattr(options, name)
        if isinstance(value, str):
            found[name] = value
        else:
            found[name] = before * value if name in FACTORS else before + value
    return replace(options, **found)  # type: ignore[arg-type]  # fields by name
