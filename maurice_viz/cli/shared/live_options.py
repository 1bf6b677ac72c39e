"""Options of commands that listen to a live source."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from .options import LIVE, option

if TYPE_CHECKING:
    from ...running.source import LiveOptions

QUIET = "warn,re_log_encoding=error"  # a live recording has no footer on purpose, of which Rerun warns
_FOLLOW = "SESSION is a file that is still being written: continue as it grows."
Follow = Annotated[bool, option("--follow", _FOLLOW, LIVE)]
_CAPTURE = "For a live source: write everything received to DIR/session.log."
Capture = Annotated[Path | None, option("--capture", _CAPTURE, LIVE, metavar="DIR")]
KeepUp = Annotated[
    bool | None,
    option(
        "--keep-up/--every-picture",
        "For a live source: skip and count the oldest of more than four waiting pictures, or "
        "use every one, however late. [default: --keep-up for addresses]",
        LIVE,
    ),
]
Patience = Annotated[
    float | None,
    option(
        "--patience",
        "For a live source: end after so long away or silent. [default: 30 away, but a file; silent forever]",
        LIVE,
        hidden=True,  # of `replay`, which has enough options; `record` shows its own
        min=0.0,
        metavar="SECONDS",
    ),
]
_ON_LOST = "For a live source: run this, without a shell, at each loss; to end lost is exit status 3."
OnLost = Annotated[str | None, option("--on-lost", _ON_LOST, LIVE, metavar="COMMAND")]


@dataclass(frozen=True, slots=True)
class ListenSet:
    """How a live source is listened to."""

    follow: Follow = False
    capture: Capture = None
    keep_up: KeepUp = None
    patience: Patience = None
    on_lost: OnLost = None

    def options(self, sources: Iterable[Path]) -> LiveOptions:
        """Return what was typed as one value; where one of `sources` is live, Rerun is told to be quiet."""
        from maurice_loaders.live.source import is_live

        if self.follow or any(map(is_live, sources)):
            os.environ.setdefault("RUST_LOG", QUIET)  # before the next line imports Rerun, which reads it
        from ...running.source import LiveOptions

        return LiveOptions(self.follow, self.capture, self.keep_up, self.patience, self.on_lost)
