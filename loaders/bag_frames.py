"""The tree of coordinate frames that a bag's transforms make, as far as it is known so far."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from maurice_mcl.typing import F64

from .bag_messages import Link

DEEPEST = 100  # links from a frame to the root; more is a ring


class FrameTree:
    """Where each frame stands in its parent, the latest said."""

    def __init__(self) -> None:
        self._links: dict[str, Link] = {}

    def add(self, link: Link) -> None:
        """Take in one transform."""
        self._links[link.child] = link

    def chain(self, frame: str, child: str) -> list[Link] | None:
        """Give the links from a frame down to one below it, the lowest first; None when it is not known."""
        found: list[Link] = []
        while child != frame:
            link = self._links.get(child)
            if link is None or len(found) > DEEPEST:
                return None
            found.append(link)
            child = link.parent
        return found

    def __len__(self) -> int:
        return len(self._links)

    def news(self, links: Sequence[Link], frame: str, child: str) -> tuple[int | None, F64] | None:
        """Take in transforms; where they move one frame within the other: the first one's time, and where.

        The time is in ns, or None where the transform says none; the place is a matrix (4, 4).
        """
        for link in links:
            self.add(link)
        chain = self.chain(frame, child) or []
        new = [link for link in links if link in chain]
        matrix = self.place(frame, child) if new else None
        return None if matrix is None else (new[0].stamp_ns, matrix)

    def place(self, frame: str, child: str) -> F64 | None:
        """Give the matrix (4, 4) of a frame within one above it; None when it is not known."""
        chain = self.chain(frame, child)
        if chain is None:
            return None
        matrix = np.eye(4)
        for link in chain:
            matrix = link.matrix @ matrix
        return matrix
