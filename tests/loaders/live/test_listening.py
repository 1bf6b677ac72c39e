"""Framing: what comes out does not depend on the portions in which it came in."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from maurice_loaders.live.source import LineCutter

MOST = 12
PORTIONS = st.lists(
    st.one_of(st.binary(max_size=30), st.text("\r\n{}a", max_size=9).map(str.encode)), max_size=20
)


def cut(portions: list[bytes], most: int = MOST) -> list[tuple[int, bytes, bool, bool]]:
    cutter = LineCutter(most)
    lines = [line for portion in portions for line in cutter.feed(portion)]
    rest = cutter.rest()
    return [(x.number, x.data, x.ended, x.too_long) for x in (*lines, *([rest] if rest else []))]


@given(PORTIONS)
def test_portions_do_not_matter(portions: list[bytes]) -> None:
    whole = b"".join(portions)
    assert cut(portions) == cut([whole]) == cut([whole[i : i + 1] for i in range(len(whole))])


@given(PORTIONS)
def test_lines_are_those_of_the_text_and_never_longer_than_allowed(portions: list[bytes]) -> None:
    *parts, rest = b"".join(portions).split(b"\n")
    expected = [(part, True) for part in parts] + ([(rest, False)] if rest else [])
    found = cut(portions)
    assert [number for number, *_ in found] == list(range(1, len(expected) + 1))
    for (_, data, ended, too_long), (part, whole) in zip(found, expected, strict=True):
        assert ended == whole
        assert too_long == (len(part) > MOST)
        assert data == part[:MOST].rstrip(b"\r")


def test_an_endless_line_is_told_before_it_ends_and_is_not_held() -> None:
    cutter = LineCutter(1000)
    for _ in range(5000):
        assert cutter.feed(b"x" * 1000) == []
    assert cutter.overflowing
    line = cutter.feed(b"\nnext\n")
    assert [(one.data, one.too_long) for one in line] == [(b"x" * 1000, True), (b"next", False)]
    assert not cutter.overflowing
