from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from maurice_datasets.folders import cached, copy_whole, fingerprint, is_whole, seal
from maurice_datasets.worlds.world import Box
from maurice_loaders.errors import InputError


def test_a_sealed_folder_is_whole_until_anything_changes(tmp_path):
    (tmp_path / "a").write_text("one")
    assert not is_whole(tmp_path, "key")
    seal(tmp_path, "key")
    assert is_whole(tmp_path, "key")
    assert not is_whole(tmp_path, "other key")
    (tmp_path / "a").rename(tmp_path / "b")
    assert not is_whole(tmp_path, "key")


def test_a_full_disk_is_one_short_line(tmp_path, monkeypatch):
    for name in ("a", "b", "c"):
        (tmp_path / "from" / "pictures").mkdir(parents=True, exist_ok=True)
        (tmp_path / "from" / "pictures" / name).write_text(name)
    seal(tmp_path / "from", "key")
    copy_whole(tmp_path / "from", tmp_path / "to")
    assert sorted(f.name for f in (tmp_path / "to").rglob("*")) == ["a", "b", "c", "pictures"]

    def full(source: Path, target: Path) -> None:
        raise OSError(28, "No space left on device", str(source))

    monkeypatch.setattr("shutil.copyfile", full)
    with pytest.raises(InputError) as caught:
        copy_whole(tmp_path / "from", tmp_path / "full")
    said = f"{tmp_path / 'full' / 'pictures' / 'a'}: cannot be written: No space left on device"
    assert str(caught.value) == f"{said}; choose another place"


def test_the_cache_makes_once_and_again_when_damaged(tmp_path, monkeypatch):
    monkeypatch.setenv("MAURICE_CACHE", str(tmp_path))
    made: list[Path] = []

    def make(folder: Path) -> None:
        made.append(folder)
        folder.mkdir(parents=True)
        (folder / "file").write_text("text")
        seal(folder, "key")

    first = cached("kind", "key", make)
    assert cached("kind", "key", make) == first == tmp_path / "kind" / "key"
    assert len(made) == 1
    (first / "file").write_text("cut")
    cached("kind", "key", make)
    assert len(made) == 2
    assert (first / "file").read_text() == "text"


def test_fingerprints_tell_worlds_apart_by_anything_in_them(world):
    same = replace(world, nodes=world.nodes.copy())
    assert fingerprint(same) == fingerprint(world)
    moved = world.nodes + np.array([0, 1e-9])
    box = Box((0, 0, 0), (1, 1, 1))
    others = [
        replace(world, nodes=moved),
        replace(world, solid=(*world.solid, box)),
        replace(world, headings=world.headings + 1),
        replace(world, furniture=world.furniture[1:]),
    ]
    assert len({fingerprint(w) for w in (world, *others)}) == 5
