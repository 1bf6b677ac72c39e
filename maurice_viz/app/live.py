"""A filter that a program feeds frame by frame, drawn into a Rerun recording of the program's own."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Self

import numpy as np

from maurice_loaders.errors import InputError
from maurice_loaders.session_log.writer import SessionWriter
from maurice_mcl.scoring.table import RunTable
from maurice_mcl.values import (
    F64,
    NO_PICTURE,
    U8,
    Frame,
    LaserScan,
    Library,
    Moment,
    SessionInfo,
    StepRecord,
    expect_frame,
)

from ..errors import SILENT, Listener, OptionError
from ..layouts import DETAILS
from ..playback import ResultCollector, RunResult, run_together, shared
from ..running.filters import AnyFilter, check_name, filter_of
from ..running.open import library_at, make_runs
from ..scene import Detail, RunView, Scene, numbered

if TYPE_CHECKING:
    import rerun as rr

    from ..running.observer import SceneObserver

STAYED: F64 = np.empty((0, 3))
CAPTURED = "session.log"


@dataclass(slots=True)
class _FedSession:
    """The session that a program feeds: what has come and is not filtered yet."""

    info: SessionInfo
    path: Path
    waiting: deque[Moment] = field(default_factory=deque)

    def moments(self) -> Iterator[Moment]:
        """Yield what was fed, once; `update` takes as many as it feeds."""
        while True:
            yield self.waiting.popleft()


class Live:
    """A filter that is fed frame by frame. Use it as a context manager, or `close` it.

    `library` is a library, its folder, a survey log or a map; `filter` as in `replay`, which begins anywhere
    unless its `start` says where; `motion` holds the robot's motion parameters, as under robot.motion of a
    session's header. With `rerun`, a `rerun.RecordingStream` of yours, every update is drawn into it, on the
    timelines `step` and `session`, which hold for what you log after it. `capture` is a new folder for a
    session log of all that was fed, whose replay with the same filter is this run.

    InputError for bad files and arguments, OptionError for names that are not known.

        >>> import maurice_mcl as mcl, maurice_viz as mv
        >>> with mv.Live(mcl.tiny_library(), mv.Filter(particles=100)) as live:
        ...     for moment in mcl.tiny_session().moments():
        ...         frame = moment.frame
        ...         step = live.update(frame.image, frame.motions, truth=moment.truth)
        >>> step.estimate.pose.shape, live.table.updates
        ((3,), 6)
    """

    def __init__(
        self,
        library: str | Path | Library,
        filter: AnyFilter = None,  # noqa: A002
        *,
        motion: Mapping[str, object] | None = None,
        rerun: rr.RecordingStream | None = None,
        detail: str = DETAILS[0],
        capture: str | Path | None = None,
        name: str = "live",
        listener: Listener = SILENT,
    ) -> None:
        check_name(detail, DETAILS, "detail")
        if detail == Detail.EVENTS.value:
            raise OptionError("--detail events draws two updates late; a fed filter has full or light")
        self.library = library if isinstance(library, Library) else library_at(Path(library), listener)
        survey = None if isinstance(library, Library) else Path(library).resolve()
        self.info = SessionInfo(
            name,
            display_units=self.library.display_units,
            motion=None if motion is None else dict(motion),
            survey=survey,
            captured=True,
        )
        self._fed = _FedSession(self.info, Path(name))
        (run,) = make_runs(self._fed, self.library, [filter_of(filter)], listener)
        (self._view,) = numbered([RunView.of(run.label, run.localizer, run.start)])
        self._steps = shared(run_together([run], self._fed.moments(), live=True))
        arena, filters = self.library.arena, {run.label: run.localizer}
        starts = {run.label: run.start}
        self._collector = ResultCollector([run.label], arena, localizers=filters, starts=starts)
        self._rec, self._detail = rerun, Detail(detail)
        self._observer: SceneObserver | None = None
        log = None if capture is None else Path(capture) / CAPTURED
        self._log = None if log is None else SessionWriter(log, self.info, pictures="png")
        self._last: Frame | None = None

    def update(
        self,
        image: U8 | None = None,
        motion: F64 | Sequence[float] | None = None,
        *,
        scan: LaserScan | None = None,
        readings: Mapping[str, float] | None = None,
        time_s: float | None = None,
        truth: F64 | Sequence[float] | None = None,
        events: Sequence[str] = (),
    ) -> StepRecord:
        """Filter one frame and return all of its step: `.estimate.pose`, `.estimate.confidence`, `.belief`.

        `image` is (H, W, 3) uint8 RGB; `motion` what the robot measured since the frame before: (3,) or
        (M, 3) forward_m, left_m, turn_rad, each in the robot's frame at its start. `readings` are numbers by
        name. `time_s` may not decrease; by default a second passes. `truth` (3,) is drawn and scored, and
        never shown to the filter. InputError in one line for arrays of another kind or shape, and for numbers
        that are not finite; nothing is filtered then.
        """
        last = self._last
        step, before_s = (0, -1.0) if last is None else (last.step, last.time_s)
        motions = STAYED if motion is None else np.atleast_2d(np.asarray(motion, np.float64))
        frame = Frame(
            step + 1,
            before_s + 1 if time_s is None else time_s,
            motions,
            NO_PICTURE if image is None else image,
            "",
            readings={} if readings is None else readings,
            scan=scan,
        )
        pose = None if truth is None else np.asarray(truth, np.float64)
        moment = Moment(frame, pose, tuple(events))
        expect_frame(moment, last)
        self._last = frame
        if self._log is not None:
            _write(self._log, moment)
        self._fed.waiting.append(moment)
        steps = next(self._steps)
        self._draw(moment, steps)
        return steps[self._view.label][1]

    def _draw(self, moment: Moment, steps: Mapping[str, tuple[Moment, StepRecord]]) -> None:
        self._collector.add_steps(steps)
        if self._rec is None:
            return
        if self._observer is None:
            from ..running.observer import SceneObserver
            from ..running.output import layout_of

            has_pictures = moment.frame.image is not NO_PICTURE
            scene = Scene(
                self.info, self.library, moment.truth is not None, has_pictures=has_pictures, live=True
            )
            light = self._detail is Detail.LIGHT
            self._rec.send_blueprint(layout_of([self._view], scene, light=light))
            self._observer = SceneObserver(self._rec, [self._view], scene, self._detail)
        self._observer.see(steps, self._collector)

    @property
    def table(self) -> RunTable:
        """The run so far, one row per update; `table.frame()` is a polars frame."""
        return self._collector.table(self._view.label)

    @property
    def result(self) -> RunResult:
        """Scores and verdict of the run so far. InputError before the first update."""
        if self._last is None:
            raise InputError(None, "nothing was fed yet; call `update` first")
        return self._collector.results()[0]

    def close(self) -> None:
        """Draw what is known only in the end, and close the session log; closing twice does no harm."""
        observer, self._observer, self._rec = self._observer, None, None
        if observer is not None:
            observer.end(self._collector.results())
        if self._log is not None:
            self._log.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def _write(log: SessionWriter, moment: Moment) -> None:
    """Write a moment's records to a session log, as a live source sends them."""
    frame = moment.frame
    for motion in frame.motions:
        log.odometry(frame.time_s, motion)
    for text in moment.events:
        log.event(frame.time_s, text)
    if frame.readings:
        log.reading(frame.time_s, dict(frame.readings))
    if moment.truth is not None:
        log.truth(frame.time_s, moment.truth)
    if frame.scan is not None:
        log.scan(frame.time_s, frame.scan)
    if frame.image is not NO_PICTURE:
        log.image(frame.time_s, frame.image)
