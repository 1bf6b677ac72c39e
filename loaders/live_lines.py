"""Bytes as they come, cut into lines: a peer that sends an endless line costs no more than a long one."""

from __future__ import annotations

from .log_lines import Line

MOST_LINE_BYTES = 16 * 2**20  # a picture of 12 megapixels inline; more is no log


class LineCutter:
    """Takes in bytes in any portions and gives the same lines whatever the portions were."""

    def __init__(self, most: int = MOST_LINE_BYTES) -> None:
        """Hold at most `most` bytes of a line; what is beyond that is dropped, and the line marked."""
        self._most = most
        self._held = bytearray()
        self._too_long = False
        self._number = 0

    @property
    def overflowing(self) -> bool:
        """Tell whether the line that is coming in is too long already."""
        return self._too_long

    def feed(self, data: bytes) -> list[Line]:
        """Take in some bytes; give the lines that end within them."""
        lines, begin = [], 0
        while (end := data.find(b"\n", begin)) >= 0:
            self._hold(data[begin:end])
            lines.append(self._take(ended=True))
            begin = end + 1
        self._hold(data[begin:])
        return lines

    def rest(self) -> Line | None:
        """Give the line that has no end, when no more will come; None where the last one had its end."""
        return self._take(ended=False) if self._held else None

    def _hold(self, piece: bytes) -> None:
        self._too_long = self._too_long or len(self._held) + len(piece) > self._most
        self._held += piece[: self._most - len(self._held)]

    def _take(self, *, ended: bool) -> Line:
        self._number += 1
        line = Line(self._number, bytes(self._held).rstrip(b"\r"), ended, self._too_long)
        self._held, self._too_long = bytearray(), False
        return line
