"""The manifest of a saved run: what it was made from, with what, and how far it got."""

from __future__ import annotations

import json
import math
import os
import platform
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from maurice_mcl.reasons.causes import CAUSES, Failure, Value
from maurice_mcl.scoring.episodes import Episode
from maurice_mcl.scoring.table import KIDNAPPED, LOST, PROBABLY_LOST, SEARCHING
from maurice_mcl.sensor.outside import package_of
from maurice_mcl.values import NAMES, USUAL, Library, Radii

from ..errors import FieldError, InputError
from ..files.paths import A_RUN, kind_of
from ..files.text import PICTURES, flag, items, mapping, number, numbers, read_json, show, text, whole
from ..files.writing import FolderKind, check_target, put
from ..formats.cmucam import ENDINGS as DUMPS
from ..formats.donkeycar import looks_like_tub
from ..formats.registry import unlike
from ..formats.video import ENDINGS as VIDEOS
from ..libraries.files import MANIFEST, hash_file
from ..reading.options import Reading, reading_from_json, reading_to_json

FORMAT, COMPARISON = "maurice-run", "maurice-runs"
VERSION = 2
CONFIGURATION = "configuration.toml"
MAP = "map.json"
PARTS = rf"{MANIFEST}|{CONFIGURATION}|{MAP}|(?:particles|renewed|steps)/\d{{8}}\.parquet"
RUNS = (
    FolderKind("a saved run", MANIFEST, FORMAT, PARTS),
    FolderKind("saved runs", MANIFEST, COMPARISON, rf"(?:[^/]+/)?(?:{PARTS})"),
)
SHARED = ("world", "session", "compare")  # in a recording these stand for what runs share
STATES = ("writing", "complete", "stopped", "failed")  # a killed process leaves "writing"


@dataclass(frozen=True, slots=True)
class RunManifest:
    """One saved run. `start` is None for anywhere."""

    label: str
    seed: int
    start: tuple[float, ...] | None  # x_m, y_m, heading_rad
    channels: tuple[str, ...]
    origin_m: tuple[float, ...]  # what the clouds' x_m and y_m are relative to
    name: str  # of the session
    display_units: str
    pictures: int  # of the session
    has_truth: bool
    keep_going: bool
    session: Source
    library: Source
    library_content: str  # of what the filter used of it, see `library_hash`
    configuration_sha256: str
    versions: Mapping[str, str]
    state: str = "writing"
    radii: Radii = USUAL  # by which it was judged; manifests without any are of runs judged by these
    steps: int | None = None  # written when it ended; None while writing
    reading: Reading = field(default_factory=Reading)  # all but its `table` and `keep_going`
    table: Source | None = None  # the file of `table` among the options of reading
    sensors: Mapping[str, str] = field(default_factory=dict)  # of other packages, to what has a version
    failures: tuple[Failure, ...] | None = None  # written when it ended; None: of an earlier version
    recorded: bool = False  # another localizer's, as a bag holds it: no filter of ours ran


def is_saved(path: Path) -> bool:
    """Return whether a path looks like a saved run, a broken one as well."""
    return (path / MANIFEST).is_file() and not looks_like_tub(path)


def check_run_target(folder: Path, *, force: bool) -> None:
    """Refuse a folder that no run may be written to; with `force` only a saved run is replaced."""
    check_target(folder, *RUNS, force=force)


def library_hash(library: Library, channels: Sequence[str]) -> str:
    """Return a SHA-256 of poses, walls and measurements: two libraries of one hash give the same run."""
    digest = sha256(repr(library.arena.bounds).encode())
    arrays: list[NDArray[Any]] = [
        library.poses,
        library.arena.walls,
        *(r.polygon for r in library.arena.obstacles),
    ]
    for name in channels:
        index = library.index[name]
        arrays += [index.references, index.noise_floor, index.relevance]
    for array in arrays:
        digest.update(str(array.shape).encode())
        digest.update(np.ascontiguousarray(array).data)
    return digest.hexdigest()


def versions_now(sensors: Iterable[str] = ()) -> dict[str, str]:
    """Name what a run depends on beside its inputs; `sensors` are those of other packages."""
    named = {"maurice-replay": version("maurice-replay"), "python": platform.python_version()}
    named |= {"numpy": np.__version__, "opencv": cv2.__version__, "scipy": version("scipy")}
    named |= {"polars": version("polars"), "machine": platform.machine()}
    return named | dict(map(package_of, sensors))


def write_manifest(folder: Path, manifest: RunManifest) -> None:
    """Write it at once or not at all."""
    values = asdict(manifest) | {"reading": reading_to_json(manifest.reading)}
    values["failures"] = None if manifest.failures is None else [*map(failure_to_json, manifest.failures)]
    data = to_bytes({"format": FORMAT, "version": VERSION, **values})
    put(folder / MANIFEST, data)


def ended(manifest: RunManifest, state: str, steps: int, failures: Sequence[Failure] | None) -> RunManifest:
    """Return the manifest of a run that ended, with how and how far, and why it failed."""
    known = None if failures is None else tuple(failures)
    return replace(manifest, state=state, steps=steps, failures=known)


def to_bytes(value: Mapping[str, Any]) -> bytes:
    """Write an object as JSON for people and programs."""
    return (json.dumps(value, indent=1, ensure_ascii=False, allow_nan=False) + "\n").encode()


def read_manifest(folder: Path) -> RunManifest:
    """Read the manifest of one run. Raises InputError for anything else, in one line."""
    values = read_object(folder, FORMAT)
    try:
        return _manifest(values)
    except (FieldError, TypeError) as problem:
        raise InputError(folder / MANIFEST, f"{problem}; is it damaged?") from None


def read_object(folder: Path, *formats: str) -> dict[str, Any]:
    """Read a manifest of one of some formats and of this version. Raises InputError for any other."""
    file = folder / MANIFEST
    if not file.is_file():
        raise unlike(folder, A_RUN)
    try:
        values = mapping(read_json(file.read_bytes()), "manifest")
    except ValueError as problem:
        raise InputError(file, f"is no manifest ({problem}); is it damaged?") from None
    if values.get("format") not in formats:
        if kind_of(folder) is not None:
            raise unlike(folder, A_RUN)
        raise InputError(file, f"found format {show(values.get('format'))}, expected {formats[0]!r}")
    if values.get("version") != VERSION:
        known = f"expected {VERSION}; replay the session again with --save-run"
        raise InputError(file, f"found version {show(values.get('version'))} of the format, {known}")
    return values


def _manifest(values: Mapping[str, Any]) -> RunManifest:
    start, steps, state = values.get("start"), values.get("steps"), values.get("state")
    if state not in STATES:
        raise FieldError(f"found state {show(state)}, expected one of {', '.join(STATES)}")
    return RunManifest(
        label=_label(values.get("label")),
        seed=whole(values.get("seed"), "seed"),
        start=None if start is None else tuple(numbers(start, 3, "start")),
        channels=tuple(text(name, "channels") for name in items(values.get("channels"), "channels")),
        origin_m=tuple(numbers(values.get("origin_m"), 2, "origin_m")),
        name=text(values.get("name"), "name"),
        display_units=_units(values.get("display_units")),
        pictures=whole(values.get("pictures"), "pictures"),
        has_truth=flag(values.get("has_truth"), "has_truth"),
        keep_going=flag(values.get("keep_going"), "keep_going"),
        session=_source(values.get("session"), "session"),
        library=_source(values.get("library"), "library"),
        library_content=text(values.get("library_content"), "library_content"),
        configuration_sha256=text(values.get("configuration_sha256"), "configuration_sha256"),
        versions={k: text(v, k) for k, v in mapping(values.get("versions"), "versions").items()},
        state=str(state),
        radii=_radii(values.get("radii")),
        steps=None if steps is None else whole(steps, "steps"),
        reading=reading_from_json(values.get("reading")),
        sensors={k: text(v, k) for k, v in mapping(values.get("sensors", {}), "sensors").items()},
        table=None if values.get("table") is None else _source(values["table"], "table"),
        recorded=flag(values.get("recorded", False), "recorded"),
        failures=None if values.get("failures") is None else failures_from_json(values["failures"], steps),
    )


def _source(value: Any, what: str) -> Source:
    values = mapping(value, what)
    return Source(*(text(values.get(key), f"{what}.{key}") for key in ("path", "beside", "sha256")))


def _radii(value: Any) -> Radii:
    if value is None:
        return USUAL
    values = mapping(value, "radii")
    radii = Radii(**{name: number(values.get(name), f"radii.{name}") for name in NAMES})
    if not min(radii.confidence_m, radii.cluster_m, radii.right_m) > 0 or radii.lost_m < radii.right_m:
        raise FieldError(f"found radii {show(value)}, expected lengths above 0, and no lost_m below right_m")
    return radii


def _label(value: Any) -> str:
    label = text(value, "label")
    if "/" in label or label in SHARED:
        raise FieldError(f"found label {show(label)}, expected a word without '/'")
    return label


def _units(value: Any) -> str:
    if value not in ("m", "in"):
        raise FieldError(f"found display_units {show(value)}, expected 'm' or 'in'")
    return str(value)


# Failures: what a diagnosis found when the run ended.


def failure_to_json(failure: Failure) -> dict[str, Any]:
    """Return a failure as JSON; a number that is infinite or none, which JSON cannot hold, as null."""
    evidence = {
        name: None if isinstance(value, float) and not math.isfinite(value) else value
        for name, value in failure.evidence.items()
    }
    return asdict(failure) | {"evidence": evidence, "also": list(failure.also)}


def failures_from_json(value: Any, steps: int | None) -> tuple[Failure, ...]:
    """Return the failures of a run of so many steps; none of one that did not end. FieldError for others."""
    failures = [] if steps is None else items(value, "failures")
    return tuple(_failure(mapping(failure, "failures"), steps or 0) for failure in failures)


def _failure(values: dict[str, Any], steps: int) -> Failure:
    first = whole(values.get("first"), "failures.first")
    episode = _episode(mapping(values["episode"], "failures.episode"))
    named = [first, episode.first, episode.onset, episode.last]
    if not 1 <= min(named) <= max(named) <= steps:
        raise FieldError(f"found a failure from step {min(named)} to {max(named)}, expected 1 to {steps}")
    return Failure(
        _kind(values.get("kind")),
        first,
        episode,
        {
            str(name): _value(value)
            for name, value in mapping(values.get("evidence"), "failures.evidence").items()
        },
        flag(values.get("truth_known"), "failures.truth_known"),
        tuple(_kind(kind) for kind in items(values.get("also"), "failures.also")),
    )


def _episode(values: dict[str, Any]) -> Episode:
    kind = values.get("kind")
    if kind not in (KIDNAPPED, LOST, SEARCHING, PROBABLY_LOST):
        raise FieldError(f"found episode {show(kind)}, expected kidnapped, lost, searching or probably-lost")
    named: dict[str, Any] = {field.name: values.get(field.name) for field in fields(Episode)[1:]}
    for name, value in named.items():
        named[name] = None if value is None else whole(value, f"failures.episode.{name}")
    return Episode(kind, **named)


def _kind(value: Any) -> str:
    if value not in CAUSES:
        raise FieldError(f"found cause {show(value)}, expected one of {', '.join(CAUSES)}")
    return str(value)


def _value(value: Any) -> Value:
    if value is None:
        return math.inf
    return text(value, "failures.evidence") if isinstance(value, str) else number(value, "failures.evidence")


# what a folder is read from, beside pictures
CONTENTS = (".log", ".csv", ".tsv", ".yaml", ".yml", ".db3", ".mcap", ".zstd", *VIDEOS, *DUMPS, ".catalog")


@dataclass(frozen=True, slots=True)
class Source:
    """A file or folder that a run was made from, and what it held."""

    path: str  # absolute, at the time
    beside: str  # the same seen from the run's folder, for when both were moved together
    sha256: str  # see `source_hash`

    def find(self, folder: Path) -> Path | None:
        """Return where it is now; None when it is in neither place."""
        places = (Path(self.path), folder / self.beside)
        return next((place for place in places if place.exists()), None)


def source_of(path: Path, folder: Path, others: Sequence[Path] = ()) -> Source:
    """Describe a recording, table or library as seen from a run's folder; `others` belong to it."""
    whole = path.resolve()
    beside = Path(os.path.relpath(whole, folder.resolve())).as_posix()
    return Source(str(whole), beside, source_hash(whole, others))


def source_hash(path: Path, others: Sequence[Path] = ()) -> str:
    """Return the SHA-256 of a file, a library's manifest, or what can be read in a folder, and `others`.

    Pictures count by name and size, as each step of a run has its picture's own hash.
    """
    if others:
        return sha256("\n".join([source_hash(path), *map(hash_file, others)]).encode()).hexdigest()
    if not path.is_dir():
        return hash_file(path)
    if (path / MANIFEST).is_file() and not looks_like_tub(path):
        return hash_file(path / MANIFEST)
    digest = sha256()
    for file in sorted(path.rglob("*")):
        kind = file.suffix.lower()
        if file.name.startswith(".") or kind not in (*PICTURES, *CONTENTS) or not file.is_file():
            continue
        content = str(file.stat().st_size) if kind in PICTURES else hash_file(file)
        digest.update(f"{file.relative_to(path).as_posix()}\0{content}\n".encode(errors="surrogateescape"))
    return digest.hexdigest()
