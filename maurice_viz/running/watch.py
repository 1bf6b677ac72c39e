"""What a live run says while it goes on: a line when its state changes, a command when it is lost."""

from __future__ import annotations

import os
import shlex
import subprocess
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from maurice_mcl.reasons.causes import UNKNOWN
from maurice_mcl.scoring.comparison import Step
from maurice_mcl.scoring.table import SEARCHING, Standing
from maurice_mcl.values import skipped_before

from ..errors import Listener, OptionError
from ..playback import ResultCollector
from ..scene import Detail, RunView
from .output import Output

FEW = 5  # steps of searching before a line about it: every run begins with a search
KEEPS_UP = 20  # steps without a skipped picture, after which a line says that the filter keeps up
MEASURED_S, MEASURED_STEPS = 10.0, 10  # after which the rate is known
LARGE_BYTES_A_HOUR = 500_000_000
GB = 1e9


@dataclass(slots=True)
class WriteRate:
    """Measures how fast a file grows, and says so once, early, where that is much."""

    path: Path  # as people know it
    size: Callable[[], int]  # of what is written so far, in bytes
    smaller: Mapping[str, float]  # by the option that writes less: its share of the bytes
    listener: Listener
    _begun: tuple[float, int] | None = None  # when, by our own clock, and with how many bytes
    _steps: int = 0
    _is_over: bool = False

    def see(self) -> None:
        """Note that a step was written."""
        if self._is_over:
            return
        now_s, self._steps = time.monotonic(), self._steps + 1
        self._begun = self._begun or (now_s, self.size())
        passed_s = now_s - self._begun[0]
        if passed_s < MEASURED_S or self._steps < MEASURED_STEPS:
            return
        self._is_over = True
        a_hour = (self.size() - self._begun[1]) / passed_s * 3600
        if a_hour >= LARGE_BYTES_A_HOUR:
            less = [f"{option} writes {a_hour * share / GB:.2g}" for option, share in self.smaller.items()]
            texts = [f"{self.path} grows by about {a_hour / GB:.2g} GB an hour", *less]
            self.listener.remark("; ".join(texts))


class LossCommand:
    """A command that is run at each loss, beside the filter; no shell reads it."""

    def __init__(self, typed: str, listener: Listener) -> None:
        """Take it as typed. OptionError for one without a word, or with an open quotation mark."""
        self._typed, self._listener = typed, listener
        try:
            self._words = shlex.split(typed)
        except ValueError as problem:
            raise OptionError(f"--on-lost: found {typed!r} ({problem}), expected a command") from None
        if not self._words:
            raise OptionError("--on-lost: found nothing, expected a command, such as 'notify-send lost'")

    def run(self, label: str, step: int, text: str) -> None:
        """Start it and go on; when it fails, that is one line."""
        variables = {"MAURICE_RUN": label, "MAURICE_STEP": str(step), "MAURICE_TEXT": text}
        threading.Thread(target=self._run, args=(os.environ | variables,), daemon=True).start()

    def _run(self, environment: Mapping[str, str]) -> None:
        try:
            status = subprocess.call(
                self._words,
                stdin=subprocess.DEVNULL,
                stdout=2,  # results on standard output stay alone
                env=environment,
                start_new_session=True,  # a Ctrl-C is for us
            )
        except OSError as problem:
            self._listener.warning(f"--on-lost: {self._words[0]} does not start: {problem.strerror}")
            return
        if status:
            self._listener.warning(f"--on-lost: {self._typed} failed with status {status}")


@dataclass(slots=True)
class Watch:
    """Follows the runs of a live source, and says what changed: lost, localized again, too slow."""

    listener: Listener
    command: LossCommand | None = None
    rate: WriteRate | None = None  # of the recording, where one is written
    clock: Callable[[], str] = lambda: time.strftime("%H:%M:%S")
    _before: dict[str, Standing] = field(default_factory=dict)  # what was said last of each run
    _skipped: int = 0  # in all
    _skips_at: int | None = None  # the last step before which some were, while the filter is too slow
    _begun_s: float = 0.0  # when the last step began, by our own clock

    def see(self, steps: Mapping[str, Step], collector: ResultCollector) -> None:
        """Process an update of all runs, which the collector has."""
        for label, standing in collector.standings().items():
            step = steps[label][0].frame.step
            if standing is not None and self._is_new(label, step, standing):
                self._say_standing(label, step, standing, collector)
        self._see_skips(next(iter(steps.values())))
        if self.rate is not None:
            self.rate.see()

    def _is_new(self, label: str, step: int, standing: Standing) -> bool:
        before = self._before.get(label)
        soon = standing.state == SEARCHING and step - standing.since < FEW - 1
        return not soon and (before is None or before.state != standing.state)

    def _say_standing(self, label: str, step: int, standing: Standing, collector: ResultCollector) -> None:
        before = self._before.get(label)
        self._before[label] = standing
        again = " again" if before is not None and before.is_bad and not standing.is_bad else ""
        text = f"{standing.words}{again}"
        if standing.is_lost:
            failures = collector.verdicts()[label].failures
            because = failures[-1].title if failures and failures[-1].kind != UNKNOWN else ""
            text = f"{text} ({because})" if because else text
        named = f"{label}: " if len(collector.standings()) > 1 else ""
        self.listener.remark(f"{named}{self.clock()} step {step} {text}")
        if standing.is_lost and self.command is not None:
            self.command.run(label, step, text)

    def _see_skips(self, first: Step) -> None:
        """Say when the filter becomes slower than the robot, and when it keeps up again."""
        moment, _ = first
        step, now_s = moment.frame.step, time.monotonic()
        is_first, took_s, self._begun_s = not self._begun_s, now_s - self._begun_s, now_s
        count = skipped_before(moment.events)
        self._skipped += count
        if count and self._skips_at is None:
            took = "" if is_first else f": {took_s:.2g} s from step to step"
            slow = f"the filter is slower than the robot{took}"
            faster = "fewer --particles or less --detail is faster"
            self.listener.remark(f"{self.clock()} step {step} skips pictures ({slow}; {faster})")
        if count:
            self._skips_at = step
        elif self._skips_at is not None and step - self._skips_at >= KEEPS_UP:
            self.listener.remark(
                f"{self.clock()} step {step} keeps up again ({self._skipped} skipped so far)"
            )
            self._skips_at = None


def write_rate(runs: Sequence[RunView], output: Output, listener: Listener) -> WriteRate:
    """Return what measures how fast a live recording grows, and knows what grows less."""
    from ..viewer.sinks import part_of
    from .observer import expected_bytes

    path, detail = output.file, Detail(output.detail)
    light, full = (
        sum(expected_bytes(each, 1000, run.particles, len(run.channels), live=True) for run in runs)
        for each in (Detail.LIGHT, detail)
    )
    smaller = {} if detail is Detail.LIGHT else {"--detail light": light / full}
    return WriteRate(path, lambda: part_of(path).stat().st_size, smaller, listener)
