"""A folder of pictures with files of odometry and truth beside it, merged by time."""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from maurice_mcl.session import SessionInfo

from .clock_offset import offset_between
from .errors import LogError
from .findings import Findings
from .picture_lists import PictureList
from .pose_files import PoseFile
from .recording import Record
from .time_bases import Span, apart

SLACK_S = 1.0  # spans that miss each other by less are of one clock


@dataclass(frozen=True, eq=False)
class TimedFolder:
    """Pictures, odometry and truth, each a file of its own with times; any of them may be missing."""

    path: Path
    info: SessionInfo
    pictures: PictureList | None
    odometry: PoseFile | None
    truth: PoseFile | None
    remarks: tuple[str, ...] = ()  # said at every reading

    def check(self) -> TimedFolder:
        """Read the first row of every file. LogError where one is broken or all are missing."""
        if self.pictures is None and self.odometry is None and self.truth is None:
            raise LogError(self.path, "found neither pictures nor poses in it")
        for file in (self.odometry, self.truth):
            if file is not None:
                file.check()
        return self

    def records(self, findings: Findings) -> Iterator[Record]:
        """Merge all by time: poses before the pictures of the same time."""
        for text in self.remarks:
            findings.warning(text)
        streams: list[Iterator[Record]] = []
        if self.odometry is not None:
            streams.append(self.odometry.poses(findings))
        if self.truth is not None and self._one_clock(self.truth, findings):
            streams.append(self.truth.poses(findings))
        if self.pictures is not None:
            streams.append(self.pictures.pictures(findings))
        return heapq.merge(*streams, key=lambda record: record.t_s)

    def _one_clock(self, truth: PoseFile, findings: Findings) -> bool:
        """Tell whether truth is of the time of pictures or odometry; say what would help when it is not."""
        main = self.pictures or self.odometry
        if main is None or not main.span.count or main.span.overlaps(truth.span, SLACK_S):
            return True
        name = "pictures" if self.pictures is not None else "odometry"
        where = apart(name, main.span, "truth", truth.span)
        advice = f"the clocks disagree, so truth is left out; {self._offset(truth, main.span)}"
        findings.warning(f"{truth.file}: {where}; {advice}")
        return False

    def _offset(self, truth: PoseFile, main: Span) -> str:
        """Say what would bring the truth's clock to the other: by the movement, else by the beginnings."""
        odometry = self.odometry
        if odometry is not None and (odometry.span.overlaps(main, SLACK_S)):
            found = offset_between(*odometry.track(), *truth.track())
            if found is not None:
                alike = f"its movement is most like the odometry's (correlation {found.correlation:.2f}) with"
                return f"{alike} --truth-offset {found.offset_s + truth.offset_s:.6f}"
        together = f"--truth-offset {main.first_s - truth.span.first_s + truth.offset_s:.6f}"
        no_help = "" if odometry is None else "movement does not tell how far; "
        return f"{no_help}if both begin together, use {together}"
