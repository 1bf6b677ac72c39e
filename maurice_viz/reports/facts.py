"""Facts of saved runs for a report: what they were made from, with what, and their configurations."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import PurePath
from typing import Any

import numpy as np
from markupsafe import Markup

from maurice_loaders.runs.manifest import CONFIGURATION, Source, versions_now
from maurice_loaders.runs.store import SavedRun
from maurice_mcl.library import Library
from maurice_mcl.session import SessionInfo

from ..app.saved_steps import Collected
from ..style import Scale

SHORT_HASH = 16  # digits of a SHA-256 that are shown: enough to compare by eye
DIGEST = Markup('<code title="{}">{}...</code>')
MISSING = "not available"

Facts = Iterator[tuple[str, str]]


def session_facts(info: SessionInfo, run: SavedRun, collected: Collected, scale: Scale) -> Facts:
    """Yield name and value of what is known of the session."""
    manifest, track = run.manifest, collected.tracks[0]
    yield "session", manifest.name
    yield "log", _place(manifest.session)
    yield "SHA-256 of the log", _digest(manifest.session.sha256)
    yield "robot", info.robot
    yield "pictures", f"{manifest.pictures} ({collected.steps} in this report)"
    if collected.picture_size is not None:
        yield "picture size", "{} x {} px".format(*collected.picture_size)
    yield "duration", f"{track.column('time_s')[-1]:.0f} s to the last step"
    yield "distance by odometry", scale.say(float(np.nansum(track.column("odometry_m"))))
    known = np.isfinite(track.column("position_error_m")).sum()
    yield "truth", f"known at {known} of {collected.steps} steps" if known else "not known"


def library_facts(library: Library, runs: Sequence[SavedRun], scale: Scale) -> Facts:
    """Yield name and value of what is known of the library, and the channels of it that the runs used."""
    manifest = runs[0].manifest
    yield "library", library.name if library.size else MISSING
    yield "made from", _place(manifest.library)
    yield "SHA-256", _digest(manifest.library.sha256)
    if library.size:
        places = np.unique(np.round(library.poses[:, :2], 3), axis=0)
        yield "references", f"{library.size} at {len(places)} places"
    yield "map", " x ".join(scale.say(side) for side in library.arena.size_m)
    yield "channels used", ", ".join(dict.fromkeys(name for run in runs for name in run.manifest.channels))


def run_facts(runs: Sequence[SavedRun], scale: Scale) -> Iterator[tuple[str, ...]]:
    """Yield name and value for each run of what makes it repeatable."""
    columns = [list(_run_facts(run, scale)) for run in runs]
    for row in zip(*columns, strict=True):
        yield row[0][0], *(value for _, value in row)


def _run_facts(run: SavedRun, scale: Scale) -> Facts:
    manifest = run.manifest
    yield "seed", str(manifest.seed)
    yield "initial pose", "unknown" if manifest.start is None else scale.say_pose(np.array(manifest.start))
    yield "state", {"writing": "interrupted", "complete": "complete"}.get(manifest.state, manifest.state)
    yield "channels", ", ".join(manifest.channels)
    yield "SHA-256 of the library content used", _digest(manifest.library_content)
    yield "SHA-256 of the configuration", _digest(manifest.configuration_sha256)
    for name in versions_now():
        yield name, str(manifest.versions.get(name, "-"))


def _place(source: Source) -> str:
    """Return a file's name with its folder; where that is on somebody's disk matters to nobody else."""
    return "/".join(PurePath(source.path).parts[-2:])


def _digest(digest: str) -> Markup:
    return DIGEST.format(digest, digest[:SHORT_HASH])


def configuration_text(run: SavedRun) -> str:
    """Return the configuration of a run as TOML."""
    return (run.folder / CONFIGURATION).read_text(encoding="utf-8").strip()


def differing(runs: Sequence[SavedRun]) -> list[tuple[str, ...]]:
    """Return the keys whose values differ between runs, each with the value of each run."""
    flat = [_flat(tomllib.loads(configuration_text(run))) | {"seed": str(run.manifest.seed)} for run in runs]
    rows = [
        (key, *(one.get(key, "-") for one in flat)) for key in dict.fromkeys(k for one in flat for k in one)
    ]
    return [row for row in rows if len(set(row[1:])) > 1]


def _flat(table: Mapping[str, Any], above: str = "") -> dict[str, str]:
    found: dict[str, str] = {}
    for key, value in table.items():
        found |= _flat(value, f"{above}{key}.") if isinstance(value, dict) else {f"{above}{key}": str(value)}
    return found
