"""A CMUcam's frames in all the ways in which they are found."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from maurice_loaders.errors import PictureError, ReadingNotes
from maurice_loaders.formats.cmucam import decode_frame, frames
from maurice_loaders.formats.registry import open_recording, open_session
from maurice_loaders.reading import ReadingOptions
from maurice_loaders.recording import Picture
from maurice_mcl.arrays import U8

WIDTH, HEIGHT = 7, 5
SIZE = bytes([WIDTH, HEIGHT])


def rgb(seed: int = 0, width: int = WIDTH, height: int = HEIGHT) -> U8:
    return np.random.default_rng(seed).integers(16, 241, (height, width, 3), dtype=np.uint8)


def lines(picture: U8) -> list[bytes]:
    return [row.tobytes() for row in picture]


DIALECTS = {
    "size and a marker a line": lambda p: SIZE + b"".join(b"\2" + line for line in lines(p)),
    "size and no marker": lambda p: SIZE + b"".join(lines(p)),
    "size and no marker before the first line": lambda p: SIZE + b"\2".join(lines(p)),
    "size and one marker at the end": lambda p: SIZE + b"".join(lines(p)) + b"\2",
    "size and one marker at the beginning": lambda p: SIZE + b"\2" + b"".join(lines(p)),
    "no size, as in the manual": lambda p: b"".join(b"\2" + line for line in lines(p)),
    "no size and no marker before the first line": lambda p: b"\2".join(lines(p)),
}
dialect = pytest.mark.parametrize("name", DIALECTS)


@dialect
def test_every_dialect_gives_the_picture_doubled_to_the_side(name: str) -> None:
    found = decode_frame(b"\1" + DIALECTS[name](rgb()) + b"\3")
    np.testing.assert_array_equal(found, np.repeat(rgb(), 2, axis=1))


@dialect
def test_frames_between_other_bytes_are_found(name: str, tmp_path: Path) -> None:
    made = [b"\1" + DIALECTS[name](rgb(k)) + b"\3" for k in range(3)]
    file = tmp_path / "d.dump"
    file.write_bytes(b"CMUcam2 v1.00 c6\r:ACK\r" + b":ACK\r".join(made) + b":")
    found = [
        r.read()
        for r in open_recording(file).records(ReadingNotes(keep_going=False))
        if isinstance(r, Picture)
    ]
    assert len(found) == 3
    for k, picture in enumerate(found):
        np.testing.assert_array_equal(picture, np.repeat(rgb(k), 2, axis=1))


def test_values_below_four_are_read_where_the_size_is_known() -> None:
    dark = np.random.default_rng(1).integers(0, 5, (HEIGHT, WIDTH, 3), dtype=np.uint8)
    data = b"\1" + SIZE + b"".join(b"\2" + line for line in lines(dark)) + b"\3"
    np.testing.assert_array_equal(decode_frame(data), np.repeat(dark, 2, axis=1))


def test_a_cmucam1_sends_columns() -> None:
    columns = rgb(width=143, height=80)
    data = b"\1" + b"".join(b"\2" + line for line in lines(columns)) + b"\3"
    np.testing.assert_array_equal(decode_frame(data), np.repeat(columns.transpose(1, 0, 2), 2, axis=1))


def test_a_cut_frame_is_one_problem_and_the_next_is_found(tmp_path: Path) -> None:
    whole = b"\1" + DIALECTS["size and a marker a line"](rgb()) + b"\3"
    file = tmp_path / "d.dump"
    file.write_bytes(whole + b":" + whole[:40] + b"ACK\r" + whole + whole[:-1])
    session = open_session(file, ReadingOptions(keep_going=True))
    assert len(list(session.moments())) == 2
    assert session.problem_count == 2
    with pytest.raises(PictureError, match="without its end"):
        decode_frame(whole[:-1])


def test_a_dump_is_read_piece_by_piece(tmp_path: Path) -> None:
    """Frames of the camera's full size across the borders of what is read at a time."""
    made = [
        b"\1\x58\x8f" + b"".join(b"\2" + line for line in lines(rgb(k, 88, 143))) + b"\3" for k in range(9)
    ]
    file = tmp_path / "d.dump"
    file.write_bytes(b":ACK\r".join(made))
    found = [
        r.read()
        for r in open_recording(file).records(ReadingNotes(keep_going=False))
        if isinstance(r, Picture)
    ]
    assert len(found) == 9
    np.testing.assert_array_equal(found[8], np.repeat(rgb(8, 88, 143), 2, axis=1))


@settings(max_examples=300)
@given(st.lists(st.sampled_from([b"\1", b"\2", b"\3", SIZE, b"abcdef" * 4, b"\x10", b"ACK\r:"]), max_size=60))
def test_any_bytes_end_well(parts: list[bytes]) -> None:
    data = b"".join(parts)
    at = 0
    for found in frames(data):
        assert at <= found.begin < found.end <= len(data)
        at = found.end
        try:
            picture = decode_frame(data[found.begin : found.end])
        except PictureError:
            assert found.fault
        else:
            assert picture.ndim == 3
