"""Files and folders appear whole or not at all, and nobody's are deleted."""

from __future__ import annotations

import os
import pickle
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import platformdirs
import pytest

from maurice_loaders.errors import FieldError, InputError, SourceError
from maurice_loaders.files import cache_root, discard, new_folder, temporary_folder, write_whole


def fill(target: Path, text: str = "new", *, force: bool = False) -> None:
    with new_folder(target, force=force) as filling:
        assert filling.parent == target.parent
        (filling / "manifest.json").write_text(text)


def test_appears_with_its_content_and_leaves_nothing_beside(tmp_path: Path) -> None:
    (tmp_path / "deep" / "a").mkdir(parents=True)  # an empty folder may be filled
    fill(tmp_path / "deep" / "a")
    assert (tmp_path / "deep/a/manifest.json").read_text() == "new"
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
    assert (tmp_path / "a/manifest.json").read_text() == "new"
    assert [p.name for p in tmp_path.iterdir()] == ["a"]
    fill(tmp_path / "a", "old", force=True)
    with pytest.raises(RuntimeError), new_folder(tmp_path / "a", force=True):
        raise RuntimeError
    assert (tmp_path / "a/manifest.json").read_text() == "old"


@pytest.mark.parametrize("target", ["", ".", "/"])
def test_a_new_folder_has_a_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, target: str) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match="found no name for a new folder"):
        fill(Path(target))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("as_file", [True, False])
def test_never_replaces_what_was_not_made_here(tmp_path: Path, as_file: bool) -> None:
    precious = tmp_path / "a" if as_file else tmp_path / "a" / "thesis.txt"
    precious.parent.mkdir(exist_ok=True)
    precious.write_text("years of work")
    with pytest.raises(InputError, match=r"found no manifest\.json in it"):
        fill(tmp_path / "a", force=True)
    assert precious.read_text() == "years of work"


def test_two_at_once_leave_one_whole_folder(tmp_path: Path) -> None:
    def be_overtaken() -> None:
        with new_folder(tmp_path / "a") as slow:
            (slow / "manifest.json").write_text("slow")
            fill(tmp_path / "a", "quick")

    with pytest.raises(InputError, match="somebody else meanwhile"):
        be_overtaken()
    assert (tmp_path / "a/manifest.json").read_text() == "quick"
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
    code = "from maurice_loaders.files import *; kept = temporary_folder('x'); kept.__enter__(); os._exit(9)"
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
