"""Files and folders appear whole or not at all, and only what was written here is ever replaced."""

from __future__ import annotations

import errno
import json
import os
import pickle
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import platformdirs
import pytest

from maurice_datasets.folders import SIMULATED_SURVEY, SIMULATION
from maurice_loaders.errors import FieldError, InputError, SourceError, TakenError
from maurice_loaders.files.writing import (
    FolderKind,
    cache_root,
    discard,
    filling,
    new_folder,
    temporary_folder,
    write_whole,
)
from maurice_loaders.importing import IMPORTED
from maurice_loaders.libraries.files import LIBRARY
from maurice_loaders.runs.manifest import RUNS
from maurice_viz.app.diagnose import DRAWN

NOTE = FolderKind("a note", "manifest.json", "note", r"manifest\.json|pages/\d+\.txt")


def fill(target: Path, text: str = "new", *, force: bool = False) -> None:
    with new_folder(target, NOTE, force=force) as begun:
        assert begun.parent == target.parent
        (begun / "manifest.json").write_text(json.dumps({"format": "note", "text": text}))


def text_of(folder: Path) -> str:
    return str(json.loads((folder / "manifest.json").read_text())["text"])


def test_appears_with_its_content_and_leaves_nothing_beside(tmp_path: Path) -> None:
    (tmp_path / "deep" / "a").mkdir(parents=True)  # an empty folder may be filled
    fill(tmp_path / "deep" / "a")
    assert text_of(tmp_path / "deep/a") == "new"
    assert [p.name for p in (tmp_path / "deep").iterdir()] == ["a"]
    discard(tmp_path / "deep" / "a")
    fill(tmp_path / "deep" / "a")  # nor need it be there
    discard(tmp_path / "deep")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt])
def test_a_failure_leaves_nothing(tmp_path: Path, error: type[BaseException]) -> None:
    def fail() -> None:
        with new_folder(tmp_path / "a") as filling:
            (filling / "half").touch()
            raise error

    with pytest.raises(error):
        fail()
    assert list(tmp_path.iterdir()) == []


def test_a_request_to_stop_at_any_moment_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    make, remove = Path.mkdir, shutil.rmtree

    def make_and_stop(folder: Path, *args: Any, **options: Any) -> None:
        make(folder, *args, **options)
        if folder.name.startswith(".a."):  # the signal comes before the next line
            raise KeyboardInterrupt

    def stop_and_remove(folder: Path, **options: Any) -> None:
        monkeypatch.setattr(shutil, "rmtree", remove)
        raise KeyboardInterrupt  # a second one, before anything is removed

    monkeypatch.setattr(Path, "mkdir", make_and_stop)
    monkeypatch.setattr(shutil, "rmtree", stop_and_remove)
    with pytest.raises(KeyboardInterrupt):
        fill(tmp_path / "a")
    assert list(tmp_path.iterdir()) == []


def test_an_old_folder_is_replaced_only_when_asked_and_stays_after_a_failure(tmp_path: Path) -> None:
    fill(tmp_path / "a", "old")
    with pytest.raises(InputError, match=r"exists already; .*--force"):
        fill(tmp_path / "a")
    fill(tmp_path / "a", force=True)
    assert text_of(tmp_path / "a") == "new"
    assert [p.name for p in tmp_path.iterdir()] == ["a"]
    fill(tmp_path / "a", "old", force=True)
    with pytest.raises(RuntimeError), new_folder(tmp_path / "a", NOTE, force=True):
        raise RuntimeError
    assert text_of(tmp_path / "a") == "old"


@pytest.mark.parametrize("target", ["", ".", "/"])
def test_a_new_folder_has_a_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, target: str) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match="found no name for a new folder"):
        fill(Path(target))
    assert list(tmp_path.iterdir()) == []


KINDS = [LIBRARY, *RUNS, SIMULATION, SIMULATED_SURVEY, IMPORTED, DRAWN]


def written(kind: FolderKind, folder: Path) -> list[Path]:
    """A folder of a kind, with a file a killed process left in it."""
    mark = folder / kind.mark
    mark.parent.mkdir(parents=True)
    mark.write_text(json.dumps({"format": kind.format, "version": 1}, indent=1))
    (folder / ".part-of.json.123.part").touch()
    return sorted(file for file in folder.rglob("*"))


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_force_replaces_a_folder_of_the_kind_and_nothing_that_holds_a_stranger(
    kind: FolderKind, tmp_path: Path
) -> None:
    folder = tmp_path / "a"
    written(kind, folder)
    with new_folder(folder, kind, force=True) as filling:
        (filling / "new").touch()
    assert [file.name for file in folder.iterdir()] == ["new"]
    for number, name in enumerate(("thesis.tex", "pictures/holiday.jpg", "steps/notes.md", "x/y/z", "link")):
        folder = tmp_path / f"with-{number}"
        files = written(kind, folder)
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        if name == "link":
            (folder / name).symlink_to(tmp_path, target_is_directory=True)
        else:
            (folder / name).write_text("years of work")
        with (
            pytest.raises(InputError, match=re.escape(f"found {name} in it")),
            new_folder(folder, kind, force=True),
        ):
            raise AssertionError("the folder must be refused before it is filled")
        assert {*files, folder / name} <= set(folder.rglob("*"))


@pytest.mark.parametrize("content", ["file", "no mark", "other format", "no JSON", "list", "link", "deep"])
def test_force_never_replaces_what_was_not_written_here(tmp_path: Path, content: str) -> None:
    target = tmp_path / "a"
    if content == "file":
        target.write_text("years of work")
    elif content == "link":
        target.symlink_to(tmp_path / "nowhere")
    else:
        target.mkdir()
        (target / "thesis.txt").write_text("years of work")
        marks = {
            "other format": '{"format": "web"}',
            "no JSON": "web app",
            "list": "[1]",
            "deep": "[" * 10**5,
        }
        if content in marks:
            (target / "manifest.json").write_text(marks[content])
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(InputError, match=r"is not replaced: .*expected a note"):
        fill(target, force=True)
    assert sorted(tmp_path.rglob("*")) == before


def test_a_stranger_that_comes_while_a_folder_is_filled_stays(tmp_path: Path) -> None:
    fill(tmp_path / "a", "old")
    with pytest.raises(InputError, match=r"found thesis\.tex"), new_folder(tmp_path / "a", NOTE, force=True):
        (tmp_path / "a" / "thesis.tex").touch()
    assert text_of(tmp_path / "a") == "old"
    assert sorted(p.name for p in tmp_path.rglob("*")) == ["a", "manifest.json", "thesis.tex"]


def test_a_link_to_a_folder_is_replaced_and_the_folder_stays(tmp_path: Path) -> None:
    fill(tmp_path / "there", "old")
    (tmp_path / "a").symlink_to(tmp_path / "there", target_is_directory=True)
    fill(tmp_path / "a", force=True)
    assert (text_of(tmp_path / "a"), text_of(tmp_path / "there")) == ("new", "old")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a", "there"]


def test_two_at_once_leave_one_whole_folder(tmp_path: Path) -> None:
    def be_overtaken() -> None:
        with new_folder(tmp_path / "a") as slow:
            (slow / "manifest.json").write_text("slow")
            fill(tmp_path / "a", "quick")

    with pytest.raises(InputError, match="exists already"):
        be_overtaken()
    assert text_of(tmp_path / "a") == "quick"
    assert [p.name for p in tmp_path.iterdir()] == ["a"]


def test_a_place_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="cannot be written"):
        fill(tmp_path / "file" / "a")


def test_the_cache_is_where_the_environment_says(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("MAURICE_CACHE", str(tmp_path))
    assert cache_root() == tmp_path
    monkeypatch.delenv("MAURICE_CACHE")
    assert cache_root() == Path(platformdirs.user_cache_dir("maurice-replay"))


def test_what_cannot_be_written_whole_leaves_what_was_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "a.png"
    write_whole(file, b"old")
    with pytest.raises(InputError, match="--force"):
        write_whole(file, b"new")

    def full(path: Path, data: bytes) -> int:
        path.touch()
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(InputError, match=r"a.png: cannot be written: No space left"):
        write_whole(file, b"new", force=True)
    assert file.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [file]


def test_a_folder_a_device_or_a_pipe_is_never_replaced_by_a_file(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    for place, told in ((tmp_path, "found a folder"), (pipe, "device or pipe")):
        with pytest.raises(InputError, match=told):
            write_whole(place, b"data", force=True)
    assert pipe.is_fifo()


def test_what_a_killed_process_left_goes_with_the_next_writing_and_no_others(
    tmp_path: Path,
) -> None:
    gone = subprocess.Popen([sys.executable, "-c", ""])
    gone.wait()
    dead = [tmp_path / name for name in (f"a.{gone.pid}.part.rrd", f".a.rrd.{gone.pid}.part")]
    living = [tmp_path / f"a.{os.getppid()}.part.rrd", tmp_path / f"b.{gone.pid}.part.rrd"]
    for file in (*dead, *living):
        file.write_bytes(b"x")
    write_whole(tmp_path / "a.rrd", b"whole")
    assert sorted(tmp_path.iterdir()) == sorted([tmp_path / "a.rrd", *living])

    folder = tmp_path / f".drive.{'0' * 32}.{gone.pid}.part"
    (folder / "survey").mkdir(parents=True)
    with new_folder(tmp_path / "drive") as filling:
        assert not folder.exists()
        assert filling.name.endswith(f".{os.getpid()}.part")


def test_a_temporary_folder_goes_and_takes_with_it_what_a_killed_process_left(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    code = (
        "from maurice_loaders.files.writing import *\n"
        "folder = temporary_folder('x'); folder.__enter__(); os._exit(9)"
    )
    subprocess.run([sys.executable, "-c", code], env=os.environ | {"TMPDIR": str(tmp_path)}, check=False)
    assert len(list(tmp_path.iterdir())) == 1
    with temporary_folder("x") as folder:
        assert list(tmp_path.iterdir()) == [folder]
        assert folder.stat().st_mode & 0o077 == 0
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "error",
    [InputError(Path("a.log"), "found b", 3), SourceError("tcp://a", "found b"), FieldError("found b")],
)
def test_an_error_comes_back_from_a_worker_process(error):
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is type(error)
    assert str(again) == str(error)
    assert (again.file, again.line, again.message) == (error.file, error.line, error.message)


def test_what_another_process_wrote_meanwhile_is_not_replaced(tmp_path: Path) -> None:
    target = tmp_path / "a.csv"
    refused = pytest.raises(TakenError, match=r"a\.csv: was written by another process")
    with refused, filling(target, force=False) as part:
        part.write_bytes(b"mine")
        target.write_bytes(b"theirs")
    assert [(file.name, file.read_bytes()) for file in tmp_path.iterdir()] == [("a.csv", b"theirs")]
    with filling(target, force=True) as part:
        part.write_bytes(b"mine")
    assert target.read_bytes() == b"mine"


def test_a_full_disk_in_a_folder_is_said_of_the_folder(tmp_path: Path) -> None:
    """Writing raises without a name, or with one of a part that nobody knows."""
    refused = pytest.raises(InputError, match=r"drive: cannot be written: No space.*free some space")
    with refused, new_folder(tmp_path / "drive"):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    assert not list(tmp_path.iterdir())
