"""What is replayed or compared, and all that is asked for beside it; what a source is, is decided here."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path

from maurice_loaders.errors import InputError
from maurice_loaders.live.source import is_live
from maurice_loaders.reading.options import Reading
from maurice_loaders.reading.session import RecordedSession
from maurice_loaders.runs.manifest import is_saved
from maurice_mcl.values import Library

from ..errors import SILENT, Listener, OptionError
from .filters import AnySource, Filter
from .output import Output
from .run import Report


@dataclass(frozen=True, slots=True)
class LiveOptions:
    """How a live source is listened to; None: the source's default.

    >>> import maurice_viz as mv
    >>> followed = mv.LiveOptions(follow=True, patience_s=0.1)
    >>> mv.replay("session.log", live=followed, to="live.rrd").runs[0].score.updates
    14
    """

    follow: bool = False  # the source is a file that is still being written
    capture: Path | None = None  # a folder: write all that comes to its session.log
    keep_up: bool | None = None  # leave out the oldest of more than four waiting pictures
    patience_s: float | None = None  # end when the source was away, or silent, for this long
    on_lost: str | None = None  # a command to run at each loss, without a shell


class SourceKind(Enum):
    """What a source is."""

    SESSION = "a recording"  # of any format, or an opened one
    SAVED = "a saved run"
    LIVE = "a live source"
    OWN = "a session of the caller's own"


def kind_of_source(source: AnySource, live: LiveOptions) -> SourceKind:
    """Return what a source is. OptionError where it is not live, and options of listening are given."""
    if isinstance(source, (str, Path)) and (live.follow or is_live(source)):
        return SourceKind.LIVE
    if live != LiveOptions():
        fault = "--capture, --keep-up, --every-picture and --patience need a live source"
        raise OptionError(f"{fault}: -, tcp://, ws://, cmucam://, or a file with --follow")
    if isinstance(source, (str, Path)):
        return SourceKind.SAVED if is_saved(Path(source)) else SourceKind.SESSION
    return SourceKind.SESSION if isinstance(source, RecordedSession) else SourceKind.OWN


@dataclass(frozen=True, slots=True)
class Request:
    """What is asked of a replay, or of a comparison of one source."""

    source: AnySource
    library: str | Path | Library | None
    specs: Sequence[Filter]  # a run each
    output: Output
    reading: Reading = field(default_factory=Reading)
    live: LiveOptions = field(default_factory=LiveOptions)
    listener: Listener = SILENT
    report: Report = lambda scores: None
    alone: bool = False  # whether the drive is shown where there is no library

    def __post_init__(self) -> None:
        library: object = self.library  # from a notebook, which checks no types
        if not isinstance(library, str | Path | Library | None):
            kind = type(library).__name__
            raise InputError(None, f"library: found a {kind}, expected a path, or a library that is open")

    @property
    def is_plain(self) -> bool:
        """Whether nothing is asked for but how the output looks."""
        values = self.library, list(self.specs), self.reading, self.output.folder
        return values == (None, [Filter()], Reading(), None)
