"""What if: a saved run branched at a step, and drawn beside itself."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from maurice_loaders.config_files import read_settings
from maurice_loaders.errors import InputError
from maurice_loaders.runs.store import RunDifference, first_difference
from maurice_loaders.runs.writer import PARTS, StepRows, rows_of
from maurice_mcl.filter.branch import recovery_evidence, remembered
from maurice_mcl.filter.localizer import Localizer
from maurice_mcl.reasons.second_opinion import SecondOpinion
from maurice_mcl.scoring.comparison import APART_FOR, Step, parting
from maurice_mcl.scoring.events import PARTED, RunEvent
from maurice_mcl.scoring.metrics import mostly_at_end
from maurice_mcl.scoring.table import RunTable, TableRows
from maurice_mcl.sensor.ahead import Compared
from maurice_mcl.values import FilterState, Moment, Past, StepRecord, plain

from ..errors import SILENT, Listener, OptionError
from ..playback import ResultCollector
from ..running.filters import AnyFilter, filter_of
from ..running.open import GLOBAL, unique_labels
from ..running.output import Output, output_of
from ..running.run import Playback, RunScores, play
from ..running.saved import remark_saved, view_of
from ..scene import RunView, Scene
from ..style import scale_for
from ..text.comparison import BRANCH, what_if_line
from .branch import BranchChange, BranchPoint, open_branch


@dataclass(frozen=True, slots=True)
class AfterBranch:
    """One run over the updates after the branch; None where the truth is not known."""

    updates: int
    error_mean_m: float | None
    localized_share: float | None  # of the updates: converged and correct
    right_at_end: bool | None  # correct in at least 7 of the last 10 updates


@dataclass(frozen=True, slots=True)
class WhatIf:
    """A run and its branch; `line` says in words when they part and how both end."""

    scores: RunScores  # of the run, then of the branch, over the whole drive
    from_step: int  # the last step that both share
    change: tuple[str, ...]  # what is different from there on
    same_until: int  # the last step up to which both are the same to the last bit
    differs: RunDifference | None  # what differs first; None: nothing
    parted_at: int | None  # first of two steps at which the estimates are more than a radius apart
    before: AfterBranch  # the run as it was
    after: AfterBranch  # the branch
    line: str

    @property
    def same(self) -> bool:
        """Whether the branch is the run, bit for bit."""
        return self.differs is None

    def to_json(self) -> dict[str, Any]:
        """Return everything as JSON, lengths in meters."""
        values = plain(self)
        first = None if self.differs is None else {"step": self.differs.step, "field": self.differs.field}
        runs = {"run": values.pop("before"), "branch": values.pop("after")}
        scores: dict[str, Any] = values.pop("scores")
        return {"what_if": values | {"differs": first, "after_branch": runs}} | scores


def what_if(
    run: str | Path,
    from_step: int | None = None,
    filter: AnyFilter = None,  # noqa: A002
    *,
    seed: int | None = None,
    to: str | Path | None = None,
    force: bool = False,
    output: Output | None = None,
    listener: Listener = SILENT,
) -> WhatIf:
    """Branch a saved run after a step, with something changed, and compare the branch with the run.

    Both have the same steps up to `from_step` (0: none, and the branch begins as a replay would; None: up
    to the one before the first loss). From there on the `filter` is as in `replay`; what it does not say
    stays. With its `start="global"` the branch begins with particles over all free space. The random numbers
    are those that the run drew, unless a `seed` is given. `to` is the Rerun recording (.rrd) to write, of
    both side by side; `output` also says whether a viewer opens.

    InputError for bad files, and where the session or library is gone; OptionError for bad arguments.

        >>> import maurice_viz as mv
        >>> mv.what_if("my-run", 5).same
        True
        >>> mv.what_if("my-run", 5, mv.Filter(particles=100)).same_until
        5
    """
    spec = filter_of(filter)
    if spec.start not in (None, GLOBAL):
        start = spec.start
        raise OptionError(f"--start: a branch begins where the particles are, or {GLOBAL}; found {start!r}")
    if spec.config is not None:
        raise OptionError("--config: a branch changes settings of the run; give them by `settings`")
    changed = read_settings(spec.parts | dict(spec.settings))
    anywhere = spec.start == GLOBAL
    change = BranchChange(spec.preset, spec.feature, spec.particles, seed, changed, anywhere=anywhere)
    output = output_of(Path(run), output, to, force=force)
    return _branched(Path(run), from_step, change, output, listener)


def _branched(
    run: Path,
    from_step: int | None,
    change: BranchChange,
    output: Output,
    listener: Listener,
) -> WhatIf:
    point = open_branch(run, listener)
    from_step = point.step_or_default(from_step)
    pair = _Pair(point, from_step, change, point.localizer_with(change, listener))
    resized = pair.localizer.particles != point.localizer.particles
    if resized and from_step and not change.anywhere:
        listener.remark(
            f"the belief after step {from_step} is resampled to {pair.localizer.particles} particles"
        )
    scores = play(pair.playback(listener), output.named([f"what if {pair.label}"]), listener)
    before, after = _after(pair.run_rows.table()), _after(pair.branch_rows.table())
    if not before.updates:
        raise InputError(point.run.folder, f"holds no step after {from_step}; give an earlier --from")
    paired = scores.runs[1].paired
    compared = WhatIf(
        scores=scores,
        from_step=from_step,
        change=change.words,
        same_until=pair.last if pair.differs is None else pair.differs.step - 1,
        differs=pair.differs,
        parted_at=None if paired is None else paired.parted_at,
        before=before,
        after=after,
        line="",
    )
    scale = scale_for(scores.display_units, point.library.arena)
    return replace(compared, line=what_if_line(compared.to_json()["what_if"], scale))


@dataclass(slots=True, eq=False)
class _Pair:
    """A run and its branch, step by step; notes where they differ first."""

    point: BranchPoint
    from_step: int
    change: BranchChange
    localizer: Localizer  # of the branch
    differs: RunDifference | None = None
    last: int = 0  # step
    parted: RunEvent | None = None  # known so far
    run_rows: TableRows = field(default_factory=TableRows)  # of the updates after the branch
    branch_rows: TableRows = field(default_factory=TableRows)

    @property
    def label(self) -> str:
        """The name of the branch."""
        return unique_labels([self.point.run.manifest.label, self.change.label])[1]

    def playback(self, listener: Listener) -> Playback:
        """Prepare both for `play`."""
        point, manifest = self.point, self.point.run.manifest
        branch = RunView.of(self.label, self.localizer)
        scene = Scene(point.session.info, point.library, manifest.has_truth, manifest.pictures)

        def remarks(collector: ResultCollector) -> None:
            remark_saved(collector, [point.run], listener)

        return Playback(self.updates(), manifest.pictures, [view_of(point.restored), branch], scene, remarks)

    def updates(self) -> Iterator[Mapping[str, Step]]:
        """Go through both: up to the branch they share their steps."""
        names, evidences = (self.point.run.manifest.label, self.label), list[float]()
        past: Sequence[Past] = ()
        anywhere, second = self.change.anywhere, SecondOpinion.beside(self.localizer)
        original = self.point.localizer
        state, before = None, original.initialize(self.point.restored.start).belief
        if not self.from_step:
            state = self.point.begin(self.localizer, 0, None, evidences, anywhere=anywhere)
        for moment, record in self.point.steps():
            step, branch = moment.frame.step, record
            if state is None:
                evidences.append(recovery_evidence(record))
                branch = self._looked_at(moment, record)
                past = remembered(original, self.localizer, before, branch, past)
                before = record.belief
                if step == self.from_step:
                    known = (record.belief, evidences, past)
                    state = self.point.begin(self.localizer, step, *known, anywhere=anywhere)
            else:
                state, branch = self._stepped(state, moment, record)
            self.last = step
            branch = branch if second is None else second.added_to(branch)
            moment = self._with_events(moment)
            yield dict(zip(names, ((moment, record), (moment, branch)), strict=True))

    def _looked_at(self, moment: Moment, record: StepRecord) -> StepRecord:
        """Return a step before the branch as its panels show it: compared by its own sensor model."""
        sensor = self.localizer.sensor
        if sensor is self.point.localizer.sensor:
            return record
        comparison = sensor.see(moment.frame)
        unknown = np.full(len(comparison.channels), np.nan)
        sighting = sensor.at(comparison, record.weighted.poses)
        return replace(record, sighting=sighting, channel_evidence=unknown)

    def _with_events(self, moment: Moment) -> Moment:
        """Add to the log where the branch begins, and where it is certain that both have parted."""
        events, step = list(moment.events), moment.frame.step
        if step == max(self.from_step, 1):
            events.append(f"{BRANCH} with {', '.join(self.change.words) or 'nothing changed'}")
        if self.parted is None:
            self.parted = self._parting()
            if self.parted is not None:
                events.append(f"{PARTED} at step {step - APART_FOR + 1}: {self.parted.text}")
        return replace(moment, events=tuple(events))

    def _parting(self) -> RunEvent | None:
        """Return the event if the last updates make certain that both have parted."""
        info, arena = self.point.session.info, self.point.library.arena
        first = max(self.run_rows.updates - APART_FOR, 0)
        run, branch = (rows.table(first=first) for rows in (self.run_rows, self.branch_rows))
        names = (self.point.run.manifest.label, self.label)
        return parting(run, branch, names, scale_for(info.display_units, arena).say)

    def _stepped(
        self, state: FilterState, moment: Moment, record: StepRecord
    ) -> tuple[FilterState, StepRecord]:
        """Take a step of the branch, from the run's comparison of the picture where it has the same."""
        same = self.localizer.sensor is self.point.localizer.sensor
        known = Compared(record.sighting.comparison, 0.0) if same else None
        state, branch = self.localizer.step(state, moment.frame, known)
        if self.differs is None:
            self.differs = first_difference(_compared(moment, record), _compared(moment, branch))
        self.run_rows.add(moment, record)
        self.branch_rows.add(moment, branch)
        return state, branch


def _compared(moment: Moment, record: StepRecord) -> StepRows:
    """Return the rows of an update without what recovery only looked at, and without a second opinion."""
    rows = rows_of(moment, record)
    beside = {name for part in ("recovery_test", "opinion") for name in PARTS[part][1]}
    return replace(rows, step={key: value for key, value in rows.step.items() if key not in beside})


def _after(run: RunTable) -> AfterBranch:
    known = run.known
    if not known.any():
        return AfterBranch(run.updates, None, None, None)
    off_m, share = float(run.error_m[known].mean()), float(run.is_localized[known].mean())
    return AfterBranch(run.updates, off_m, share, mostly_at_end(run.is_correct[known].tolist()))
