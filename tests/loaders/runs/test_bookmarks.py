"""Bookmarks: what is added is there, what is broken is said and stays, what is removed is gone."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from maurice_loaders.errors import InputError
from maurice_loaders.runs.store import (
    Bookmark,
    add_bookmark,
    bookmarks_file,
    read_bookmarks,
    remove_bookmarks,
)

ODD, LATE = Bookmark(40, "odd turn"), Bookmark(7, "späte Bilder 雨")


def test_what_is_added_is_appended_read_by_step_and_twice_is_twice(tmp_path: Path) -> None:
    assert read_bookmarks(tmp_path).kept == ()
    assert remove_bookmarks(tmp_path, [ODD]) == 0
    assert not bookmarks_file(tmp_path).exists()
    before = b""
    for one in (ODD, LATE, ODD):
        add_bookmark(tmp_path, one)
        assert bookmarks_file(tmp_path).read_bytes().startswith(before)
        before = bookmarks_file(tmp_path).read_bytes()
    assert read_bookmarks(tmp_path).kept == (LATE, ODD, ODD)
    lines = bookmarks_file(tmp_path).read_text(encoding="utf-8").splitlines()
    assert json.loads(lines[1]) == {"step": 7, "note": "späte Bilder 雨"}


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("{broken", "expected a bookmark"),
        ("[]", "expected a number from 1"),
        ('{"step": 0, "note": "a"}', "expected a number from 1"),
        ('{"step": true, "note": "a"}', "expected a number from 1"),
        ('{"step": 2.5, "note": "a"}', "expected a number from 1"),
        ('{"step": 3}', "expected a text"),
        ('{"step": 3, "note": "  "}', "expected a text"),
        ("\xff\xfe", "expected a bookmark"),
    ],
)
def test_a_broken_line_is_said_with_its_number_and_the_others_are_read(
    line: str, said: str, tmp_path: Path
) -> None:
    add_bookmark(tmp_path, ODD)
    with bookmarks_file(tmp_path).open("ab") as out:
        out.write(line.encode("latin-1") + b"\n")
    add_bookmark(tmp_path, LATE)
    found = read_bookmarks(tmp_path)
    assert found.kept == (LATE, ODD)
    assert found.problem is not None
    assert "bookmarks.jsonl:2: " in found.problem
    assert said in found.problem
    assert "\n" not in found.problem
    bookmarks_file(tmp_path).write_text("a\n\nb\nc\n")
    assert str(read_bookmarks(tmp_path).problem).endswith("left as it is (and 2 more)")


def test_a_line_that_was_cut_off_swallows_nothing(tmp_path: Path) -> None:
    bookmarks_file(tmp_path).write_bytes(b'{"step": 3, "no')
    add_bookmark(tmp_path, ODD)
    add_bookmark(tmp_path, LATE)
    assert read_bookmarks(tmp_path).kept == (LATE, ODD)
    assert bookmarks_file(tmp_path).read_bytes().startswith(b'{"step": 3, "no\n')


def test_removing_leaves_all_other_lines_byte_for_byte(tmp_path: Path) -> None:
    add_bookmark(tmp_path, ODD)
    with bookmarks_file(tmp_path).open("ab") as out:
        out.write(b'{"note": "by hand",   "step": 9}\r\n{broken\n')
    add_bookmark(tmp_path, ODD)
    assert remove_bookmarks(tmp_path, [ODD]) == 2
    assert bookmarks_file(tmp_path).read_bytes() == b'{"note": "by hand",   "step": 9}\r\n{broken\n'


@given(st.lists(st.tuples(st.integers(1, 10**6), st.text().filter(lambda t: t.strip())), max_size=6))
def test_any_text_survives(tmp_path_factory: pytest.TempPathFactory, notes: list[tuple[int, str]]) -> None:
    folder = tmp_path_factory.mktemp("run")
    wanted = []
    for step, text in notes:
        line = " ".join(text.encode(errors="replace").decode().split())
        wanted.append(Bookmark(step, line))
        add_bookmark(folder, wanted[-1])
    found = read_bookmarks(folder)
    assert found.problem is None
    assert found.kept == tuple(sorted(wanted, key=lambda one: one.step))


@pytest.mark.skipif(sys.platform == "win32" or os.geteuid() == 0, reason="root may write everywhere")
def test_a_folder_that_cannot_be_written_is_said_in_one_line(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    try:
        with pytest.raises(InputError, match="cannot be written"):
            add_bookmark(tmp_path, ODD)
    finally:
        tmp_path.chmod(0o700)


def test_a_folder_in_its_place_is_said_in_one_line(tmp_path: Path) -> None:
    bookmarks_file(tmp_path).mkdir()
    with pytest.raises(InputError, match="cannot be written"):
        add_bookmark(tmp_path, ODD)
    with pytest.raises(InputError, match="cannot be read"):
        read_bookmarks(tmp_path)
