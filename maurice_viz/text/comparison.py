"""How runs compare, in words and in the session's units: Markdown for the text panels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from maurice_mcl.analysis.run_comparison import APART_FOR, APART_M, Step, StepComparison

from ..playback import RunResult
from ..style import COLOR_WORDS, Scale, Units
from .narration import errors
from .summary import say_difference

NOT_YET = "How the runs compare over the drive is shown here when the replay has ended."


class StepWords:
    """Describes at every step how the runs differ; remembers when they diverged."""

    def __init__(self, labels: Sequence[str], scale: Scale, has_truth: bool) -> None:
        self._labels, self._scale, self._has_truth = tuple(labels), scale, has_truth
        self._parted = dict.fromkeys(labels, "")

    def at(self, steps: Mapping[str, Step], pairs: Mapping[str, StepComparison]) -> str:
        """Return a table with one row per run, below what happened at this step."""
        unit, new = self._scale.units.name, []
        for label, pair in pairs.items():
            if pair.event is not None:
                self._parted[label] = str(pair.event.step - APART_FOR + 1)
                new.append(f"**{plain(pair.event.text)}.**")
        off = [f"error ({unit})", "(deg)"] if self._has_truth else []
        heads = ["run", *off, *([f"distance ({unit})", "parted"] if _on_one_drive(pairs) else [])]
        lines = [
            *new,
            "",
            _table_row(heads),
            _table_row(["---", *["---:"] * (len(heads) - 1)]),
            *(self._row(label, number, steps, pairs) for number, label in enumerate(self._labels)),
            "",
            self._meaning(pairs),
        ]
        return "\n".join(lines)

    def _row(
        self, label: str, number: int, steps: Mapping[str, Step], pairs: Mapping[str, StepComparison]
    ) -> str:
        moment, record = steps[label]
        cells = [f"{plain(label)} ({COLOR_WORDS[number]})"]
        if self._has_truth and moment.truth is not None:
            off_m, off_rad = errors(record.estimate, moment.truth)
            cells += [self._number(off_m), f"{np.degrees(off_rad):.0f}"]
        elif self._has_truth:
            cells += ["-", "-"]
        if _on_one_drive(pairs):
            apart_m = pairs[label].apart_m if label in pairs else None
            cells += ["" if apart_m is None else self._number(apart_m), self._parted[label]]
        return _table_row(cells)

    def _number(self, length_m: float) -> str:
        return f"{self._scale.length(length_m):.{self._scale.units.digits}f}"

    def _meaning(self, pairs: Mapping[str, StepComparison]) -> str:
        if not _on_one_drive(pairs):
            return "Runs of different drives, side by side by the number of the step."
        far, first = self._scale.say(APART_M), plain(self._labels[0])
        return f"Parted: more than {far} from {first} for {APART_FOR} steps running."


def result(results: Sequence[RunResult], units: Units) -> str:
    """Return how every run compares with the first over the drive."""
    first = plain(results[0].label)
    parts = [_paragraph(one, first, units) for one in results[1:]]
    drive = (
        "Intervals hold 95 %, for the mean over this one drive: another drive can differ. "
        "Below zero is closer to the truth."
    )
    return "\n\n".join([*parts, drive])


def _paragraph(result: RunResult, first: str, units: Units) -> str:
    paired = result.paired
    if paired is None:
        return ""
    parts = [f"**{plain(result.label)}** against {first}:"]
    if paired.position is not None:
        parts.append(
            f"position error {say_difference(paired.position, 1 / units.per_m, units.digits)} {units.name},"
        )
        parts.append(f"closer at {paired.position.better} of {paired.position.updates} updates;")
    if paired.heading is not None:
        parts.append(f"heading error {say_difference(paired.heading, float(np.deg2rad(1)), 1)} deg;")
    if paired.apart_mean_m is None:
        return " ".join([*parts, "another drive, so that poses are not compared."])
    parts.append(f"{paired.apart_mean_m * units.per_m:.{units.digits}f} {units.name} from it on average;")
    parts.append("they never part." if paired.parted_at is None else f"they part at step {paired.parted_at}.")
    return " ".join(parts)


def _on_one_drive(pairs: Mapping[str, StepComparison]) -> bool:
    """Return whether any run is on the drive of the first, so that their poses can be compared."""
    return any(pair.apart_m is not None for pair in pairs.values())


def _table_row(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


def plain(text: str) -> str:
    """Return a label with Markdown's signs escaped."""
    return "".join(f"\\{sign}" if sign in "\\`*_|[]<>#~" else sign for sign in text)
