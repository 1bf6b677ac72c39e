"""A recording of any format as a native session log, which replays to the last bit, or as MCAP."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from maurice_mcl.values import F64, Moment, Session, SessionInfo, compose, inverse, motion_between

from ..bags.readers import MOTIONS, READINGS
from ..errors import InputError, ReadingNotes
from ..files.pictures import PictureKind, encode_picture
from ..files.writing import FolderKind, check_target, discard, expect_absent, filling, scratch_folder, writing
from ..reading.observations import observed_in
from ..reading.recording import (
    PLACEHOLDER,
    LeftOut,
    Motion,
    Note,
    OdometryPose,
    Picture,
    Readings,
    Record,
    Recording,
    Scan,
    SimplifiedPath,
    TruthPose,
    checked,
)
from ..reading.session import RecordedSession
from ..session_log.header import FORMAT, header_to_json
from ..session_log.writer import SessionWriter
from .mcap import (
    EVENTS,
    MAP,
    MOST_POSES,
    ODOM,
    ODOMETRY,
    ROBOT,
    TF,
    TRUE_PATH,
    TRUTH,
    McapScene,
    McapWriter,
    ScanTopic,
    mcap_file,
    scene_of,
)

NOTHING = "found nothing to write, expected pictures, scans, odometry or truth"
PICTURE = r"\d{5,}\.(?:png|jpg)"  # name of a picture that is written here


COUNTED: dict[type[Record], str] = {
    Picture: "pictures",
    Motion: "motions",
    OdometryPose: "motions",
    TruthPose: "truths",
    Note: "events",
    Readings: "readings",
    Scan: "scans",
}


@dataclass(slots=True)
class Converted:
    """How much was written so far, and at the end what was read and has no place in the file."""

    pictures: int = 0
    motions: int = 0
    truths: int = 0
    events: int = 0
    readings: int = 0
    scans: int = 0
    left_out: dict[str, int] = field(default_factory=dict)  # records by what they are
    last_s: float = math.inf  # session time of the last picture, where records go with pictures

    def to_json(self) -> dict[str, Any]:
        """Return the counts as JSON."""
        return {name: value for name, value in asdict(self).items() if name != "last_s"}

    def add(self, record: Record) -> None:
        """Count one more record, unless it is a picture that stands where there is none."""
        name = COUNTED.get(type(record))
        if name is not None and getattr(record, "name", "") != PLACEHOLDER:
            setattr(self, name, getattr(self, name) + 1)

    def count(self, moment: Moment) -> None:
        """Count one more update."""
        self.pictures += 1
        self.last_s = moment.frame.time_s
        self.motions += len(moment.frame.motions)
        self.truths += moment.truth is not None
        self.events += len(moment.events)
        self.readings += bool(moment.frame.readings)
        self.scans += moment.frame.scan is not None


def pictures_of(file: Path) -> Path:
    """Return the folder of a converted log's pictures."""
    return file.with_name(f"{file.stem}-pictures")


def convert_to_log(
    session: Session, file: Path, *, kind: PictureKind = "png", begin_s: float = 0.0, force: bool = False
) -> Iterator[Converted]:
    """Write a native log, pictures in `<stem>-pictures` beside it; yield the counts after every picture.

    Both appear when all went well. InputError if they exist, unless `force`, or as reading raises it.
    """
    pictures = pictures_of(file)
    kind_of = FolderKind("the pictures of this log", f"../{file.name}", FORMAT, PICTURE)
    expect_absent(file, force=force, form=FORMAT)
    check_target(pictures, kind_of, force=force)
    with scratch_folder(file) as folder, writing(file):
        (folder / pictures.name).mkdir()
        info, converted = beside(session.info, file), Converted()
        with SessionWriter(folder / file.name, info) as log:
            for moment in session.moments():
                name = f"{pictures.name}/{moment.frame.step:05d}.{'jpg' if kind == 'jpeg' else 'png'}"
                (folder / name).write_bytes(encode_picture(moment.frame.image, kind))
                _write_moment(log, moment, name, begin_s, first=not converted.pictures)
                converted.count(moment)
                yield converted
        if not converted.pictures:
            advice = "expected some; is it the right camera or topic?"
            raise InputError(file, f"found no picture to write, {advice}")
        if pictures.is_dir():
            discard(pictures)
        (folder / pictures.name).replace(pictures)
        (folder / file.name).replace(file)


def _write_moment(log: SessionWriter, moment: Moment, picture: str, begin_s: float, *, first: bool) -> None:
    """Write what came before a picture at its time; the drive's very first record keeps the time 0."""
    t_s = moment.frame.time_s + begin_s
    opening_s = begin_s if first else t_s
    for text in moment.events:
        log.event(opening_s, text)
    for number, motion in enumerate(moment.frame.motions):
        log.odometry(opening_s if number == 0 else t_s, motion)
    if moment.truth is not None:
        if first and not moment.events and not len(moment.frame.motions):
            log.truth(opening_s, moment.truth)
        log.truth(t_s, moment.truth)
    if moment.frame.readings:
        log.reading(t_s, moment.frame.readings)
    if moment.frame.scan is not None:
        log.scan(t_s, moment.frame.scan)
    log.image_path(t_s, picture)


def beside(info: SessionInfo, file: Path) -> SessionInfo:
    """Return a header's facts with the survey's path as seen from the log that will be at `file`."""
    survey = header_to_json(info, "session", file.parent).get("survey")
    return info if survey is None else replace(info, survey=Path(survey))


def left_out(recording: Recording, done: Converted) -> dict[str, int]:
    """Count what a recording holds and a converted file does not; it is read once more, without pictures.

    A log with pictures has everything at the pictures that make a step, as a replay sees it.
    """
    total, begin_s, covered, encoders, late = Converted(), None, 0, 0, 0
    for record in checked(recording, ReadingNotes(keep_going=True)):
        begin_s = record.t_s if begin_s is None else begin_s
        covered += isinstance(record, LeftOut) and record.picture.covered
        encoders += isinstance(record, Motion) and record.encoders_m is not None
        late += isinstance(record, Motion | OdometryPose) and record.t_s - begin_s > done.last_s
        total.add(record)
    counts = {
        "pictures that no step uses": total.pictures - done.pictures,
        "motions after the last picture": late,
        "true poses between pictures": total.truths - done.truths,
        "events after the last picture": total.events - done.events,
        "readings that newer ones replace": total.readings - done.readings,
        "scans that no step uses": total.scans - done.scans,
        "covered pictures": covered,
        "raw distances of wheels": encoders,
    }
    return {what: count for what, count in counts.items() if count > 0}


# A recording without pictures as a native log, record by record at their own times.


def records_to_log(
    recording: Recording, file: Path, notes: ReadingNotes, *, force: bool = False
) -> Iterator[Converted]:
    """Write all records as a log; yield counts. InputError as for `filling`.

    Odometry poses become motions, but beside scans, which are between poses.
    """
    converted, poses = Converted(), observed_in(recording).scans
    before: F64 | None = None  # the last pose (3,) of the odometry
    with writing(file):
        file.parent.mkdir(parents=True, exist_ok=True)
    with filling(file, force=force, form=FORMAT) as part:
        with SessionWriter(part, beside(recording.info, file), force=True) as log:
            for record in checked(recording, notes):
                if isinstance(record, OdometryPose) and not poses:
                    last, before = before, record.pose
                    if last is None:
                        continue
                    record = Motion(record.t_s, motion_between(last, record.pose))
                elif isinstance(record, Motion):
                    record = replace(record, encoders_m=None)
                if not isinstance(record, Picture | LeftOut):
                    log.add(record)
                    converted.add(record)
                yield converted
        if not (
            converted.motions or converted.truths or converted.events or converted.readings or converted.scans
        ):
            raise InputError(recording.path, NOTHING)


# A recording of any format as an MCAP file of ROS 2 messages, record by record at their own times.


def convert_to_mcap(
    session: RecordedSession,
    file: Path,
    *,
    camera: str | None = None,
    kind: PictureKind = "png",
    force: bool = False,
) -> Iterator[Converted]:
    """Write used pictures and all else; yield counts. InputError as for `mcap_file`."""
    begin_s: float | None = None
    with mcap_file(file, force=force) as mcap:
        drive = DriveWriter(mcap, scene_of(session.info, camera), kind, odometry=session.odometry is not None)
        for record, moment in _side_by_side(session):
            if begin_s is None:
                begin_s = record.t_s
                drive.begin(begin_s)
            drive.add(record, moment)
            yield drive.done
        if begin_s is None:
            raise InputError(session.path, NOTHING)
        drive.end(begin_s)


def _side_by_side(session: RecordedSession) -> Iterator[tuple[Record, Moment | None]]:
    """Yield all records but unused pictures, used ones with their moments; the recording is read twice."""
    records = checked(session.recording, ReadingNotes(keep_going=True))  # the session itself reports problems
    begin_s: float | None = None
    for moment in session.moments():
        for record in records:
            begin_s = record.t_s if begin_s is None else begin_s
            if not isinstance(record, Picture):
                yield record, None
            elif (record.name, record.t_s - begin_s) == (moment.frame.picture, moment.frame.time_s):
                yield record, moment
                break
    yield from ((record, None) for record in records if not isinstance(record, Picture))


class DriveWriter:
    """Writes a drive's records, and the transforms that place the robot accordingly."""

    def __init__(self, mcap: McapWriter, scene: McapScene, kind: PictureKind, *, odometry: bool) -> None:
        self.done = Converted()
        self._mcap, self._scene, self._kind = mcap, scene, kind
        start = None if scene.info is None else scene.info.start
        self._odometry = np.zeros(3)
        self._correction = np.zeros(3) if start is None else np.asarray(start)  # odometry's frame in the map
        # without odometry there is no frame of it, which readers would take for odometry
        self._links = (ODOM, ROBOT) if odometry else (ROBOT,)
        self._moved = self._in_motions = False  # whether any odometry came, and whether as motions
        self._odometry_s = -math.inf  # when it was written last
        self._scans = ScanTopic(mcap)
        self._due_s: float | None = None  # when the transforms changed that are not written yet
        self._path = SimplifiedPath(MOST_POSES)

    def begin(self, begin_s: float) -> None:
        """Write the constant content and the initial pose."""
        self._scene.write(self._mcap, begin_s)
        self._due_s = begin_s

    def add(self, record: Record, moment: Moment | None) -> None:
        """Write one record, a picture by its moment."""
        t_s = record.t_s
        self.done.add(record)
        if self._due_s is not None and t_s > self._due_s:
            self._write_transforms()
        make = self._mcap.at(t_s)
        if isinstance(record, Motion):
            if not self._moved:  # readers take motions from pose to pose
                self._write_odometry(t_s)
            self._in_motions = True
            self._mcap.write(MOTIONS, t_s, make.motion(ROBOT, record.motion))
            self._move(t_s, compose(self._odometry, record.motion))
        elif isinstance(record, OdometryPose):
            if not self._moved:  # the robot keeps its known pose, wherever its odometry begins
                here, self._odometry = compose(self._correction, self._odometry), record.pose
                self._place(here)
            self._move(t_s, record.pose)
        elif isinstance(record, TruthPose):
            self._mcap.write(TRUTH, t_s, make.pose(MAP, record.pose))
            self._path.add(record.pose)
            self._place(record.pose)
            self._due_s = t_s
        elif isinstance(record, Note):
            self._mcap.write(EVENTS, t_s, make.text(record.text))
        elif isinstance(record, Readings):
            self._mcap.write(READINGS, t_s, make.readings(record.values))
        elif isinstance(record, Scan):
            self._scans.write(t_s, record.scan)
        elif isinstance(record, Picture) and moment is not None and record.name != PLACEHOLDER:
            if self._in_motions and t_s > self._odometry_s:  # other readers pair by time
                self._write_odometry(t_s)
            self._scene.write_picture(self._mcap, t_s, moment.frame.image, self._kind)

    def end(self, begin_s: float) -> None:
        """Write what is known only at the end."""
        if self._due_s is not None:
            self._write_transforms()
        self._mcap.write_path(TRUE_PATH, begin_s, self._path)

    def _move(self, t_s: float, odometry: F64) -> None:
        self._odometry, self._moved, self._due_s = odometry, True, t_s
        self._write_odometry(t_s)

    def _write_odometry(self, t_s: float) -> None:
        self._mcap.write(ODOMETRY, t_s, self._mcap.at(t_s).odometry(ODOM, ROBOT, self._odometry))
        self._odometry_s = t_s

    def _place(self, pose: F64) -> None:
        self._correction = compose(pose, inverse(self._odometry))

    def _write_transforms(self) -> None:
        if self._due_s is not None:
            frames = zip((MAP, *self._links), self._links, (self._correction, self._odometry), strict=False)
            self._mcap.write(TF, self._due_s, self._mcap.at(self._due_s).transforms(*frames))
        self._due_s = None
