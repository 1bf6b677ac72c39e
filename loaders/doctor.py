"""Diagnosing a session: what people get wrong, found with truth, with a library, or by the numbers alone."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from maurice_mcl.assembly import make_localizer
from maurice_mcl.diagnosis import Complaint, Drive, in_radians
from maurice_mcl.diagnosis_clocks import clocks_apart, truth_apart
from maurice_mcl.diagnosis_compare import compared_with_truth
from maurice_mcl.diagnosis_evidence import doubted_by_pictures
from maurice_mcl.diagnosis_pictures import Looks, seen_with_truth
from maurice_mcl.diagnosis_plausible import odometry_doubts, time_unit
from maurice_mcl.diagnosis_words import turn_complaint
from maurice_mcl.features import FEATURES
from maurice_mcl.library import Library
from maurice_mcl.parameters import of_feature
from maurice_mcl.session import Moment, SessionInfo

from .doctor_mending import mendable, mended
from .doctor_reading import Gathered, gather, movement_apart, raw_records
from .errors import LogError
from .fields import MOST
from .findings import Findings
from .formats import OpenOptions, chosen
from .pictures import PictureError
from .recording import Picture

MOST_PICTURES = 60  # compared with the library
WRONG_TRUTH = ("truth-degrees", "truth-scale", "truth-clock", "disagreement")  # no use for the pictures
HARMLESS = ("broken", "time-unit")  # the first left out, the second taken back before pictures are asked
BETWEEN_S = 2.0  # pictures that come more often are passed over

Progress = Callable[[int, int], None]


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
    complaints: tuple[Complaint, ...]
    mended: OpenOptions  # what to read it with; as it was read where no option mends anything


def diagnose(
    path: Path, options: OpenOptions, library: Library | None, progress: Progress | None = None
) -> Diagnosis:
    """Look for everything that is known to go wrong. LogError for what cannot be read at all.

    Reads the records once, and with a library decodes at most 60 pictures. What an earlier check finds is
    taken back before the next one: times first, then what truth says, then what pictures say.
    """
    found = gather(path, options)
    complaints = _about_reading(found)
    factor, units = time_unit(found.drive)
    drive = found.drive.slowed(factor)
    if library is not None and not np.isfinite(drive.size_m):
        drive = replace(drive, size_m=max(library.arena.size_m))
    movement_s = movement_apart(drive)
    apart = clocks_apart(drive, movement_s)
    complaints += [*units, *(apart or truth_apart(drive))]
    checks = ["times", "odometry by itself"]
    not_asked: list[str] = []
    with_truth = compared_with_truth(drive, movement_s)
    asked_truth = drive.truth.size > 1 and drive.odometry.size > 1
    (checks if asked_truth else not_asked).append(
        "odometry against truth" if asked_truth else f"{_lacking(drive)}: there is none"
    )
    complaints += with_truth if asked_truth else odometry_doubts(drive)
    if library is None:
        not_asked.append("pictures: no library was given")
    elif not len(drive.picture_t_s):
        not_asked.append("pictures: there are none")
    else:
        looks = look(path, options, library, found.info, drive, factor, progress)
        checks.append(f"{len(looks.t_s)} pictures against the library")
        complaints = _about_pictures(looks, drive, found, complaints)
    if any(one.code == "picture-delay" for one in complaints):  # that is why truth passes them by
        complaints = [one for one in complaints if one.code != "truth-apart"]
    format_name = chosen(path, options).name
    complaints = [mendable(one, format_name) for one in complaints]
    return Diagnosis(
        path,
        found.info.name,
        drive.odometry.size,
        drive.truth.size,
        len(drive.picture_t_s),
        found.cut,
        found.warnings,
        tuple(checks),
        tuple(not_asked),
        tuple(complaints),
        mended(options, complaints),
    )


def _lacking(drive: Drive) -> str:
    """Name what a comparison of odometry with truth lacks."""
    return "truth" if drive.truth.size <= 1 else "odometry"


def _about_reading(found: Gathered) -> list[Complaint]:
    """Say what a reader of this log would stumble over."""
    complaints, truth = [], found.drive.truth.poses
    if found.falls:
        what = f"times fall {found.falls} times"
        mend = "sort the records by t; if they are of several clocks, put these on one first"
        complaints.append(Complaint("times-fall", what, "every reader refuses a time that falls", mend))
    large = sum(int((np.abs(v) > MOST).any(axis=1).sum()) for v in (found.drive.odometry.values, truth))
    if large:
        what = f"{large} records hold numbers of more than {MOST:g}"
        why = f"a session log may not hold them; truth and odometry are at most {MOST:g} in size"
        mend = "`maurice-replay inspect SESSION` names the lines; --keep-going leaves them out"
        complaints.append(Complaint("too-large", what, why, mend, {"records": large}))
    if found.skipped:
        what = f"{found.skipped} records cannot be read"
        mend = "`maurice-replay inspect SESSION` lists them; --keep-going leaves them out"
        complaints.append(Complaint("broken", what, f"the first: {found.first_problem}", mend))
    return complaints


def _about_pictures(looks: Looks, drive: Drive, found: Gathered, known: list[Complaint]) -> list[Complaint]:
    """Ask the pictures, with truth where there is any; not where the odometry is known to be wrong.

    Gives what is known by then: degrees alone do not tell which way round they are counted.
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
        evidence = f"{doubts[0].evidence}; {more[0].evidence}"
        both = turn_complaint("clockwise degrees", evidence, **doubts[0].numbers)
        return [both if one is doubts[0] else one for one in known]
    return known + more


def look(
    path: Path,
    options: OpenOptions,
    library: Library,
    info: SessionInfo,
    drive: Drive,
    factor: float,
    progress: Progress | None = None,
) -> Looks:
    """Compare some pictures with a library. LogError for a library without any of the channels wanted."""
    wanted = {name: weight for name, weight in FEATURES["blended"].items() if name in library.index}
    if not wanted:
        raise LogError(path, f"the library {library.name!r} holds neither color nor edges; build it again")
    parameters = of_feature("blended" if len(wanted) > 1 else next(iter(wanted)))
    localizer = make_localizer(library, _Named(info), parameters)
    spacing = float(np.median(np.diff(drive.picture_t_s))) if len(drive.picture_t_s) > 1 else 0.0
    stride = max(1, round(BETWEEN_S / spacing)) if spacing > 0 else 1
    times, comparisons, number = [], [], 0
    total = min(MOST_PICTURES, -(-len(drive.picture_t_s) // stride))
    for record in raw_records(path, options, Findings(keep_going=True)):
        if not isinstance(record, Picture):
            continue
        number += 1
        if (number - 1) % stride:
            continue
        try:
            image = record.read()
        except PictureError:
            continue
        times.append(record.t_s * factor)
        comparisons.append(localizer.sensor.compare(localizer.sensor.measure(image)))
        if progress:
            progress(len(times), total)
        if len(times) >= MOST_PICTURES:
            break
    return Looks(np.array(times), comparisons, localizer)


@dataclass(frozen=True, slots=True)
class _Named:
    """What a localizer wants to know of a session: its header."""

    info: SessionInfo

    def moments(self) -> Iterator[Moment]:
        """Nothing is replayed here."""
        return iter(())
