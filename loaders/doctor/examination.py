"""Examining a session with truth, with a library, or by the numbers alone, and the options that fix it."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path

import numpy as np

from maurice_mcl.config.build import build_localizer
from maurice_mcl.config.parameters import of_feature
from maurice_mcl.filter.localizer import Localizer
from maurice_mcl.sensor.descriptors.registry import FEATURES
from maurice_mcl.values.arrays import U8, Progress
from maurice_mcl.values.geometry import path_of
from maurice_mcl.values.library import Library
from maurice_mcl.values.session import Moment, SessionInfo

from ..errors import InputError, PictureError, ReadingNotes
from ..files.text import MOST
from ..formats.registry import chosen, open_recording
from ..reading.options import Reading
from ..reading.recording import Picture
from ..reading.session import GIVE_ODOMETRY
from ..reading.time_alignment import offset_between
from .findings import Evidence, Finding, RecordedDrive
from .fixing import fixable, fixed_options, on_robot
from .gathering import Gathered, gather
from .odometry import comparable, compared_with_truth
from .pictures import (
    FEWEST_PLACES,
    ComparedPictures,
    places_seen,
    seen_with_truth,
)
from .plausibility import (
    FEWEST,
    clocks_apart,
    implausible,
    odometry_doubts,
    time_unit,
    truth_apart,
    without_jumps,
)
from .scans import examine_scans
from .scans_on_map import examine_map


def movement_apart(drive: RecordedDrive) -> float | None:
    """Return what the truth's times need to move when the odometry does; None if that is unknown."""
    truth, odometry = drive.truth, drive.odometry
    if truth.size < 2 or odometry.size < 2 or (np.diff(odometry.t_s) < 0).any() or truth.part.any():
        return None
    poses = odometry.values if odometry.poses else path_of(odometry.values)
    offset = offset_between(odometry.t_s, poses, truth.t_s, truth.poses)
    return None if offset is None else offset.offset_s


# A session's pictures, compared with a library: some of them, over the whole drive.

MOST_PICTURES = 60
BETWEEN_S = 2.0  # pictures that come more often are passed over


def look(
    path: Path,
    options: Reading,
    library: Library,
    info: SessionInfo,
    drive: RecordedDrive,
    factor: float,
    progress: Progress | None = None,
) -> ComparedPictures:
    """Compare some pictures with a library, their times multiplied by `factor`. InputError: no channel."""
    localizer = _localizer(path, library, info)
    spacing = float(np.median(np.diff(drive.picture_t_s))) if len(drive.picture_t_s) > 1 else 0.0
    stride = max(1, round(BETWEEN_S / spacing)) if spacing > 0 else 1
    total = min(MOST_PICTURES, -(-len(drive.picture_t_s) // stride))
    times, comparisons = [], []
    for t_s, image in _pictures(path, options, stride):
        times.append(t_s * factor)
        comparisons.append(localizer.sensor.compare(localizer.sensor.measure(image)))
        if progress:
            progress(len(times), total)
        if len(times) >= MOST_PICTURES:
            break
    return ComparedPictures(np.array(times), comparisons, localizer)


def _localizer(path: Path, library: Library, info: SessionInfo) -> Localizer:
    weights = {name: weight for name, weight in FEATURES["blended"].items() if name in library.index}
    if not weights:
        raise InputError(path, f"the library {library.name!r} holds neither color nor edges; build it again")
    parameters = of_feature("blended" if len(weights) > 1 else next(iter(weights)))
    try:
        return build_localizer(library, _Named(info), parameters)
    except ValueError as problem:  # of the header's motion
        raise InputError(path, str(problem), 1) from None


def _pictures(path: Path, options: Reading, stride: int) -> Iterator[tuple[float, U8]]:
    records = open_recording(path, options, unchecked=True).records(ReadingNotes(keep_going=True))
    pictures = (record for record in records if isinstance(record, Picture))
    for picture in islice(pictures, 0, None, stride):
        with suppress(PictureError):
            yield picture.t_s, picture.read()


@dataclass(frozen=True, slots=True)
class _Named:
    info: SessionInfo

    def moments(self) -> Iterator[Moment]:
        return iter(())


WRONG_TRUTH = ("truth-degrees", "truth-scale", "truth-clock", "disagreement")  # no use for the pictures


@dataclass(frozen=True, slots=True)
class Examination:
    """What was looked at, and what is wrong."""

    path: Path
    name: str
    odometry: int  # records
    truth: int
    pictures: int
    cut: bool  # whether only the first 50,000 records of a kind were looked at
    remarks: tuple[str, ...]  # by the reader
    checks: tuple[str, ...]  # what could be asked
    not_asked: tuple[str, ...]  # what could not, and why
    findings: tuple[Finding, ...]
    fixed: Reading  # what to read it with; as it was read where no option fixes anything
    display_units: str = "m"  # of the session: "m" or "in"
    scans: int = 0  # records


# how far off the simulated Maurice's drives of docs/formats.md were
FROM_TRUTH = "0.11 m off on simulated drives, where the wheels' is 0.09 m"


def made_odometry(info: SessionInfo, options: Reading) -> str:
    """Return where odometry is from that was not measured, by the options or the header; "" for a robot's."""
    if options.odometry_from_truth:
        return "it was made here (--reading odometry_from_truth=true), so it tells nothing of the robot's"
    is_noted = any(SYNTHETIC.search(text) for text in (info.name, *info.notes))
    return (
        "it was made and not measured, as the header notes, so it tells nothing of the robot's"
        if is_noted
        else ""
    )


SYNTHETIC = re.compile(r"odometry (is synthetic|made from|is not measured|from pictures)", re.I)


def odometry_advice(examination: Examination) -> tuple[str, ...]:
    """Return how a recording that has no odometry gets some, and how well one that is made does."""
    if examination.odometry:
        return ()
    ways = []
    if examination.truth > 1:
        ways.append(
            f"--reading odometry_from_truth=true makes some from the truth, with noise ({FROM_TRUTH})"
        )
    elif examination.pictures > 1:
        ways.append(GIVE_ODOMETRY)
    return tuple(ways)


def examine(
    path: Path, options: Reading, library: Library | None, progress: Progress | None = None
) -> Examination:
    """Look for everything that is known to go wrong. InputError for what cannot be read at all.

    What one check finds is taken back before the next: times first, then truth, then at most 60 pictures.
    """
    gathered = gather(path, options)
    factor, units = time_unit(gathered.drive)
    drive = gathered.drive.slowed(factor)
    if library is not None and not np.isfinite(drive.size_m):
        drive = replace(drive, size_m=max(library.arena.size_m))
    scans = replace(gathered.scans, t_s=gathered.scans.t_s * factor)
    doubtful = implausible(drive, scans)
    drive = without_jumps(drive)
    for limit_m in [finding.numbers["range_m"] for finding in doubtful if finding.code == "max-range"]:
        limited = (replace(scan, max_m=min(scan.max_m, limit_m)) for scan in scans.scans)
        scans = replace(scans, scans=tuple(limited))
    movement_s = movement_apart(drive)
    seen = drive if len(drive.picture_t_s) else replace(drive, picture_t_s=scans.t_s, sees="scans")
    clocks = clocks_apart(seen, movement_s) or truth_apart(seen)
    checks, without = ["times"], list[str]()
    known = [*_about_reading(gathered), *doubtful, *units, *clocks]
    if (how_made := made_odometry(gathered.info, options)) and drive.odometry.size:
        without.append(f"odometry: {how_made}")
    else:
        known += _about_odometry(drive, movement_s, checks, without)
    if scans.size:
        there = None if library is None else library.occupancy
        scans, about_scans, check = examine_scans(scans, seen, options.max_dt_s)
        known, checks = [*known, *about_scans], [*checks, check]
        if there is not None:
            about_map, on_map = examine_map(scans, seen, there, about_scans)
            known, checks = [*known, *about_map], [*checks, *on_map]
        without += ["the map: none was given"] if there is None else []
    if obstacle := _why_no_pictures(drive, library, known):
        without += [] if not len(drive.picture_t_s) and gathered.scans.size else [f"pictures: {obstacle}"]
    elif library is not None:
        looks = look(path, options, library, gathered.info, drive, factor, progress)
        checks.append(f"{len(looks.t_s)} pictures against the library")
        places = len(np.unique(places_seen(looks, drive.truth)))
        if places < FEWEST_PLACES:
            text = f"they are of {places} distinct places, and {FEWEST_PLACES} are needed"
            without.append(f"where and when the camera looks, by the pictures: {text}")
        known = known + seen_with_truth(looks, drive.truth)
    delayed = any(finding.code in ("picture-delay", "scan-delay") for finding in known)
    form = chosen(path, options)
    clear = [finding for finding in known if not (delayed and finding.code == "truth-apart")]
    findings = [fixable(on_robot(finding, options), form, options) for finding in clear]
    counts = (drive.odometry.size, drive.truth.size, len(drive.picture_t_s))
    answers = (tuple(checks), tuple(without), tuple(findings))
    fixed = fixed_options(options, findings)
    name, shown_in = gathered.info.name, gathered.info.display_units
    remarks = gathered.warnings
    return Examination(path, name, *counts, gathered.cut, remarks, *answers, fixed, shown_in, scans.size)


def _why_no_pictures(drive: RecordedDrive, library: Library | None, known: Sequence[Finding]) -> str:
    """Return why pictures are not compared with the library, or nothing."""
    if not len(drive.picture_t_s):
        return "there are none"
    if library is None or library.is_map:
        return "no library was given"
    if drive.truth.size < 2:
        return "no truth tells where they are from"
    if any(finding.code in WRONG_TRUTH for finding in known):
        return "the truth has to be put right first"
    return ""


def _about_odometry(
    drive: RecordedDrive, movement_s: float | None, checks: list[str], without: list[str]
) -> list[Finding]:
    if drive.truth.size > 1 and drive.odometry.size > 1:
        few = comparable(drive)
        if not few:
            checks.append("odometry against truth")
            return compared_with_truth(drive, movement_s)
        without.append(f"odometry against truth: {few}")
    for name, size in (("odometry", drive.odometry.size), ("truth", drive.truth.size)):
        without += [f"{name}: there is {'one record' if size else 'none'}"] if size <= 1 else []
    checks += ["odometry by itself"] if drive.odometry.size >= FEWEST else []
    return odometry_doubts(drive)


def _about_reading(gathered: Gathered) -> list[Finding]:
    findings, truth = list[Finding](), gathered.drive.truth.poses
    for name, (tilt_rad, height_m) in gathered.tilts.items():
        numbers = {"tilt_deg": math.degrees(tilt_rad), "height_m": height_m}
        evidence = (Evidence("off-plane", {"name": name, **numbers}),)
        findings.append(Finding("out-of-plane", evidence, numbers, details={"name": name}))
    if gathered.falls:
        findings.append(Finding("times-fall", (Evidence("falling"),), details={"falls": gathered.falls}))
    large = sum(int((np.abs(v) > MOST).any(axis=1).sum()) for v in (gathered.drive.odometry.values, truth))
    if large:
        most = {"most": MOST}
        evidence = (Evidence("limits", most),)
        findings.append(Finding("too-large", evidence, {"records": large}, details=most))
    if gathered.skipped:
        evidence = (Evidence("first-problem", {"problem": gathered.first_problem}),)
        findings.append(Finding("broken", evidence, details={"records": gathered.skipped}))
    return findings
