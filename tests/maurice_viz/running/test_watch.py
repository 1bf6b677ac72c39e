"""What a live run says while it goes on, over a real socket, and what it does when it is lost."""

from __future__ import annotations

import base64
import json
import re
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from helpers.commands import run
from helpers.live_peers import peer, says
from helpers.run_tables import scored_table
from maurice_mcl.reasons.verdict import RunVerdict
from maurice_mcl.scoring.episodes import standing
from maurice_mcl.scoring.metrics import StepScore
from maurice_mcl.scoring.table import PROBABLY_LOCALIZED, Standing
from maurice_viz.errors import OptionError
from maurice_viz.running.watch import KEEPS_UP, MEASURED_STEPS, LossCommand, Watch, WriteRate
from maurice_viz.text.verdict import now_line


class Heard:
    """Keeps what it hears."""

    def __init__(self) -> None:
        self.remarks: list[str] = []
        self.warnings: list[str] = []

    def remark(self, text: str) -> None:
        self.remarks.append(text)

    def warning(self, text: str) -> None:
        self.warnings.append(text)

    def progress(self, done: int, total: int, what: str) -> None:
        pass


RIGHT = StepScore(0.01, 0.0, True, correct=True, lost=False)
OFF = replace(RIGHT, error_m=3.0, correct=False, lost=True)
BLIND = StepScore(None, None, True, None, None)


def standings(scores: Sequence[StepScore], **columns: Any) -> list[Standing | None]:
    """How a run stands at each of its updates."""
    so_far = range(1, len(scores) + 1)
    parts = ({name: column[:end] for name, column in columns.items()} for end in so_far)
    return [standing(scored_table(scores[:end], **part)) for end, part in zip(so_far, parts, strict=True)]


def test_with_truth_a_run_stands_as_its_episodes_tell() -> None:
    found = standings([*[RIGHT] * 10, *[OFF] * 6, *[RIGHT] * 6], kidnapped=np.arange(1, 23) == 11)
    assert found[3] == Standing("searching", 1)
    assert found[9] == Standing("localized", 1)
    assert found[10] == Standing("kidnapped", 11)
    assert found[13] == Standing("lost", 11)
    assert found[-1] == Standing("localized", 17)
    lost = [standing.is_lost for standing in found if standing]
    assert lost == [False] * 13 + [True] * 7 + [False] * 2  # known at the fourth, and at the fifth right one


def test_without_truth_the_lost_signal_tells() -> None:
    probabilities = np.array([0.2, 0.2, 0.8, 0.4, 0.8, 0.01, 0.3, 0.9])
    doubted = np.isin(np.arange(8), [5, 6])  # below the alarm, until it knows again
    found = standings([BLIND] * 8, knows=probabilities, doubted=doubted)
    states = ["searching"] * 2 + [PROBABLY_LOCALIZED] * 3 + ["probably-lost"] * 2 + [PROBABLY_LOCALIZED]
    assert [(standing.state, standing.since) for standing in found if standing] == list(
        zip(states, [1, 1, 3, 3, 3, 6, 6, 8], strict=True)
    )


def test_the_headline_of_a_live_drive_begins_with_now() -> None:
    lost, back = (RunVerdict(now=now) for now in (Standing("probably-lost", 41), Standing("localized", 43)))
    assert now_line({"a": back}) == "Now: localized, since step 43. "
    assert now_line({"a": lost, "b": back}) == (
        "Now: `a` probably lost, since step 41; `b` localized, since step 43. "
    )
    assert now_line({"a": RunVerdict()}) == ""


class _Moment:
    def __init__(self, step: int, skipped: int = 0) -> None:
        self.frame, self.events = self, (f"skipped: {skipped} pictures: x",) if skipped else ()
        self.step = step


class _Collector:
    def __init__(self) -> None:
        self.now: dict[str, Standing | None] = {}

    def standings(self) -> Mapping[str, Standing | None]:
        return self.now

    def verdicts(self) -> Mapping[str, RunVerdict]:
        return {label: RunVerdict() for label in self.now}


def test_each_run_says_what_changes_with_its_label_and_nothing_twice() -> None:
    heard, collector = Heard(), _Collector()
    watch = Watch(heard, clock=lambda: "12:04:31")
    for step in range(1, 31):
        lost = Standing("lost", 10) if 10 <= step < 20 else Standing("localized", 1 if step < 20 else 20)
        collector.now = {"a": lost, "b": Standing("searching", 1), "c": None}
        watch.see({label: (_Moment(step), None) for label in collector.now}, collector)  # type: ignore
    assert heard.remarks == [
        "a: 12:04:31 step 1 localized",
        "b: 12:04:31 step 5 searching",
        "a: 12:04:31 step 10 lost",
        "a: 12:04:31 step 20 localized again",
    ]


def test_skipping_is_said_when_it_begins_and_when_it_ends() -> None:
    heard, collector = Heard(), _Collector()
    watch = Watch(heard, clock=lambda: "12:04:31")
    for step in range(1, 2 * KEEPS_UP):
        watch.see({"a": (_Moment(step, 3 if step in (5, 7) else 0), None)}, collector)  # type: ignore
    begins, ends = heard.remarks
    slow = r"12:04:31 step 5 skips pictures \(the filter is slower than the robot: .* step; .*\)"
    assert re.fullmatch(slow, begins)
    assert ends == f"12:04:31 step {7 + KEEPS_UP} keeps up again (6 skipped so far)"


def test_how_fast_a_file_grows_is_measured_and_said_once(monkeypatch: pytest.MonkeyPatch) -> None:
    now = iter(range(0, 100_000, 2))
    monkeypatch.setattr(time, "monotonic", lambda: float(next(now)))
    sizes = iter(range(5_000, 10**12, 21_000_000))
    heard = Heard()
    rate = WriteRate(Path("live.rrd"), lambda: next(sizes), {"--detail light": 0.05}, heard)
    for _ in range(3 * MEASURED_STEPS):
        rate.see()
    # 21 MB between the first and the last look, 18 s apart
    assert heard.remarks == ["live.rrd grows by about 4.2 GB an hour; --detail light writes 0.21"]


@pytest.mark.parametrize("typed", ["", "  ", "echo 'a"])
def test_what_is_no_command_is_refused(typed: str) -> None:
    with pytest.raises(OptionError, match=r"--on-lost: found .*expected a command"):
        LossCommand(typed, Heard())


def waited(heard: Heard) -> list[str]:
    until = time.monotonic() + 20
    while not heard.warnings and time.monotonic() < until:
        time.sleep(0.01)
    return heard.warnings


def test_a_command_that_fails_or_is_not_there_is_one_line() -> None:
    heard = Heard()
    LossCommand(f"{sys.executable} -c 'raise SystemExit(4)'", heard).run("a", 1, "lost")
    assert waited(heard) == [f"--on-lost: {sys.executable} -c 'raise SystemExit(4)' failed with status 4"]
    heard = Heard()
    LossCommand("no-such-command $HOME", heard).run("a", 1, "lost")
    assert waited(heard) == ["--on-lost: no-such-command does not start: No such file or directory"]


def said_by(session: Path, *, elsewhere_from: int) -> bytes:
    """The drive with pictures inside, whose truth from a step on is where the filter is not."""
    lines, step = [], 0
    for text in session.read_bytes().splitlines():
        record = json.loads(text)
        if isinstance(record.get("image"), str):
            step += 1
            data = base64.b64encode((session.parent / record["image"]).read_bytes()).decode()
            record["image"] = {"base64": data}
        if "truth" in record and step >= elsewhere_from:
            record["truth"][0] += 5.0
        lines.append(json.dumps(record).encode() + b"\n")
    return b"".join(lines)


@pytest.fixture
def nowhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_loss_is_said_runs_a_command_and_gives_a_status(small_session: Path, nowhere: Path) -> None:
    library = small_session.parent / "survey.log"
    names = "('MAURICE_RUN', 'MAURICE_STEP', 'MAURICE_TEXT')"
    code = f"import os; open('told', 'a').write(' '.join(map(os.environ.get, {names})))"
    command = f'{sys.executable} -c "{code}"'
    words = ["--library", library, "--patience", "0.5", "-o", "none", "--json", "--every-picture"]
    with peer(says(said_by(small_session, elsewhere_from=7))) as address:
        done = run(address, *words, "--on-lost", command, expect=3)
    lines = [line for line in done.stderr.splitlines() if re.match(r"\d\d:\d\d:\d\d step", line)]
    assert [line.split(" ", 1)[1].split(" (")[0] for line in lines] == ["step 5 localized", "step 10 lost"]
    until = time.monotonic() + 20
    while not (told := nowhere / "told").exists() and time.monotonic() < until:
        time.sleep(0.01)
    time.sleep(0.2)
    assert told.read_text().startswith("blended 10 lost")
    assert json.loads(done.stdout)["runs"][0]["label"] == "blended"
    with peer(says(said_by(small_session, elsewhere_from=7))) as address:
        run(address, *words)  # only who asks for it gets the status
    with peer(says(said_by(small_session, elsewhere_from=99))) as address:
        run(address, *words, "--on-lost", command)


def test_a_command_at_a_loss_needs_a_live_source(small_session: Path, nowhere: Path) -> None:
    done = run(small_session, "--on-lost", "true", expect=2)
    assert "need a live source" in done.stderr


def test_an_address_with_one_slash_is_told(nowhere: Path) -> None:
    for typed in ("ws:/robot:8765", "tcp:robot:5005"):
        for words in ([typed], ["replay", typed], ["record", typed, "-o", "rec"]):
            done = run(*words, expect=1)
            assert "expected two slashes, as in" in done.stderr
