from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from helpers import viz_fakes as fakes
from maurice_viz.drawing.contact_sheet import (
    CACHED_REFERENCES,
    CAPTION_PX,
    CAPTIONS,
    CELL_PX,
    INKS,
    ContactSheet,
    Match,
    best_matches,
    no_caption,
    no_picture,
    reference_jpeg,
)
from maurice_viz.style import MISSING, PALE, RANK, UNITS, Scale

INCHES = Scale(UNITS["in"])


def decoded(data: bytes) -> np.ndarray:
    return cv2.cvtColor(cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB)


def test_pictures_and_captions_keep_their_size(tmp_path):
    sheet = ContactSheet(fakes.make_library(tmp_path), INCHES)
    assert sheet.height == round(CELL_PX * 36 / 44)
    for picture in (sheet.picture(3), no_picture(sheet.height)):
        assert decoded(picture).shape == (sheet.height, CELL_PX, 3)
    for caption in (sheet.caption(Match(1, 3, 0.9)), no_caption(CAPTION_PX)):
        assert decoded(caption).shape == (CAPTION_PX, CELL_PX, 3)


def test_the_pictures_shown_are_those_of_the_entries(tmp_path):
    library = fakes.make_library(tmp_path)
    sheet = ContactSheet(library, INCHES)
    for entry in (3, 6, 9):
        shown = decoded(sheet.picture(entry)).reshape(-1, 3).mean(axis=0)
        taken = fakes.picture_at(library.poses[entry]).reshape(-1, 3).mean(axis=0)
        np.testing.assert_allclose(shown, taken, atol=8)


def test_a_caption_has_the_rank_in_its_color_over_three_lines(tmp_path):
    sheet = ContactSheet(fakes.make_library(tmp_path), INCHES)
    drawn = decoded(sheet.caption(Match(1, 3, 0.9)))
    ranks, pale = ((drawn == color).all(axis=2) for color in (RANK, PALE))
    assert ranks[:20, :20].any()
    assert all(pale[first : first + 16].any() for first in (4, 23, 41))
    assert (
        sheet.caption(Match(2, 3, 0.9)) != sheet.caption(Match(1, 3, 0.9)) != sheet.caption(Match(1, 3, 0.8))
    )
    assert CAPTIONS.colors[INKS[PALE]].tolist() == drawn[0, 0].tolist()


@pytest.mark.parametrize("name", ["broken.jpg", "empty.jpg", "gone.jpg", None])
def test_missing_and_broken_pictures_are_said_to_be(tmp_path, name):
    (tmp_path / "broken.jpg").write_bytes(b"no picture")
    (tmp_path / "empty.jpg").write_bytes(b"")
    library = fakes.make_library()
    path = None if name is None else tmp_path / name
    sheet = ContactSheet(replace(library, pictures=(path, *library.pictures[1:])), INCHES)
    drawn = decoded(sheet.picture(0))
    assert drawn.shape == (CELL_PX * 3 // 4, CELL_PX, 3)
    np.testing.assert_allclose(drawn[0, 0], MISSING, atol=3)
    assert drawn.max() > 120, "words"


def test_pictures_are_encoded_once_in_bounded_memory(tmp_path):
    sheet = ContactSheet(fakes.make_library(tmp_path), INCHES)
    assert sheet.picture(3) is sheet.picture(3)
    assert reference_jpeg.cache_info().maxsize == CACHED_REFERENCES


def test_matches_are_the_best_in_order():
    ((_, record),) = fakes.play(fakes.make_session(fakes.make_library(), 1), "color", 5)
    quality = record.sighting.comparison.quality
    matches = best_matches(record.sighting.comparison)
    assert [m.rank for m in matches] == [1, 2, 3, 4, 5]
    assert [m.quality for m in matches] == sorted(quality.tolist(), reverse=True)[:5]
    assert all(quality[m.entry] == np.float32(m.quality) for m in matches)
