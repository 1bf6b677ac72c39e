"""A CMUcam's frames in all the ways in which they are found."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from helpers.recordings import read
from maurice_loaders.errors import PictureError
from maurice_loaders.formats.cmucam import decode_frame, frames
from maurice_loaders.formats.registry import open_session
from maurice_loaders.reading.options import Reading
from maurice_loaders.reading.recording import Picture
from maurice_mcl.values.arrays import U8

WIDTH, HEIGHT = 7, 5
SIZE = bytes([WIDTH, HEIGHT])


def rgb(seed: int = 0, width: int = WIDTH, height: int = HEIGHT) -> U8:
    return np.random.default_rng(seed).integers(16, 241, (height, width, 3), dtype=np.uint8)


def lines(picture: U8) -> list[bytes]:
    return [row.tobytes() for row in picture]


def pictures_in(folder: Path, data: bytes) -> list[U8]:
    file = folder / "d.dump"
    file.write_bytes(data)
    return [r.read() for r in read(file)[0] if isinstance(r, Picture)]


def assert_doubled(found: U8, picture: U8) -> None:
    """Expect a picture whose pixels are doubled to the side."""
    np.testing.assert_array_equal(found, np.repeat(picture, 2, axis=1))


DIALECTS = {
    "size and a marker a line": lambda p: SIZE + b"".join(b"\2" + line for line in lines(p)),
    "size and no marker": lambda p: SIZE + b"".join(lines(p)),
    "size and no marker before the first line": lambda p: SIZE + b"\2".join(lines(p)),
    "size and one marker at the end": lambda p: SIZE + b"".join(lines(p)) + b"\2",
    "size and one marker at the beginning": lambda p: SIZE + b"\2" + b"".join(lines(p)),
    "no size, as in the manual": lambda p: b"".join(b"\2" + line for line in lines(p)),
    "no size and no marker before the first line": lambda p: b"\2".join(lines(p)),
}


@pytest.mark.parametrize("name", DIALECTS)
def test_every_dialect_gives_the_picture_alone_and_between_other_bytes(name: str, tmp_path: Path) -> None:
    assert_doubled(decode_frame(b"\1" + DIALECTS[name](rgb()) + b"\3"), rgb())
    made = [b"\1" + DIALECTS[name](rgb(k)) + b"\3" for k in range(3)]
    found = pictures_in(tmp_path, b"CMUcam2 v1.00 c6\r:ACK\r" + b":ACK\r".join(made) + b":")
    for k, picture in zip(range(3), found, strict=True):
        assert_doubled(picture, rgb(k))


def test_dark_values_columns_of_a_cmucam1_and_pieces_of_large_dumps(tmp_path: Path) -> None:
    dark = np.random.default_rng(1).integers(0, 5, (HEIGHT, WIDTH, 3), dtype=np.uint8)
    marked = DIALECTS["size and a marker a line"]
    assert_doubled(decode_frame(b"\1" + marked(dark) + b"\3"), dark)
    columns = rgb(width=143, height=80)
    data = b"\1" + DIALECTS["no size, as in the manual"](columns) + b"\3"
    assert_doubled(decode_frame(data), columns.transpose(1, 0, 2))
    full = [rgb(k, 88, 143) for k in range(9)]  # across the borders of what is read at a time
    made = [b"\1\x58\x8f" + marked(picture)[2:] + b"\3" for picture in full]
    found = pictures_in(tmp_path, b":ACK\r".join(made))
    assert len(found) == 9
    assert_doubled(found[8], full[8])


def test_a_cut_frame_is_one_problem_and_the_next_is_found(tmp_path: Path) -> None:
    whole = b"\1" + DIALECTS["size and a marker a line"](rgb()) + b"\3"
    file = tmp_path / "d.dump"
    file.write_bytes(whole + b":" + whole[:40] + b"ACK\r" + whole + whole[:-1])
    session = open_session(file, Reading(keep_going=True))
    assert len(list(session.moments())) == 2
    assert session.problem_count == 2
    with pytest.raises(PictureError, match="without its end"):
        decode_frame(whole[:-1])


@settings(max_examples=100)
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
