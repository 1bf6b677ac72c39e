"""Who names an archive, or the folder above, is told what was probably meant."""

from __future__ import annotations

import bz2
import gzip
import lzma
import os
import shutil
from pathlib import Path

import pytest

from helpers import expect_facts
from maurice_loaders.errors import InputError
from maurice_loaders.formats.registry import open_session

LOG = '{"format": "maurice-session-log", "version": 1, "kind": "session", "name": "a"}\n'


def refused(path: Path) -> str:
    with pytest.raises(InputError) as told:
        open_session(path)
    assert "\n" not in str(told.value)
    return str(told.value)


ARCHIVES = {"zip": "unzip 'my drive.zip'"} | {
    f"{kind}tar": f"tar xf 'my drive.tar{ending}'"
    for kind, ending in {"": "", "gz": ".gz", "bz": ".bz2", "xz": ".xz"}.items()
}
PACKERS = {"gz": (gzip, "gunzip"), "bz2": (bz2, "bunzip2"), "xz": (lzma, "unxz")}


@pytest.mark.parametrize("kind", ARCHIVES)
def test_an_archive_is_named_with_what_unpacks_it(kind: str, tmp_path: Path) -> None:
    (tmp_path / "drive").mkdir()
    (tmp_path / "drive" / "session.log").write_text(LOG)
    archive = Path(shutil.make_archive(str(tmp_path / "my drive"), kind, tmp_path, "drive"))
    assert f"(unpack it: `{ARCHIVES[kind]}`)" in refused(archive)
    if kind == "tar":
        odd = archive.rename(tmp_path / "odd name")
        assert "found a tar archive (unpack it: `tar xf 'odd name'`)" in refused(odd)


@pytest.mark.parametrize("ending", PACKERS)
def test_a_packed_file_is_named(ending: str, tmp_path: Path) -> None:
    packer, command = PACKERS[ending]
    path = tmp_path / f"session.log.{ending}"
    path.write_bytes(packer.compress(LOG.encode()))
    assert f"unpack it: `{command} session.log.{ending}`" in refused(path)


def test_recordings_below_are_named(tmp_path: Path) -> None:
    for number in range(5):
        inner = tmp_path / "data" / f"drive{number}"
        inner.mkdir(parents=True)
        (inner / "session.log").write_text(LOG)
    (tmp_path / "data" / ".hidden").mkdir()
    told = refused(tmp_path / "data")
    assert "drive0, drive1, drive2, drive3 (did you mean" in told
    assert str(tmp_path) in told.split("did you mean")[1]
    assert "drive0, " in told.split("did you mean")[1]  # a folder stands for the session in it
    assert "drive2, ...?)" in told
    shutil.rmtree(tmp_path / "data" / "drive0")
    for number in (1, 2, 3):
        shutil.rmtree(tmp_path / "data" / f"drive{number}")
    assert f"(did you mean {tmp_path / 'data' / 'drive4'}?)" in refused(tmp_path / "data")


def test_folders_without_anything(tmp_path: Path) -> None:
    assert "found an empty folder, expected" in refused(tmp_path)
    (tmp_path / "notes.txt").write_text("hello")
    assert "found a folder with notes.txt, expected" in refused(tmp_path)
    os.mkfifo(tmp_path / "pipe")  # which would be waited for, as nobody writes into it
    (tmp_path / "nowhere").symlink_to(tmp_path / "gone")
    (tmp_path / "round").symlink_to(tmp_path)
    assert "did you mean" not in refused(tmp_path)


def test_a_table_of_other_columns_comes_before_bare_pictures(tmp_path: Path) -> None:
    (tmp_path / "frames").mkdir()
    (tmp_path / "frames" / "a.png").write_bytes(b"\x89PNG\r\n\x1a\n")
    (tmp_path / "where.csv").write_text("alpha,beta\n1,2\n")
    expect_facts(refused(tmp_path), "where.csv", "--reading columns=")
    (tmp_path / "where.csv").unlink()
    assert f"did you mean {tmp_path / 'frames'}?" in refused(tmp_path)
