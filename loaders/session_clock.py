"""When a session began, on the clock of the recording itself; a session counts from there."""

from __future__ import annotations

from .findings import Findings
from .log_records import read_records
from .recorded_session import RecordedSession
from .recording import checked
from .session_log import SessionLog


def begin_of(session: SessionLog | RecordedSession) -> float:
    """Give the time in seconds of the first record; 0 where there is none. LogError as reading raises it."""
    findings = Findings(keep_going=True)
    if isinstance(session, SessionLog):
        line = next(read_records(session.path, "session", findings), None)
        return 0.0 if line is None else line.t_s
    record = next(checked(session.recording, findings), None)
    return 0.0 if record is None else record.t_s
