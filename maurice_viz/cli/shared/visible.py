"""What is printed breaks between words and never steers a terminal: control characters become visible marks.

Recordings come from anywhere. A name in one may hold the escape that renames a window, moves the cursor over
the line above, or turns the direction of writing.
"""

from __future__ import annotations

import re
import sys
import textwrap
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, TextIO

# C0 but tab and line end, DEL, C1, line and paragraph separators, marks and overrides of direction, and half
# characters, which no terminal's encoding has.
CONTROLS = re.compile("[\0-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")


def visible(text: str) -> str:
    """Return a text with a mark for every character that would steer a terminal."""
    return CONTROLS.sub(_mark, text)


def _mark(match: re.Match[str]) -> str:
    code = ord(match[0])
    if code < 0x20:
        return chr(0x2400 + code)  # Unicode's pictures of control characters
    return "\N{SYMBOL FOR DELETE}" if code == 0x7F else "\N{REPLACEMENT CHARACTER}"


def wrapped(text: str, width: int) -> Iterator[str]:
    """Yield a text in lines of at most `width` characters, broken between words.

    A command stays on one line, to be copied; so does a word, such as a path. An indented line goes on
    further in.
    """
    for line in visible(text).split("\n"):
        before, command, options = line.partition(": maurice-replay ")
        margin = " " * (len(line) - len(line.lstrip()))
        further = f"{margin}  " if margin else ""
        if len(line) <= width or (command and " " not in before.strip()):
            yield line
        elif command:
            yield from wrapped(f"{before}:", width)
            yield f"{margin}  {command[2:]}{options}"
        else:
            yield from textwrap.wrap(
                line, width, subsequent_indent=further, break_long_words=False, break_on_hyphens=False
            )


class VisibleStream:
    """A stream of text without control characters; Rich, which styles what it prints, writes past it."""

    def __init__(self, stream: TextIO) -> None:
        self.rich_proxied_file = stream  # the name under which Rich looks for it

    def write(self, text: str) -> int:
        """Write a text."""
        return self.rich_proxied_file.write(visible(text))

    def __getattr__(self, name: str) -> Any:
        return getattr(self.rich_proxied_file, name)


@contextmanager
def visible_output() -> Iterator[None]:
    """Let everything that is printed in the block go through `visible`, also what libraries print."""
    streams: tuple[Any, Any] = sys.stdout, sys.stderr
    sys.stdout, sys.stderr = VisibleStream(streams[0]), VisibleStream(streams[1])
    try:
        yield
    finally:
        sys.stdout, sys.stderr = streams
