"""A recording without pictures as a native log, record by record at their own times."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from maurice_mcl.typing import F64

from .errors import LogError
from .export_session import Converted, beside
from .export_steps import filling
from .findings import Findings
from .recording import (
    Motion,
    Note,
    OdometryPose,
    Record,
    Recording,
    TruthPose,
    checked,
    motion_between,
)
from .session_writer import SessionWriter


def records_to_log(
    recording: Recording, file: Path, findings: Findings, *, t_offset_s: float = 0.0, force: bool = False
) -> Iterator[Converted]:
    """Write odometry, truth and events of a recording as a native log; gives the counts after every record.

    Odometry poses become the motions between them. Pictures are left out. LogError as for `filling`, and
    when there was nothing to write.
    """
    done = Converted()
    last: F64 | None = None
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
    except OSError as problem:
        raise LogError(file, f"cannot be written: {problem.strerror}; choose another place") from None
    with filling(file, force=force) as part:
        with SessionWriter(part, beside(recording.info, file), force=True) as log:
            for record in checked(recording, findings):
                last = _write_line(log, record, record.t_s + t_offset_s, last, done)
                yield done
        _expect_records(done, recording.path)


def _write_line(
    log: SessionWriter, record: Record, t_s: float, last: F64 | None, done: Converted
) -> F64 | None:
    """Write one record; gives the last odometry pose."""
    if isinstance(record, OdometryPose):
        if last is not None:
            log.odometry(t_s, motion_between(last, record.pose))
            done.motions += 1
        return record.pose
    if isinstance(record, Motion):
        log.odometry(t_s, record.motion)
        done.motions += 1
    elif isinstance(record, TruthPose):
        log.truth(t_s, record.pose)
        done.truths += 1
    elif isinstance(record, Note):
        log.event(t_s, record.text)
        done.events += 1
    return last


def _expect_records(done: Converted, path: Path) -> None:
    if not (done.motions or done.truths or done.events):
        raise LogError(path, "found nothing to write, expected pictures, odometry or truth")
