"""A library as a folder of its own: manifest, entries, map, pictures, one file per channel.

A channel's file is an array (L + 2, D): its noise floor, its relevance, then the L references. It is mapped
into memory, not read, so that a large library opens at once.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import shutil
import zipfile
from collections.abc import Mapping, Sequence
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from maurice_mcl.sensor.descriptors.registry import CHANNELS, OUR_NAMES, reduction
from maurice_mcl.values import F32, F64, Camera, ChannelIndex, Library, PoseSensor

from ..errors import FieldError, InputError, PictureError
from ..files.maps import check_span
from ..files.paths import A_LIBRARY, kind_of
from ..files.pictures import leads_outside, picture_file, picture_size
from ..files.text import MOST, items, mapping, read_json, show, text, up_to
from ..files.writing import FolderKind, new_folder
from ..formats.registry import unlike
from ..session_log.header import arena_from_json, arena_to_json, camera_from_json, camera_to_json
from .remembered import remembered

FORMAT = "maurice-library"
VERSION = 2
MANIFEST = "manifest.json"
LIBRARY = FolderKind(
    "a library",
    MANIFEST,
    FORMAT,
    r"manifest\.json|map\.json|entries\.parquet|[^/]+-[0-9a-f]{12}\.npy|pictures/\d{5,}\.\w+|sensors/\w+\.npz",
)
DAMAGE = (FieldError, OSError, ValueError, KeyError, zipfile.BadZipFile)


def save_library(
    library: Library, folder: Path, *, force: bool = False, warnings: Sequence[str] = ()
) -> None:
    """Write a library and copies of its pictures, completely or not at all. InputError if it exists."""
    with new_folder(folder, LIBRARY, force=force) as filling:
        _write_json(filling / "map.json", arena_to_json(library.arena))
        _write_entries(library, filling)
        files = {name: f"{name}-{parameter_hash(name)}.npy" for name in library.index}
        for name, index in library.index.items():
            rows = np.concatenate([index.noise_floor[None], index.relevance[None], index.references])
            np.save(filling / files[name], rows.astype(np.float32, copy=False))
        sensors = _write_sensors(library, filling)
        _write_json(filling / MANIFEST, _manifest(library, filling, files, sensors, warnings))


def load_library(folder: Path) -> Library:
    """Read a library folder. InputError if it is none, damaged, of other parameters, or too large."""
    try:
        manifest = read_manifest(folder)
        _check_files(folder, manifest)
        poses, pictures = _read_entries(folder)
        library = Library(
            name=text(manifest.get("name"), "name"),
            poses=poses,
            pictures=pictures,
            index=_read_channels(folder, manifest, len(poses)),
            arena=arena_from_json(read_json((folder / "map.json").read_bytes())),
            display_units=text(manifest.get("display_units"), "display_units"),
            sensors=_read_sensors(folder, manifest),
            camera=_read_camera(manifest),
        )
    except DAMAGE as problem:
        reason = f"is a damaged library ({problem}); build it again from its survey"
        raise InputError(folder, reason) from None
    check_span(folder, library.poses, library.arena)
    if not manifest.get("reduced"):
        _expect_small(folder, pictures)
    return library


def _expect_small(folder: Path, pictures: Sequence[Path | None]) -> None:
    """Raise InputError where large pictures were measured whole: a session's are reduced (`reduced`)."""
    first = next((picture for picture in pictures if picture is not None), None)
    with suppress(PictureError):  # one that cannot be read is told of by who shows it
        size = (1, 1) if first is None else picture_size(picture_file(first))
        if reduction(*size) > 1:
            text = f"was measured in whole pictures of {size[0]} x {size[1]} pixels, and now they are reduced"
            raise InputError(folder, f"{text}; build it again from its survey")


def read_manifest(folder: Path) -> dict[str, Any]:
    """Read a library's manifest. Raises InputError if the folder is no library of a known version."""
    file = folder / MANIFEST
    if not file.is_file():
        raise unlike(folder, A_LIBRARY)
    manifest = mapping(read_json(file.read_bytes()), MANIFEST)
    if manifest.get("format") != FORMAT:
        if kind_of(folder) is not None:
            raise unlike(folder, A_LIBRARY)
        raise InputError(file, f"found format {show(manifest.get('format'))}, expected {FORMAT!r}")
    if manifest.get("version") != VERSION:
        text = f"found version {show(manifest.get('version'))}, expected {VERSION}; build it again"
        raise InputError(file, text)
    return manifest


def manifest_warnings(folder: Path) -> tuple[str, ...]:
    """Return what was worth saying when the library in this folder was built."""
    return tuple(text(w, "warnings") for w in items(read_manifest(folder).get("warnings", []), "warnings"))


def parameter_hash(channel: str) -> str:
    """Return 12 characters that change with a channel's parameters."""
    return hashlib.sha256(_canonical(CHANNELS[channel].parameters())).hexdigest()[:12]


def _canonical(value: Any) -> bytes:
    return json.dumps(value, sort_keys=True, allow_nan=False).encode()


def _write_json(file: Path, value: Mapping[str, Any]) -> None:
    file.write_text(json.dumps(value, indent=1, ensure_ascii=False, allow_nan=False) + "\n", encoding="utf-8")


def _write_entries(library: Library, folder: Path) -> None:
    (folder / "pictures").mkdir()
    names: list[str | None] = []
    for number, picture in enumerate(library.pictures):
        name = None if picture is None else f"pictures/{number:05d}{picture.suffix.lower()}"
        if picture is not None and name is not None:
            try:
                shutil.copyfile(picture, folder / name)
            except OSError as problem:
                raise InputError(picture, f"cannot be copied into the library: {problem.strerror}") from None
        names.append(name)
    import polars as pl

    columns = {key: library.poses[:, k] for k, key in enumerate(("x_m", "y_m", "heading_rad"))}
    entries = pl.DataFrame({**columns, "picture": pl.Series(names, dtype=pl.String)})
    entries.write_parquet(folder / "entries.parquet")


def _manifest(
    library: Library,
    folder: Path,
    files: Mapping[str, str],
    sensors: Mapping[str, str],
    warnings: Sequence[str],
) -> dict[str, Any]:
    parts, camera = ["map.json", "entries.parquet", *files.values(), *sensors.values()], library.camera
    return {
        "format": FORMAT,
        "version": VERSION,
        "reduced": True,  # large pictures, before they were measured
        "name": library.name,
        "display_units": library.display_units,
        "entries": library.size,
        "camera": None if camera is None else {"name": camera.name, **camera_to_json(camera)},
        "channels": {
            name: {"file": files[name], "parameters": CHANNELS[name].parameters()} for name in files
        },
        "sensors": {name: {"file": file} for name, file in sensors.items()},
        "warnings": list(warnings),
        "sha256": {part: hash_file(folder / part) for part in parts},
    }


def _read_camera(manifest: Mapping[str, Any]) -> Camera | None:
    if manifest.get("camera") is None:
        return None
    fields = mapping(manifest["camera"], "camera")
    return camera_from_json(text(fields.get("name"), "camera.name"), fields)


def hash_file(file: Path) -> str:
    """Return a file's SHA-256 in hexadecimal."""
    with file.open("rb") as data:
        return hashlib.file_digest(data, "sha256").hexdigest()


def hashes_of(files: Sequence[str]) -> str:
    """Return the SHA-256 of each file, one after the other; "missing" for one that is not there."""
    return "".join(hash_file(Path(file)) if Path(file).is_file() else "missing" for file in files)


def _check_files(folder: Path, manifest: Mapping[str, Any]) -> None:
    """Compare every part with its checksum, so that no parser ever sees damaged bytes."""
    expected = mapping(manifest.get("sha256"), "sha256")
    unchecked = [part for part in _parts(manifest) if part not in expected]
    if unchecked:
        raise FieldError(f"no checksum of {unchecked[0]} among sha256")
    for part in expected:
        if leads_outside(part) or not (folder / part).is_file():
            raise FieldError(f"{part} is missing")
    files = [str(folder / part) for part in expected]
    hashes = json.loads(remembered("sha256", files, lambda: json.dumps([hash_file(Path(f)) for f in files])))
    for part, right, now in zip(expected, expected.values(), hashes, strict=True):
        if now != right:
            raise FieldError(f"{part} was changed after it was written")


def _parts(manifest: Mapping[str, Any]) -> list[str]:
    """Return the names of all files that are read besides the manifest and the pictures."""
    described = [
        (f"{key}.{name}", value)
        for key in ("channels", "sensors")
        for name, value in mapping(manifest.get(key, {}), key).items()
    ]
    files = [text(mapping(value, key).get("file"), f"{key}.file") for key, value in described]
    return ["map.json", "entries.parquet", *files]


def _read_entries(folder: Path) -> tuple[F64, tuple[Path | None, ...]]:
    file = folder / "entries.parquet"
    columns = json.loads(remembered("entries", [str(file)], lambda: _columns(file)))
    poses = np.array(columns[:3], np.float64).T.copy()
    names = columns[3]
    outside = next((name for name in names if name is not None and leads_outside(name)), None)
    if outside is not None:
        raise FieldError(f"found the picture {show(outside)}, expected one in the library's folder")
    present = _pictures_in(folder)
    missing = set(names) - present - {None}
    lost = [name for name in names if name in missing and not (folder / name).is_file()]
    if lost or not np.isfinite(poses).all():
        raise FieldError(f"{Path(lost[0]).name} is missing" if lost else "a pose is not finite")
    if np.abs(poses).max(initial=0.0) > MOST:
        raise FieldError(f"found a pose of {np.abs(poses).max():g}, expected {up_to()}")
    return poses, tuple(None if name is None else folder / name for name in names)


def _columns(file: Path) -> str:
    """Return x_m, y_m, heading_rad and the pictures of entries as JSON."""
    import polars as pl  # slow to import

    try:
        entries = pl.read_parquet(io.BytesIO(file.read_bytes()))  # a path could be a glob
        return json.dumps([entries[name].to_list() for name in ("x_m", "y_m", "heading_rad", "picture")])
    except pl.exceptions.PolarsError as problem:
        raise FieldError(str(problem)) from None


def _pictures_in(folder: Path) -> set[str]:
    """Return the names of the pictures that are there; asking for them one by one takes ten times as long."""
    try:
        with os.scandir(folder / "pictures") as entries:
            return {f"pictures/{entry.name}" for entry in entries if entry.is_file()}
    except OSError:
        return set()


# Pose sensors: what a library has besides channels, each a file of arrays.

# name to where its class is, imported only for a library that holds one; it has `to_arrays`, `from_arrays`
STORED: Mapping[str, tuple[str, str]] = {
    "landmarks": ("maurice_mcl.sensor.landmarks.sensor", "Landmarks"),
}


def _write_sensors(library: Library, folder: Path) -> dict[str, str]:
    """Write every sensor that can be stored; return the files by name."""
    files: dict[str, str] = {}
    for name, sensor in library.sensors.items():
        to_arrays = getattr(sensor, "to_arrays", None)
        if to_arrays is not None and name in STORED:
            (folder / "sensors").mkdir(exist_ok=True)
            files[name] = f"sensors/{name}.npz"
            np.savez_compressed(folder / files[name], **to_arrays())
    return files


def _read_sensors(folder: Path, manifest: Mapping[str, Any]) -> dict[str, PoseSensor]:
    named = {}
    for name, value in mapping(manifest.get("sensors", {}), "sensors").items():
        file = text(mapping(value, f"sensors.{name}").get("file"), f"sensors.{name}.file")
        if name not in STORED:
            continue  # of a newer version, or somebody else's: a run that asks for it says that it is missing
        with np.load(folder / file, allow_pickle=False) as arrays:
            named[name] = getattr(import_module(STORED[name][0]), STORED[name][1]).from_arrays(dict(arrays))
    return named


def _read_channels(folder: Path, manifest: Mapping[str, Any], entries: int) -> dict[str, ChannelIndex]:
    index = {}
    for name, value in mapping(manifest.get("channels"), "channels").items():
        described = mapping(value, f"channels.{name}")
        known = CHANNELS.get(name)
        if known is not None and _canonical(known.parameters()) != _canonical(described.get("parameters")):
            if name not in OUR_NAMES:
                continue  # somebody else's changed: only a run that asks for it needs another library
            advice = "build it again from its survey"
            reason = f"was measured with other parameters of channel {name!r} than today's; {advice}"
            raise InputError(folder, reason)
        index[name] = _read_channel(folder / text(described.get("file"), f"channels.{name}.file"), entries)
    return index


def _read_channel(file: Path, entries: int) -> ChannelIndex:
    rows: F32 = np.asarray(np.load(file, mmap_mode="r", allow_pickle=False))
    if rows.ndim != 2 or len(rows) != entries + 2 or rows.dtype != np.float32:
        raise FieldError(f"{file.name} has other shapes than the entries")
    return ChannelIndex(rows[2:], rows[0], rows[1])
