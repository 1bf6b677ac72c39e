"""Options of commands that listen to a live source."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from maurice_loaders.live.listening import Patience

from .gathering import Command, in_place_of

PatienceOption = Annotated[
    float | None,
    typer.Option(
        "--patience",
        min=0.0,
        metavar="SECONDS",
        help="Of a live source: end when it was away, or silent, for so long. "
        "[default: 30 away; silent for ever]",
    ),
]
FollowOption = Annotated[
    bool, typer.Option("--follow", help="SESSION is a file that is still being written: go on as it grows.")
]
RecordOption = Annotated[
    Path | None,
    typer.Option(
        "--record", metavar="DIR", help="Of a live source: write all that comes to DIR/session.log."
    ),
]
KeepUpOption = Annotated[
    bool | None,
    typer.Option(
        "--keep-up/--every-picture",
        help="Of a live source: leave out the oldest of more than four waiting pictures, and count them, or "
        "use every one, however late. [default: keep up with tcp:// and ws://, else every picture]",
    ),
]
LIVE = {
    "follow": (FollowOption, False),
    "record": (RecordOption, None),
    "keep_up": (KeepUpOption, None),
    "patience": (PatienceOption, None),
}


@dataclass(frozen=True, slots=True)
class LiveOptions:
    """How a live source is listened to, as typed."""

    follow: bool = False
    record: Path | None = None
    keep_up: bool | None = None
    patience: float | None = None

    def wanted_for(self, session: Path) -> bool:
        """Tell whether a session is live; a usage error where it is not and these options are given."""
        from maurice_loaders.live.source import is_live

        if self.follow or is_live(session):
            return True
        if self != LiveOptions():
            given = "--record, --keep-up, --every-picture and --patience go with a live source"
            raise typer.BadParameter(f"{given}: -, tcp://, ws://, or a file with --follow")
        return False


def patience_of(seconds: float | None) -> Patience:
    """Give the patience that was asked for."""
    return Patience() if seconds is None else Patience(seconds, seconds)


def listens(command: Command) -> Command:
    """Give a command all options of listening, in place of its parameter `live`."""
    return in_place_of("live", LIVE, LiveOptions, command)
