"""What every channel can do."""

from __future__ import annotations

from typing import Any, Protocol

from ..typing import F32, U8


class Channel(Protocol):
    """Measures a picture as one vector that can be compared with a reference's, bin by bin."""

    @property
    def name(self) -> str:
        """Lower-case name, used on the command line and in files."""
        ...

    def describe(self, image: U8) -> F32:
        """Measure a picture (H, W, 3) RGB; gives (D,) float32, every element finite and >= 0."""
        ...

    def parameters(self) -> dict[str, Any]:
        """Everything that changes what `describe` gives, as JSON; part of every cache key."""
        ...
