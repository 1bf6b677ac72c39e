from dataclasses import replace

import numpy as np

from helpers import viz_fakes as fakes
from maurice_viz.drawing.contact_sheet import (
    BEST,
    CAPTION_PX,
    CELL_PX,
    GAP_PX,
    KEPT,
    ContactSheet,
    Match,
    best_matches,
)
from maurice_viz.style import MISSING, UNITS, Scale

INCHES = Scale(UNITS["in"])
WIDTH = BEST * (CELL_PX + GAP_PX) - GAP_PX
FIVE = tuple(Match(rank, 3 * rank, 0.9) for rank in range(1, 6))


def test_the_sheet_keeps_its_size(tmp_path):
    sheet = ContactSheet(fakes.make_library(tmp_path), INCHES).draw(FIVE)
    assert sheet.shape == (round(CELL_PX * 36 / 44) + CAPTION_PX, WIDTH, 3)
    sheet = ContactSheet(fakes.make_library(tmp_path, 1, 1, 2), INCHES)
    assert sheet.draw((Match(1, 0, 1.0), Match(2, 1, 0.5))).shape[1] == WIDTH
    sheet = ContactSheet(fakes.make_library(tmp_path), INCHES)
    drawn = sheet.draw(())
    assert drawn.shape == sheet.draw(FIVE).shape
    assert all((drawn[0, column * (CELL_PX + GAP_PX)] == MISSING).all() for column in range(5))
    library = fakes.make_library(tmp_path)
    sheet = ContactSheet(replace(library, pictures=(None, *library.pictures[1:])), INCHES)
    sheet.draw((Match(1, 0, 1.0),))
    mixed = sheet.draw((Match(1, 0, 1.0), Match(2, 1, 0.9)))
    assert mixed.shape == sheet.draw(FIVE).shape


def test_the_pictures_shown_are_those_of_the_entries(tmp_path):
    library = fakes.make_library(tmp_path)
    sheet = ContactSheet(library, INCHES).draw(FIVE)
    for column, match in enumerate(FIVE):
        left = column * (CELL_PX + GAP_PX)
        shown = sheet[:100, left : left + CELL_PX].reshape(-1, 3).mean(axis=0)
        taken = fakes.picture_at(library.poses[match.entry]).reshape(-1, 3).mean(axis=0)
        np.testing.assert_allclose(shown, taken, atol=8)


def test_missing_and_broken_pictures_are_said_to_be(tmp_path):
    (tmp_path / "broken.jpg").write_bytes(b"no picture")
    (tmp_path / "empty.jpg").write_bytes(b"")
    library = fakes.make_library()
    paths = (tmp_path / "broken.jpg", tmp_path / "empty.jpg", tmp_path / "gone.jpg", *library.pictures[3:])
    sheet = ContactSheet(replace(library, pictures=paths), INCHES)
    drawn = sheet.draw([Match(entry + 1, entry, 0.5) for entry in range(5)])
    assert drawn.shape == (CELL_PX * 3 // 4 + CAPTION_PX, WIDTH, 3)
    assert all((drawn[0, column * (CELL_PX + GAP_PX)] == MISSING).all() for column in range(5))


def test_drawing_again_is_the_same_in_bounded_memory(tmp_path):
    sheet = ContactSheet(fakes.make_library(tmp_path), INCHES)
    first = sheet.draw(FIVE)
    kept = first.copy()
    sheet.draw(tuple(Match(rank, rank, 0.1) for rank in range(1, 6)))
    np.testing.assert_array_equal(first, kept)
    np.testing.assert_array_equal(sheet.draw(FIVE), kept)
    library = fakes.make_library(columns=10, rows=9)
    assert library.size > KEPT
    sheet = ContactSheet(library, INCHES)
    for entry in range(library.size):
        sheet.draw((Match(1, entry, 0.5),))
    assert len(sheet._cells) <= KEPT


def test_matches_are_the_best_in_order():
    ((_, record),) = fakes.play(fakes.make_session(fakes.make_library(), 1), "color", 5)
    quality = record.sighting.comparison.quality
    matches = best_matches(record.sighting.comparison)
    assert [m.rank for m in matches] == [1, 2, 3, 4, 5]
    assert [m.quality for m in matches] == sorted(quality.tolist(), reverse=True)[:5]
    assert all(quality[m.entry] == np.float32(m.quality) for m in matches)
