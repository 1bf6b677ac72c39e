"""A recording of any format as an MCAP file of ROS 2 messages, record by record at their own times.

The file holds what the filter uses of the recording: header, pictures, and motions to the last bit where they
came as such, poses otherwise; also truth and events.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from maurice_mcl.arrays import F64
from maurice_mcl.geometry import compose, motion_between
from maurice_mcl.session import Moment

from ..bags.readers import MOTIONS
from ..errors import InputError
from ..io.notes import ReadingNotes
from ..recorded_session import RecordedSession
from ..recording import Motion, Note, OdometryPose, Picture, Record, TruthPose, checked
from .mcap import EVENTS, MAP, ODOM, ODOMETRY, ROBOT, TF, TRUE_PATH, TRUTH, McapWriter, mcap_file
from .run import McapScene, new_path, scene_of, write_paths
from .session import Converted, PictureKind


def convert_to_mcap(
    session: RecordedSession,
    file: Path,
    *,
    camera: str | None = None,
    kind: PictureKind = "png",
    t_offset_s: float = 0.0,
    force: bool = False,
) -> Iterator[Converted]:
    """Write the pictures that make an update, and all odometry, truth and events; yield growing counts.

    InputError as for `mcap_file`, as the session's reading raises it, and when there was nothing to write.
    """
    begin_s: float | None = None
    with mcap_file(file, force=force) as mcap:
        drive = DriveWriter(mcap, scene_of(session.info, camera), kind, odometry=session.odometry is not None)
        for record, moment in _side_by_side(session):
            t_s = record.t_s + t_offset_s
            if begin_s is None:
                begin_s = t_s
                drive.begin(t_s)
            drive.add(record, t_s, moment)
            yield drive.done
        if begin_s is None:
            raise InputError(session.path, "found nothing to write, expected pictures, odometry or truth")
        drive.end(begin_s)


def _side_by_side(session: RecordedSession) -> Iterator[tuple[Record, Moment | None]]:
    """Yield all records except unused pictures; used pictures with their moments.

    The recording is read twice in parallel: a session looks ahead for truth, and keeps nothing it passed.
    """
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
        self._due_s: float | None = None  # when the transforms changed that are not written yet
        self._path = new_path()

    def begin(self, begin_s: float) -> None:
        """Write the constant content and the initial pose."""
        self._scene.write(self._mcap, begin_s)
        self._due_s = begin_s

    def add(self, record: Record, t_s: float, moment: Moment | None) -> None:
        """Write one record, a picture by its moment."""
        if self._due_s is not None and t_s > self._due_s:
            self._write_transforms()
        make = self._mcap.at(t_s)
        if isinstance(record, Motion):
            self._begin_path(t_s)
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
            self.done.truths += 1
        elif isinstance(record, Note):
            self._mcap.write(EVENTS, t_s, make.text(record.text))
            self.done.events += 1
        elif moment is not None:
            self._stand(t_s)
            self._scene.write_picture(self._mcap, t_s, moment.frame.image, self._kind)
            self.done.pictures += 1

    def end(self, begin_s: float) -> None:
        """Write what is known only at the end."""
        if self._due_s is not None:
            self._write_transforms()
        write_paths(self._mcap, begin_s, {TRUE_PATH: self._path})

    def _begin_path(self, t_s: float) -> None:
        """Write the first pose of a path of motions; readers take motions from pose to pose."""
        if not self._moved:
            self._write_odometry(t_s)

    def _move(self, t_s: float, odometry: F64) -> None:
        self._odometry, self._moved, self._due_s = odometry, True, t_s
        self._write_odometry(t_s)
        self.done.motions += 1

    def _stand(self, t_s: float) -> None:
        """Repeat the odometry at a picture after the last motion; other readers pair by time."""
        if self._in_motions and t_s > self._odometry_s:
            self._write_odometry(t_s)

    def _write_odometry(self, t_s: float) -> None:
        self._mcap.write(ODOMETRY, t_s, self._mcap.at(t_s).odometry(ODOM, ROBOT, self._odometry))
        self._odometry_s = t_s

    def _place(self, pose: F64) -> None:
        """Place the robot in the map: that gives the pose of the odometry frame."""
        self._correction = compose(pose, motion_between(self._odometry, np.zeros(3)))

    def _write_transforms(self) -> None:
        if self._due_s is not None:
            frames = zip((MAP, *self._links), self._links, (self._correction, self._odometry), strict=False)
            self._mcap.write(TF, self._due_s, self._mcap.at(self._due_s).transforms(*frames))
        self._due_s = None
