"""A library folder stands alone, comes back exactly, and says so when it is damaged."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from maurice_loaders.errors import InputError
from maurice_loaders.files.pictures import encode_picture
from maurice_loaders.libraries.files import hash_file, load_library, save_library
from maurice_loaders.libraries.store import build_library
from maurice_mcl.values.library import Library


@pytest.fixture
def folder(survey: Path, tmp_path: Path) -> Path:
    """A saved library, elsewhere than its survey, in a folder that a shell would stumble over."""
    target = tmp_path / "a [b] *" / "Bücherei"
    save_library(build_library(survey), target)
    return target


def assert_same(a: Library, b: Library) -> None:
    assert (a.name, a.display_units, a.arena.bounds) == (b.name, b.display_units, b.arena.bounds)
    assert np.array_equal(a.poses, b.poses)
    assert list(a.index) == list(b.index)
    for name in a.index:
        for part in ("references", "noise_floor", "relevance"):
            assert np.array_equal(getattr(a.index[name], part), getattr(b.index[name], part))
            assert getattr(a.index[name], part).dtype == getattr(b.index[name], part).dtype


def test_comes_back_exactly_without_its_survey(survey: Path, folder: Path) -> None:
    built = build_library(survey)
    originals = [picture.read_bytes() for picture in built.pictures if picture]
    shutil.rmtree(survey.parent / "pictures")
    survey.unlink()
    library = load_library(folder)
    assert_same(library, built)
    assert [picture.read_bytes() for picture in library.pictures if picture] == originals


def test_a_moved_folder_still_works_and_a_library_may_replace_itself(folder: Path, tmp_path: Path) -> None:
    library = load_library(folder)
    save_library(library, folder, force=True)
    assert_same(load_library(folder), library)
    folder.rename(tmp_path / "moved")
    library = load_library(tmp_path / "moved")
    assert all(picture is not None and picture.is_file() for picture in library.pictures)


def test_entries_without_pictures_and_a_picture_that_is_gone_before_saving(
    survey: Path, tmp_path: Path
) -> None:
    built = build_library(survey)
    bare = Library(built.name, built.poses, (None,) * built.size, built.index, built.arena)
    save_library(bare, tmp_path / "bare")
    assert load_library(tmp_path / "bare").pictures == (None,) * 5
    library = build_library(survey)
    shutil.rmtree(survey.parent / "pictures")
    with pytest.raises(InputError, match="cannot be copied into the library"):
        save_library(library, tmp_path / "l")
    assert not (tmp_path / "l").exists()


def edit(name: str, change: Callable[[Path, bytes], object]) -> Callable[[Path], None]:
    """Change the one file of a name, which is read before."""

    def damage(folder: Path) -> None:
        (file,) = folder.glob(name)
        change(file, file.read_bytes())

    return damage


def cut(name: str) -> Callable[[Path], None]:
    return edit(name, lambda file, data: file.write_bytes(data[:-20]))


def flip(name: str) -> Callable[[Path], None]:
    def change(file: Path, data: bytes) -> None:
        at = len(data) // 2
        file.write_bytes(data[:at] + bytes([data[at] ^ 1]) + data[at + 1 :])

    return edit(name, change)


def remove(name: str) -> Callable[[Path], None]:
    return edit(name, lambda file, data: file.unlink())


def rewrite(key: str, value: object) -> Callable[[Path], None]:
    return edit(
        "manifest.json", lambda file, data: file.write_text(json.dumps(json.loads(data) | {key: value}))
    )


def pipe(name: str) -> Callable[[Path], None]:
    return edit(name, lambda file, data: (file.unlink(), os.mkfifo(file)))


def name_pictures(name: Callable[[Path], str]) -> Callable[[Path], None]:
    """Let the table name a picture elsewhere, with a checksum that is right: a stranger's library."""

    def change(folder: Path) -> None:
        outside = folder.parent / "outside.jpg"
        outside.write_bytes((folder / "pictures" / "00003.jpg").read_bytes())
        file = folder / "entries.parquet"
        entries = pl.read_parquet(file.read_bytes())
        names = [name(outside), *entries["picture"][1:]]
        entries.with_columns(pl.Series("picture", names)).write_parquet(file)
        manifest = json.loads((folder / "manifest.json").read_text())
        manifest["sha256"]["entries.parquet"] = hash_file(file)
        (folder / "manifest.json").write_text(json.dumps(manifest))

    return change


DAMAGE = {
    "cut manifest": cut("manifest.json"),
    "manifest without channels": rewrite("channels", None),
    "manifest with a channel that is not there": rewrite("channels", {"new": {"file": "new.npy"}}),
    "manifest without checksums": rewrite("sha256", None),
    "manifest with no checksum in it": rewrite("sha256", {}),
    "manifest with a channel outside": rewrite("channels", {"color": {"file": "../color.npy"}}),
    "manifest with checksums of files outside": rewrite("sha256", {"../manifest.json": ""}),
    "absolute picture": name_pictures(str),
    "picture outside": name_pictures(lambda file: f"../{file.name}"),
    "picture outside by a detour": name_pictures(lambda file: f"pictures/../../{file.name}"),
    "cut entries": cut("entries.parquet"),
    "flipped bit in the entries": flip("entries.parquet"),
    "no entries": remove("entries.parquet"),
    "cut map": cut("map.json"),
    "deep map": lambda folder: (folder / "map.json").write_text("[" * 100_000),
    "no map": remove("map.json"),
    "cut channel": cut("color-*.npy"),
    "flipped bit in a channel": flip("edges-*.npy"),
    "no channel": remove("edges-*.npy"),
    "a pipe for a channel": pipe("edges-*.npy"),
    "no picture": remove("pictures/00003.jpg"),
}


@pytest.mark.parametrize("name", DAMAGE)
def test_damage_is_one_clear_error(folder: Path, name: str) -> None:
    DAMAGE[name](folder)
    with pytest.raises(InputError, match=r"is a damaged library \(.*\); build it again") as caught:
        load_library(folder)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("format", "zip", "found format 'zip', expected 'maurice-library'"),
        ("version", 9, "found version 9, expected 2; build it again"),
        (
            "channels",
            {"color": {"parameters": {"bins": 7}}},
            "other parameters of channel 'color' than today's",
        ),
    ],
)
def test_other_formats(folder: Path, key: str, value: object, message: str) -> None:
    if key == "channels":
        known = json.loads((folder / "manifest.json").read_text())["channels"]
        value = known | {"color": known["color"] | {"parameters": {"bins": 7}}}
    rewrite(key, value)(folder)
    with pytest.raises(InputError, match=message):
        load_library(folder)


@pytest.mark.parametrize(
    ("x_m", "message"),
    [
        (1e300, r"is a damaged library \(found a pose of 1e\+300, expected a number up to 1e9 in size\)"),
        (1e8, r"found poses 1e\+08 m apart, the farthest off at \(100000000, 1\), expected at most 10000 m"),
        (None, r"far: found a map and poses that together span 1e\+07 m"),
    ],
)
def test_poses_too_far_off_and_a_map_too_large(
    survey: Path, tmp_path: Path, x_m: float | None, message: str
) -> None:
    built = build_library(survey)
    if x_m is None:
        changed = replace(built, arena=replace(built.arena, bounds=(0, 0, 1e7, 1)))
    else:
        changed = replace(
            built, poses=built.poses + np.outer(np.arange(5) == 3, [x_m - built.poses[3, 0], 0, 0])
        )
    save_library(changed, tmp_path / "far")
    with pytest.raises(InputError, match=message) as caught:
        load_library(tmp_path / "far")
    assert caught.value.file == tmp_path / "far"


def test_no_library(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="found an empty folder, expected a library"):
        load_library(tmp_path)


def test_large_pictures_that_were_measured_whole_are_refused(folder: Path) -> None:
    file = folder / "manifest.json"
    manifest = json.loads(file.read_text())
    del manifest["reduced"]
    file.write_text(json.dumps(manifest))
    assert load_library(folder).size > 0
    (first, *_) = sorted((folder / "pictures").iterdir())
    first.write_bytes(encode_picture(np.zeros((1080, 1920, 3), np.uint8), "jpeg"))
    with pytest.raises(InputError, match=r"measured in whole pictures of 1920 x 1080 .* build it again"):
        load_library(folder)


def test_folders_of_another_version_are_refused(folder: Path) -> None:
    manifest = json.loads((folder / "manifest.json").read_text())
    for version in (1, 3):
        (folder / "manifest.json").write_text(json.dumps(manifest | {"version": version}))
        with pytest.raises(InputError, match=f"found version {version}, expected 2; build it again"):
            load_library(folder)
