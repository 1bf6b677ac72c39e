"""What every channel can do."""

from __future__ import annotations

from typing import Any, Protocol

from ...arrays import F32, U8


class Channel(Protocol):
    """Measures a picture as one vector that can be compared with a reference's, element by element."""

    @property
    def name(self) -> str:
        """Lower-case name, used on the command line and in files."""
        ...

    @property
    def distance(self) -> str:
        """Name of the distance that suits it best, see `sensor.distances`; a user may choose another."""
        ...

    @property
    def unit(self) -> str:
        """The unit of the vector's elements in a word or two, for the titles of charts."""
        ...

    def describe(self, image: U8) -> F32:
        """Measure a picture (H, W, 3) RGB; returns (D,) float32, every element finite and >= 0.

        The size D may not depend on the picture.
        """
        ...

    def parameters(self) -> dict[str, Any]:
        """Everything that changes what `describe` gives, as JSON; part of every cache key."""
        ...
