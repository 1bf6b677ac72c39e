"""A recording around another one, in which something is otherwise: what such recordings share."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from maurice_mcl.session import SessionInfo

from .recording import Recording


@dataclass(frozen=True, slots=True, eq=False)
class Wrapped:
    """Path and info of the recording within. What is otherwise, a class of its own says in `records`."""

    measured: Recording

    @property
    def path(self) -> Path:
        """The file or folder."""
        return self.measured.path

    @property
    def info(self) -> SessionInfo:
        """What is known before the first record."""
        return self.measured.info
