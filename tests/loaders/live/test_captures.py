"""Captures: what a live run was, its replay is, with what was skipped, and where it began."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from helpers.live_peers import HEADER, line, log, peer, says, update
from helpers.recordings import assert_same_drive
from maurice_loaders.formats.registry import open_session
from maurice_loaders.live import source as live_source_module
from maurice_loaders.live.session import ListenOptions, LiveRecorder, LiveSession
from maurice_loaders.live.source import Patience, live_source
from maurice_loaders.reading.observations import Gate
from maurice_loaders.reading.options import Reading
from maurice_mcl.values.session import Moment

SOON = Patience(0.5)
FEW_S = 0.05  # a filter that takes so long for each of these pictures


@pytest.fixture(autouse=True)
def _quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live_source_module, "POLL_S", 0.02)
    monkeypatch.setattr(live_source_module, "LONGEST_WAIT_S", 0.1)


class Came:
    """Moments that came, as a session."""

    def __init__(self, session: LiveSession, moments: list[Moment]) -> None:
        self.info, self._moments = session.info, moments

    def moments(self) -> Iterator[Moment]:
        return iter(self._moments)


def slowly(said: bytes, folder: Path, gate: Gate | None = None) -> Came:
    """Take moments from a source that sends all at once, each slowly."""
    listen = ListenOptions(keep_up=True, patience=SOON, gate=gate)
    moments = []
    with peer(says(said)) as address:
        with LiveSession(live_source(address), listen, LiveRecorder(folder)) as session:
            for moment in session.moments():
                moments.append(moment)
                time.sleep(FEW_S)
        assert session.skipped
    return Came(session, moments)


def test_what_a_live_run_skipped_its_capture_skips(tmp_path: Path) -> None:
    said = log([0]) + line(0.5, event="bump") + b"".join(update(t, 0.1 * t) for t in range(1, 40))
    came = slowly(said, tmp_path)
    moments = list(came.moments())
    told = [text for moment in moments for text in moment.events if text.startswith("skipped")]
    counts = [int(text.split()[1]) for text in told]
    assert sum(counts) == 40 - len(moments)
    assert told == [
        f"skipped: {count} picture{'s' * (count > 1)}: the filter was too slow" for count in counts
    ]
    again = open_session(tmp_path / "session.log")
    assert_same_drive(again, came)
    assert again.overview() == (len(moments), False)
    # the lines of all pictures are there: without the header's word all of them are used
    text = (tmp_path / "session.log").read_text()
    (tmp_path / "all.log").write_text(text.replace('"captured": true', '"captured": false', 1))
    assert sum(1 for _ in open_session(tmp_path / "all.log").moments()) == 40


def test_what_a_live_run_with_a_gate_skipped_its_capture_skips(tmp_path: Path) -> None:
    said = log(t / 4 for t in range(120))  # 0.1 m each
    came = slowly(said, tmp_path, Gate(0.25))
    options = Reading(min_distance_m=0.25, min_angle_rad=0.0)
    assert_same_drive(open_session(tmp_path / "session.log", options), came)


STARTED = json.dumps(json.loads(HEADER) | {"start": [1.0, 2.0, 0.5]})


@pytest.mark.parametrize(
    ("begin_s", "holds", "knows"), [(0, False, True), (60, False, False), (60, True, True)]
)
def test_a_capture_of_a_drive_that_was_joined_late_has_no_start_pose(
    begin_s: int, holds: bool, knows: bool, tmp_path: Path
) -> None:
    listen = ListenOptions(keep_up=False, patience=SOON, start_holds=holds)
    with peer(says(log(range(begin_s, begin_s + 3), STARTED))) as address:
        with LiveSession(live_source(address), listen, LiveRecorder(tmp_path)) as session:
            moments = list(session.moments())
        assert session.joined_late is not knows
    again = open_session(tmp_path / "session.log")
    assert_same_drive(again, Came(session, moments))
    assert (again.info.start is not None) is knows
    late = ["captured from 60 s into the drive on: where it began is not told"]
    assert list(again.info.notes) == ([] if knows else late)


def test_a_capture_without_any_record_has_its_header(tmp_path: Path) -> None:
    with (
        peer(says(log([]))) as address,
        LiveSession(live_source(address), ListenOptions(patience=SOON), LiveRecorder(tmp_path)) as session,
    ):
        assert list(session.moments()) == []
    assert open_session(tmp_path / "session.log").info.name == "live"
