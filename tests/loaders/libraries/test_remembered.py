"""What was computed from files is computed again exactly when one of them has changed."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from maurice_loaders.libraries import files as library_files
from maurice_loaders.libraries import remembered as remembering
from maurice_loaders.libraries import store
from maurice_loaders.libraries.remembered import kept_tables, remembered
from maurice_loaders.libraries.store import open_library

AGO_NS = 10**10


@pytest.fixture(autouse=True)
def _later(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let every file have been left alone for ten seconds: nobody can set its time of change."""
    now = time.time_ns
    monkeypatch.setattr("maurice_loaders.libraries.remembered.time.time_ns", lambda: now() + AGO_NS)


@pytest.fixture
def two(tmp_path: Path) -> list[str]:
    """Two files of two bytes."""
    for name in ("a", "b"):
        (tmp_path / name).write_bytes(b"12")
    return [str(tmp_path / name) for name in ("a", "b")]


def contents(files: list[str]) -> Callable[[], str]:
    return lambda: "".join(Path(file).read_text() for file in files if Path(file).exists())


def nothing() -> str:
    raise AssertionError("it was computed again")


def test_it_is_computed_once(two: list[str]) -> None:
    assert remembered("test", two, contents(two)) == "1212"
    assert remembered("test", two, nothing) == "1212"


def test_another_question_about_the_same_files_is_another_one(two: list[str]) -> None:
    remembered("test", two, contents(two))
    assert remembered("other", two, lambda: "x") == "x"


@pytest.mark.parametrize("change", ["content", "same size and time", "removed", "replaced"])
def test_a_changed_file_is_read_again(two: list[str], change: str) -> None:
    remembered("test", two, contents(two))
    file = Path(two[1])
    before = file.stat()
    if change == "removed":
        file.unlink()
    elif change == "replaced":
        (file.parent / "c").write_bytes(b"34")
        (file.parent / "c").replace(file)
    else:
        file.write_bytes(b"345" if change == "content" else b"34")
    if change == "same size and time":  # the time of any change, which cannot be set, gives it away
        os.utime(file, ns=(before.st_atime_ns, before.st_mtime_ns))
    assert remembered("test", two, contents(two)) == contents(two)()


def test_what_was_written_a_moment_ago_is_read_again(two: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.undo()
    monkeypatch.setenv("MAURICE_CACHE", str(Path(two[0]).parent / "cache"))
    remembered("test", two, contents(two))
    assert remembered("test", two, lambda: "again") == "again"


@pytest.mark.parametrize("damage", [b"", b"[1, 2]", b"{}", b'["only one"]', b"\xff"])
def test_a_damaged_memory_is_done_without(
    two: list[str], damage: bytes, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("MAURICE_CACHE", str(tmp_path / "cache"))
    remembered("test", two, contents(two))
    (kept,) = (tmp_path / "cache" / "remembered").iterdir()
    kept.write_bytes(damage)
    assert remembered("test", two, contents(two)) == "1212"


def test_a_library_opened_again_reads_no_picture_and_parses_no_survey(
    small_session: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    survey = small_session.parent / "survey.log"
    first = open_library(survey)
    open_library(survey)
    monkeypatch.setattr(library_files, "hash_file", nothing)
    monkeypatch.setattr(store.SurveyLog, "pictures", nothing)
    again = open_library(survey)
    assert all((again.index[name].references == one.references).all() for name, one in first.index.items())
    assert not again.index["color"].references.flags.writeable  # mapped


def test_tables_are_made_again_exactly_when_what_they_depend_on_is_another() -> None:
    made: list[int] = []

    def make() -> tuple[np.ndarray, ...]:
        made.append(1)
        return np.arange(6, dtype=np.int32).reshape(2, 3), np.float32([0.5])

    places = np.array([[0.0, 1.0], [2.0, 3.0]])
    for _ in range(2):
        whole, part = kept_tables("cells", [places, 0.1], make)
        assert (whole.dtype, part.dtype) == (np.int32, np.float32)
        np.testing.assert_array_equal(whole, [[0, 1, 2], [3, 4, 5]])
    assert len(made) == 1
    others = [["cells", [places + 1e-12, 0.1]], ["cells", [places, 0.2]], ["pairs", [places, 0.1]]]
    for number, (what, of) in enumerate([*others, ["cells", [places.astype(np.float32), 0.1]]]):
        kept_tables(what, of, make)
        assert len(made) == 2 + number


@pytest.fixture
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache that only this test writes."""
    monkeypatch.setenv("MAURICE_CACHE", str(tmp_path / "own cache"))
    return tmp_path / "own cache"


def test_damaged_tables_are_made_again_and_the_folder_does_not_grow_for_ever(
    own_cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def table(number: int) -> np.ndarray:
        return kept_tables("cells", [number], lambda: (np.full(1000, number),))[0]

    table(1)
    (file,) = (own_cache / "tables").iterdir()
    file.write_bytes(file.read_bytes()[:100])
    np.testing.assert_array_equal(table(1), np.full(1000, 1))
    monkeypatch.setattr(remembering, "MOST_BYTES", 50_000)
    for number in range(30):
        np.testing.assert_array_equal(table(number), np.full(1000, number))
    assert sum(file.stat().st_size for file in (own_cache / "tables").iterdir()) <= 50_000


LOCALIZER = """
import sys
from hashlib import sha256
from maurice_loaders import open_library
from maurice_mcl import make_localizer
localizer = make_localizer(open_library(sys.argv[1]), particles=50, preset="robust")
lookup = localizer.sensor.references
tables = lookup.nearest.place_of_cell, lookup.places, lookup.weights, lookup.before, lookup.share
print(*(sha256(table.tobytes()).hexdigest() for table in tables), "scipy" in sys.modules)
"""


def test_a_second_start_has_the_same_tables_and_does_not_wait_for_scipy(
    small_session: Path, own_cache: Path
) -> None:
    asked = [sys.executable, "-c", LOCALIZER, str(small_session.parent / "survey.log")]
    first, second = (subprocess.run(asked, capture_output=True, text=True, check=True).stdout for _ in "12")
    assert first.split()[:-1] == second.split()[:-1]
    assert (first.split()[-1], second.split()[-1]) == ("True", "False")
