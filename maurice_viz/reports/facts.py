"""Facts of a run for a report: what it was made from, with what, and what was in force."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import PurePath
from typing import Any

import numpy as np

from maurice_loaders.runs.manifest import CONFIGURATION, versions_now
from maurice_loaders.runs.sources import Source
from maurice_loaders.runs.store import SavedRun
from maurice_mcl.library import Library
from maurice_mcl.session import SessionInfo

from ..app.tracks import Collected
from ..style import Scale
from .markup import Markup, joined, table, tag

SHORT_HASH = 16  # digits of a SHA-256 that are shown: enough to compare by eye
NOT_THERE = "not at hand"


def session_facts(
    info: SessionInfo, run: SavedRun, collected: Collected, scale: Scale
) -> Iterator[tuple[str, str]]:
    """Name what is known of the session."""
    manifest, track = run.manifest, collected.tracks[0]
    yield "session", manifest.name
    yield "log", _place(manifest.session)
    yield "SHA-256 of the log", _hash(manifest.session.sha256)
    yield "robot", info.robot
    yield "pictures", f"{manifest.pictures} ({collected.steps} in this report)"
    if collected.picture_size is not None:
        yield "size of a picture", "{} x {} px".format(*collected.picture_size)
    seconds = float(track.column("time_s")[-1])
    yield "time", f"{seconds:.0f} s to the last step"
    yield "way by odometry", scale.say(float(np.nansum(track.column("odometry_m"))))
    known = np.isfinite(track.column("position_error_m")).sum()
    yield "truth", f"known at {known} of {collected.steps} steps" if known else "not known"


def library_facts(library: Library, runs: Sequence[SavedRun], scale: Scale) -> Iterator[tuple[str, str]]:
    """Name what is known of the library, and which channels the runs used of it."""
    manifest = runs[0].manifest
    yield "library", library.name if library.size else NOT_THERE
    yield "made from", _place(manifest.library)
    yield "SHA-256", _hash(manifest.library.sha256)
    if library.size:
        places = np.unique(np.round(library.poses[:, :2], 3), axis=0)
        yield "references", f"{library.size} at {len(places)} places"
    yield "map", " x ".join(scale.say(side) for side in library.arena.size_m)
    used = dict.fromkeys(name for run in runs for name in run.manifest.channels)
    yield "channels that were used", ", ".join(used)


def run_facts(run: SavedRun, scale: Scale) -> Iterator[tuple[str, str]]:
    """Name what makes one run repeatable."""
    manifest = run.manifest
    yield "seed", str(manifest.seed)
    yield "start", "anywhere" if manifest.start is None else scale.say_pose(np.array(manifest.start))
    ended = {"writing": "was cut off", "complete": "complete"}.get(manifest.state, manifest.state)
    yield "state", ended
    yield "channels", ", ".join(manifest.channels)
    yield "SHA-256 of what it used of the library", _hash(manifest.library_content)
    yield "SHA-256 of the configuration", _hash(manifest.configuration_sha256)
    for name in versions_now():
        yield name, str(manifest.versions.get(name, "-"))


def _place(source: Source) -> str:
    """Name a file with its folder, and nothing above that: where it lies on somebody's disk is no news."""
    return "/".join(PurePath(source.path).parts[-2:])


def _hash(digest: str) -> Markup:
    return tag("code", digest[:SHORT_HASH] + "...", title=digest)


def configuration_text(run: SavedRun) -> str:
    """Read the configuration in force, as TOML."""
    return (run.folder / CONFIGURATION).read_text(encoding="utf-8").strip()


def differing(runs: Sequence[SavedRun]) -> list[tuple[str, ...]]:
    """Give the keys whose values are not the same in all runs, each with a value a run."""
    flat = [_flat(tomllib.loads(configuration_text(run))) for run in runs]
    for one, run in zip(flat, runs, strict=True):
        one["seed"] = str(run.manifest.seed)
    keys = dict.fromkeys(key for one in flat for key in one)
    rows = [(key, *(one.get(key, "-") for one in flat)) for key in keys]
    return [row for row in rows if len(set(row[1:])) > 1]


def _flat(table: Mapping[str, Any], above: str = "") -> dict[str, str]:
    found: dict[str, str] = {}
    for key, value in table.items():
        if isinstance(value, dict):
            found |= _flat(value, f"{above}{key}.")
        else:
            found[f"{above}{key}"] = str(value)
    return found


def configuration(runs: Sequence[SavedRun], class_: str = "facts") -> Markup:
    """Give the configuration of the first run whole, and where the others differ."""
    parts: list[str] = []
    labels = [run.manifest.label for run in runs]
    if len(runs) > 1:
        rows = differing(runs)
        if rows:
            parts.append(table("Where the runs differ", ("key", *labels), rows, class_))
        else:
            parts.append(tag("p", "All runs have the same configuration and seed."))
    parts.append(tag("h3", f"All of it, as TOML: {labels[0]}"))
    parts.append(tag("pre", configuration_text(runs[0])))
    for run, label in zip(runs[1:], labels[1:], strict=True):
        parts.append(
            tag("details", tag("summary", f"All of it: {label}"), tag("pre", configuration_text(run)))
        )
    return joined(parts)
