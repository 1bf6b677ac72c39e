"""Every second, third, ... picture of a recording; what moved between them is kept."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from .findings import Findings
from .recording import Picture, Record
from .wrapped import Wrapped


@dataclass(frozen=True, slots=True, eq=False)
class FewerPictures(Wrapped):
    """A recording of which one picture of every `stride` is there, the first among them."""

    stride: int

    def records(self, findings: Findings) -> Iterator[Record]:
        """Give the recording's records but the pictures between."""
        pictures = 0
        for record in self.measured.records(findings):
            if isinstance(record, Picture):
                pictures += 1
                if (pictures - 1) % self.stride:
                    continue
            yield record
