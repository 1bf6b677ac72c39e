"""Examining a session with truth, with a library, or by the numbers alone, and the options that fix it."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from maurice_mcl.config.build import build_localizer
from maurice_mcl.config.parameters import of_feature
from maurice_mcl.filter.localizer import Localizer
from maurice_mcl.filter.motion import MauriceParameters, from_header
from maurice_mcl.sensor.descriptors.registry import FEATURES
from maurice_mcl.values.arrays import F64, U8, Progress
from maurice_mcl.values.geometry import path_of
from maurice_mcl.values.laser import LaserScan
from maurice_mcl.values.library import Library
from maurice_mcl.values.session import Moment, SessionInfo, is_kidnapping

from ..errors import InputError, PictureError, ReadingNotes
from ..files.text import MOST
from ..formats.registry import Format, chosen, open_recording
from ..reading.options import MADE_ODOMETRY, ReadingOptions, option_name
from ..reading.recording import Motion, Note, OdometryPose, Picture, Scan, TruthPose
from ..reading.time_alignment import offset_between
from .findings import Evidence, Finding, RecordedDrive, RecordedOdometry, RecordedTruth
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
    coarse_times,
    odometry_doubts,
    time_unit,
    truth_apart,
)
from .scans import MOST_SCANS, RecordedScans, examine_scans, thinned

MOST_RECORDS = 50_000  # records of one kind that are looked at: an hour and a half of odometry at 10 Hz


@dataclass(slots=True, eq=False)
class Gathered:
    """A recording without its pictures' content."""

    info: SessionInfo
    drive: RecordedDrive
    falls: int  # times that fall, which the reader refuses
    skipped: int  # records that cannot be read at all
    first_problem: str
    cut: bool  # whether only the beginning was looked at
    warnings: tuple[str, ...] = ()
    tilts: Mapping[str, tuple[float, float]] = field(default_factory=dict)  # rad, m, of sources off the plane
    scans: RecordedScans = field(default_factory=lambda: RecordedScans(np.zeros(0), ()))


Row = tuple[float, F64, int]  # time, values (3,), and how often the robot was carried away before


def gather(path: Path, options: ReadingOptions) -> Gathered:
    """Read all but the pictures. Raises InputError if there is nothing to examine."""
    recording = open_recording(path, options, unchecked=True)
    info, notes = recording.info, ReadingNotes(keep_going=True)
    kept: dict[type, list[tuple[float, F64, int]]] = {
        Motion: [],
        OdometryPose: [],
        TruthPose: [],
        Picture: [],
    }
    scans = list[tuple[float, LaserScan]]()
    falls, part, last_s, cut = 0, 0, -math.inf, False
    for record in recording.records(notes):
        falls += record.t_s < last_s
        last_s = record.t_s
        if isinstance(record, Scan) and len(scans) < MOST_SCANS:
            scans.append((record.t_s, thinned(record.scan)))
        part += isinstance(record, Note) and is_kidnapping(record.text)
        rows = kept.get(type(record))
        if rows is not None:
            values = record.motion if isinstance(record, Motion) else getattr(record, "pose", None)
            rows.append((record.t_s, np.zeros(3) if values is None else values, part))
            cut = len(rows) >= MOST_RECORDS
        if cut:
            break
    odometry, truth = kept[Motion] or kept[OdometryPose], kept[TruthPose]
    drive = RecordedDrive(
        RecordedOdometry(_times(odometry), _values(odometry), odometry is kept[OdometryPose]),
        RecordedTruth(_times(truth), _values(truth), np.array([part for _, _, part in truth], np.int32)),
        _times(kept[Picture]),
        max(info.arena.size_m) if info.arena else math.inf,
        _gain(path, info),
    )
    first = str(notes.problems[0]) if notes.problems else ""
    remarks = tuple(dict.fromkeys((*info.notes, *notes.warnings)))
    seen = RecordedScans(np.array([t_s for t_s, _ in scans]), tuple(scan for _, scan in scans))
    return Gathered(info, drive, falls, notes.count, first, cut, remarks, notes.tilts, seen)


def _times(rows: Sequence[Row]) -> F64:
    return np.array([t_s for t_s, _, _ in rows], np.float64)


def _values(rows: Sequence[Row]) -> F64:
    return np.array([values for _, values, _ in rows], np.float64).reshape(-1, 3)


def movement_apart(drive: RecordedDrive) -> float | None:
    """Return what the truth's times need to move when the odometry does; None if that is unknown."""
    truth, odometry = drive.truth, drive.odometry
    if truth.size < 2 or odometry.size < 2 or (np.diff(odometry.t_s) < 0).any() or truth.part.any():
        return None
    poses = odometry.values if odometry.poses else path_of(odometry.values)
    offset = offset_between(odometry.t_s, poses, truth.t_s, truth.poses)
    return None if offset is None else offset.offset_s


def _gain(path: Path, info: SessionInfo) -> float:
    if not info.motion or info.motion.get("model", "maurice") != "maurice":
        return 1.0
    try:
        return from_header(MauriceParameters, info.motion).turn_gain
    except ValueError as problem:
        raise InputError(path, str(problem), 1) from None


# A session's pictures, compared with a library: some of them, over the whole drive.

MOST_PICTURES = 60
BETWEEN_S = 2.0  # pictures that come more often are passed over


def look(
    path: Path,
    options: ReadingOptions,
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
    wanted = {name: weight for name, weight in FEATURES["blended"].items() if name in library.index}
    if not wanted:
        raise InputError(path, f"the library {library.name!r} holds neither color nor edges; build it again")
    parameters = of_feature("blended" if len(wanted) > 1 else next(iter(wanted)))
    try:
        return build_localizer(library, _Named(info), parameters)
    except ValueError as problem:  # of the header's motion
        raise InputError(path, str(problem), 1) from None


def _pictures(path: Path, options: ReadingOptions, stride: int) -> Iterator[tuple[float, U8]]:
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
    fixed: ReadingOptions  # what to read it with; as it was read where no option fixes anything
    display_units: str = "m"  # of the session: "m" or "in"
    fov_known: bool = False  # whether the camera's field of view is stated
    scans: int = 0  # records


# how far off the simulated Maurice's drives of docs/formats.md were
FROM_TRUTH = "0.11 m off on simulated drives, where the wheels' is 0.09 m"
FROM_PICTURES = "on 8 simulated drives 0.07 m off with landmarks; with channels 0.29 m, and 3 of them lost"


def has_view(info: SessionInfo, options: ReadingOptions) -> bool:
    """Return whether the field of view of the camera that is read is stated, by the header or the options."""
    cameras = info.cameras
    read = [camera for camera in cameras if camera.name == options.camera] or list(cameras)
    return bool(options.camera_fov_rad or (read and read[0].horizontal_fov_rad))


def made_odometry(info: SessionInfo, options: ReadingOptions) -> str:
    """Return where odometry is from that was not measured, by the options or the header; "" for a robot's."""
    made_by = [name for name in MADE_ODOMETRY if getattr(options, name)]
    if made_by:
        return f"it was made here ({option_name(made_by[0])}=true), so it tells nothing of the robot's"
    noted = any(SYNTHETIC.search(text) for text in (info.name, *info.notes))
    return (
        "it was made and not measured, as the header notes, so it tells nothing of the robot's"
        if noted
        else ""
    )


SYNTHETIC = re.compile(r"odometry (is synthetic|made from|is not measured|from pictures)", re.I)


def odometry_advice(examination: Examination) -> tuple[str, ...]:
    """Return how odometry can be made for a recording that has none, and how well each way does."""
    if examination.odometry:
        return ()
    ways = []
    if examination.truth > 1:
        ways.append(
            f"--reading odometry_from_truth=true makes some from the truth, with noise ({FROM_TRUTH})"
        )
    if examination.pictures > 1:
        typed = (
            f"--reading odometry_from_pictures=true{'' if examination.fov_known else ',camera_fov_deg=60'}"
        )
        view = "" if examination.fov_known else "; 60 stands for your camera's horizontal field of view"
        ways.append(f"{typed} makes some from the pictures alone ({FROM_PICTURES}){view}")
    return tuple(ways)


def examine(
    path: Path, options: ReadingOptions, library: Library | None, progress: Progress | None = None
) -> Examination:
    """Look for everything that is known to go wrong. InputError for what cannot be read at all.

    What one check finds is taken back before the next: times first, then truth, then at most 60 pictures.
    """
    gathered = gather(path, options)
    factor, units = time_unit(gathered.drive)
    drive = gathered.drive.slowed(factor)
    if library is not None and not np.isfinite(drive.size_m):
        drive = replace(drive, size_m=max(library.arena.size_m))
    movement_s = movement_apart(drive)
    scans = replace(gathered.scans, t_s=gathered.scans.t_s * factor)
    seen = drive if len(drive.picture_t_s) else replace(drive, picture_t_s=scans.t_s, sees="scans")
    clocks = clocks_apart(seen, movement_s) or truth_apart(seen)
    checks, without = ["times"], list[str]()
    known = [*_about_reading(gathered), *coarse_times(seen), *units, *clocks]
    if (made := made_odometry(gathered.info, options)) and drive.odometry.size:
        without.append(f"odometry: {made}")
    else:
        known += _about_odometry(drive, movement_s, checks, without)
    if scans.size:
        there = None if library is None else library.occupancy
        more, asked = examine_scans(scans, seen, there, options.max_dt_s)
        known, checks = [*known, *more], [*checks, *asked]
        without += ["the map: none was given"] if there is None else []
    if not len(drive.picture_t_s):
        without += [] if gathered.scans.size else ["pictures: there are none"]
    elif library is None or library.is_map:
        without.append("pictures: no library was given")
    elif drive.truth.size < 2:
        without.append("pictures: no truth tells where they are from")
    elif any(finding.code in WRONG_TRUTH for finding in known):
        without.append("pictures: the truth has to be put right first")
    else:
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
    findings = [fixable(_on_robot(finding, options), form) for finding in clear]
    counts = (drive.odometry.size, drive.truth.size, len(drive.picture_t_s))
    answers = (tuple(checks), tuple(without), tuple(findings))
    fixed = fixed_options(options, findings)
    info = gathered.info
    name, shown_in, fov_known = info.name, info.display_units, has_view(info, options)
    examination = Examination(
        path, name, *counts, gathered.cut, gathered.warnings, *answers, fixed, shown_in, fov_known
    )
    return replace(examination, scans=scans.size)


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


# From what the doctor found to the options of reading that fix it.

# what was read with one factor and needs another is read with their product
FACTORS = ("odometry_scale", "turn_scale", "turn_gain", "truth_scale", "truth_turn_scale")


def fixable(finding: Finding, form: Format) -> Finding:
    """Leave out of a finding the options that a format does not take."""
    if "time_unit" in finding.options and not form.takes_unit:
        return replace(finding, options={})
    return finding


def _on_robot(finding: Finding, options: ReadingOptions) -> Finding:
    """Return a place on the robot as the options have it: from forward, not from where the camera looks."""
    if finding.code != "truth-mast" or not options.camera_yaw_rad:
        return finding
    place = complex(finding.numbers["ahead_m"], finding.numbers["left_m"])
    turned = place * np.exp(1j * options.camera_yaw_rad)
    numbers = {"ahead_m": round(turned.real, 3), "left_m": round(turned.imag, 3)}
    return replace(finding, numbers=numbers, options={f"truth_{name}": v for name, v in numbers.items() if v})


def fixed_options(options: ReadingOptions, findings: Iterable[Finding]) -> ReadingOptions:
    """Return the options with what fixes the findings, found in reading with these options."""
    for finding in findings:
        changed: dict[str, Any] = {}
        for name, value in finding.options.items():
            before = getattr(options, name)
            if isinstance(value, str):
                changed[name] = value
            else:
                changed[name] = before * value if name in FACTORS else before + value
        options = replace(options, **changed)
    return options
