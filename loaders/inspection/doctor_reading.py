"""Reading a recording for diagnosis, as it stands, with some of its pictures."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import islice
from pathlib import Path

import numpy as np

from maurice_mcl.arrays import F64, U8
from maurice_mcl.config.build import build_localizer
from maurice_mcl.config.parameters import of_feature
from maurice_mcl.diagnosis.findings import RecordedDrive, RecordedOdometry, RecordedTruth, joined
from maurice_mcl.diagnosis.pictures import ComparedPictures
from maurice_mcl.filter.localizer import Localizer
from maurice_mcl.filter.motion import MauriceParameters
from maurice_mcl.library import Library
from maurice_mcl.sensor.descriptors.registry import FEATURES
from maurice_mcl.session import Moment, SessionInfo

from ..errors import FieldError, InputError, PictureError, ReadingNotes
from ..formats.registry import NATIVE, chosen, open_recording
from ..io.pictures import decode_picture
from ..reading import ReadingOptions
from ..recording import Motion, Note, OdometryPose, Picture, Record, Recording, TruthPose
from ..session_log.reader import CameraChoice, picture_bytes
from ..session_log.records import PictureRecord, parse_object, read_header, read_lines
from ..transforms.clocks import PER_SECOND, offset_between
from ..transforms.corrected import corrected

# Reading a recording for diagnosis: as it stands, also where its numbers break the rules.

MOST_RAW = 1e25  # of any number; nanoseconds since 1970 are 2e18, and squares of it can be added up
MOST = 50_000  # records of one kind that are looked at: an hour and a half of odometry at 10 Hz


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


@dataclass(slots=True)
class _Lists:
    t_s: list[float] = field(default_factory=list)
    values: list[F64] = field(default_factory=list)
    parts: list[int] = field(default_factory=list)

    def add(self, t_s: float, values: F64, part: int = 0) -> None:
        self.t_s.append(t_s)
        self.values.append(values)
        self.parts.append(part)

    @property
    def full(self) -> bool:
        return len(self.t_s) >= MOST

    def rows(self) -> F64:
        return np.array(self.values, np.float64).reshape(-1, 3)


def gather(path: Path, options: ReadingOptions) -> Gathered:
    """Read all but the pictures. Raises InputError if there is nothing to diagnose."""
    info = opened(path, options).info
    notes = ReadingNotes(keep_going=True)
    moved, went, truth, pictures = _Lists(), _Lists(), _Lists(), _Lists()
    falls, part, last_s, cut = 0, 0, -math.inf, False
    for record in raw_records(path, options, notes):
        falls += record.t_s < last_s
        last_s = max(last_s, record.t_s) if record.t_s >= last_s else record.t_s
        if isinstance(record, Motion):
            moved.add(record.t_s, record.motion)
        elif isinstance(record, OdometryPose):
            went.add(record.t_s, record.pose)
        elif isinstance(record, TruthPose):
            truth.add(record.t_s, record.pose, part)
        elif isinstance(record, Picture):
            pictures.add(record.t_s, np.zeros(3))
        else:
            part += record.text.startswith("kidnapped")
        if any(one.full for one in (moved, went, truth, pictures)):
            cut = True
            break
    odometry = moved if moved.t_s else went
    drive = RecordedDrive(
        RecordedOdometry(np.array(odometry.t_s), odometry.rows(), odometry is went),
        RecordedTruth(np.array(truth.t_s), truth.rows(), np.array(truth.parts, np.int32)),
        np.array(pictures.t_s),
        max(info.arena.size_m) if info.arena else math.inf,
        _gain(path, info),
    )
    first = str(notes.problems[0]) if notes.problems else ""
    return Gathered(info, drive, falls, notes.count, first, cut, notes.warnings)


def movement_apart(drive: RecordedDrive) -> float | None:
    """Return what the truth's times need to move when the odometry does; None if that is unknown."""
    truth, odometry = drive.truth, drive.odometry
    if truth.size < 2 or odometry.size < 2 or (np.diff(odometry.t_s) < 0).any() or truth.part.any():
        return None
    poses = odometry.values if odometry.poses else joined(odometry.values)
    found = offset_between(odometry.t_s, poses, truth.t_s, truth.poses)
    return None if found is None else found.offset_s


def raw_records(path: Path, options: ReadingOptions, notes: ReadingNotes) -> Iterator[Record]:
    """Yield a recording's records without checking that their numbers may be what they are."""
    return opened(path, options).records(notes)


def opened(path: Path, options: ReadingOptions) -> Recording:
    """Open a recording; a native log as it stands, put right by the options alone."""
    if chosen(path, options).name != NATIVE:
        return open_recording(path, options)
    return corrected(_RawLog(path, options), options)


class _RawLog:
    """A native log whose numbers may break the rules."""

    def __init__(self, path: Path, options: ReadingOptions) -> None:
        self.path = path
        self.info, kind = read_header(path)
        if kind != "session":
            advice = "expected a session log; `library check` is for those"
            raise InputError(path, f"found a {kind} log, {advice}", 1)
        self._camera = options.camera or next((one.name for one in self.info.cameras), None)
        self._per_s = PER_SECOND[options.time_unit or "s"]

    def records(self, notes: ReadingNotes) -> Iterator[Record]:
        """Yield what can be read at all, in the order of the lines."""
        taken = CameraChoice(self._camera, notes)
        for line in read_lines(self.path):
            if line.number == 1 or not line.data.strip():
                continue
            try:
                record = _raw(parse_object(line), line.number, self.path, taken)
            except (FieldError, TypeError, ValueError, OverflowError) as problem:
                if line.ended:
                    notes.problem(InputError(self.path, str(problem), line.number))
                continue
            if record is not None:
                yield replace(record, t_s=record.t_s / self._per_s)


def _raw(found: dict[str, object], number: int, path: Path, taken: CameraChoice) -> Record | None:
    """Read a line of the native log, with numbers of any size."""
    t_s = _finite(found.get("t"))
    if "odometry" in found:
        return Motion(t_s, _three(found["odometry"]))
    if "truth" in found:
        return TruthPose(t_s, _three(found["truth"]))
    if "event" in found:
        return Note(t_s, str(found["event"]))
    if "image" not in found or found.get("covered"):
        return None
    image = found["image"]
    inline = str(image.get("base64")) if isinstance(image, dict) else None
    camera = found.get("camera")
    named = None if camera is None else str(camera)
    record = PictureRecord(number, t_s, None if inline else str(image), inline, named, False, None)
    name = record.path or f"{path.name}:{number}"
    return Picture(t_s, partial(_read, record, path), name) if taken(record) else None


def _read(record: PictureRecord, log: Path) -> U8:
    return decode_picture(picture_bytes(record, log))


def _finite(value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not abs(value) < MOST_RAW:
        raise FieldError(f"found {value!r:.60}, expected a finite number")
    return float(value)


def _three(value: object) -> F64:
    if not isinstance(value, list) or len(value) != 3:
        raise FieldError(f"found {value!r:.60}, expected a list of 3 numbers")
    return np.array([_finite(v) for v in value])


def _gain(path: Path, info: SessionInfo) -> float:
    """Return the gain of turns that the header's motion model corrects for."""
    if not info.motion or info.motion.get("model", "maurice") != "maurice":
        return 1.0
    try:
        return MauriceParameters.from_header(info.motion).turn_gain
    except ValueError as problem:
        raise InputError(path, str(problem), 1) from None


# A session's pictures, compared with a library: some of them, over the whole drive.

MOST_PICTURES = 60
BETWEEN_S = 2.0  # pictures that come more often are passed over

Progress = Callable[[int, int], None]


def look(
    path: Path,
    options: ReadingOptions,
    library: Library,
    info: SessionInfo,
    drive: RecordedDrive,
    factor: float,
    progress: Progress | None = None,
) -> ComparedPictures:
    """Compare some pictures with a library, their times multiplied by `factor`.

    Raises InputError for a library without any of the channels wanted.
    """
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
    return build_localizer(library, _Named(info), parameters)


def _pictures(path: Path, options: ReadingOptions, stride: int) -> Iterator[tuple[float, U8]]:
    """Yield time and pixels of every first, second, ... picture; those that cannot be read are left out."""
    records = raw_records(path, options, ReadingNotes(keep_going=True))
    pictures = (record for record in records if isinstance(record, Picture))
    for picture in islice(pictures, 0, None, stride):
        with suppress(PictureError):
            yield picture.t_s, picture.read()


@dataclass(frozen=True, slots=True)
class _Named:
    """What a localizer wants to know of a session: its header."""

    info: SessionInfo

    def moments(self) -> Iterator[Moment]:
        """Nothing is replayed here."""
        return iter(())
