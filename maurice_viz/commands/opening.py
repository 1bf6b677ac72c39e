"""From what was typed to a session, a library and runs."""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from pathlib import Path

from maurice_loaders.errors import LogError
from maurice_loaders.library_store import open_library
from maurice_loaders.session_log import SessionLog
from maurice_mcl.library import Library
from maurice_mcl.localizer import make_localizer
from maurice_mcl.sensor import FEATURES

from ..console import note, progress
from ..entities import RESERVED
from ..replaying import Run
from .options import RunOptions, start_pose

COMMANDS = ("replay", "compare", "demo", "library", "import", "inspect")


def open_session(path: Path, *, keep_going: bool) -> SessionLog:
    """Open a session log; a word that is no file gets the nearest command's name instead of "no file"."""
    if not path.exists():
        near = difflib.get_close_matches(str(path), COMMANDS, n=1)
        advice = f"did you mean the command {near[0]}?" if near else "maurice-replay --help lists commands"
        raise LogError(path, f"there is no session or command of that name; {advice}")
    return SessionLog(path, keep_going=keep_going)


def open_library_for(session: SessionLog, library: Path | None, *, keep_going: bool) -> Library:
    """Open the library that was asked for, or the one that the session's header names."""
    path = library or session.info.survey
    if path is None:
        raise LogError(session.path, 'found no "survey" in the header; say which with --library', 1)
    if not path.exists():
        raise LogError(path, "found no such library or survey; say which with --library")
    with progress("library") as advance:
        return open_library(path, keep_going=keep_going, progress=advance, warn=note)


def make_runs(
    session: SessionLog, library: Library, features: Sequence[str], options: RunOptions
) -> list[Run]:
    """Put together one run a feature, on the same drive and with the same seed."""
    start = start_pose(options.start, session.info, session.path)
    _check_channels(session, library, features)
    try:
        localizers = [
            make_localizer(
                library,
                session,
                feature=feature,
                particles=options.particles,
                seed=options.seed,
                resampler=options.resampler,
                sharpness=options.sharpness,
            )
            for feature in features
        ]
    except ValueError as problem:  # bad motion parameters in the header, or nowhere to start
        raise LogError(session.path, str(problem), 1) from None
    return [Run(label, made, start) for label, made in zip(unique_labels(features), localizers, strict=True)]


def _check_channels(session: SessionLog, library: Library, features: Sequence[str]) -> None:
    for feature in features:
        missing = [channel for channel in FEATURES[feature] if channel not in library.index]
        if missing:
            found = f"the library {library.name!r} holds {', '.join(library.index) or 'no channel'}"
            raise LogError(
                session.path, f"{found}, and {feature} needs {missing[0]}; build the library again"
            )


def unique_labels(names: Sequence[str]) -> list[str]:
    """Name runs after their features; a second one of the same name becomes `color-2`."""
    labels: list[str] = []
    for name in names:
        label, number = name, 1
        while label in labels or label in RESERVED:
            number += 1
            label = f"{name}-{number}"
        labels.append(label)
    return labels
