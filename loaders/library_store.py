"""Libraries on disk: a library folder is read, a survey log is built once and kept in the cache."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from pathlib import Path

import cv2

from maurice_mcl.library import Library

from .errors import LogError
from .findings import Findings
from .folders import cache_root, discard
from .library_build import Progress, Warn, build_library, chosen_channels, silent
from .library_files import VERSION, hash_file, load_library, manifest_warnings, save_library
from .log_records import PictureRecord, read_header, read_records

__all__ = ["build_library", "library_key", "load_library", "open_library", "save_library"]


def open_library(
    path: Path,
    channels: Sequence[str] | None = None,
    *,
    keep_going: bool = False,
    progress: Progress | None = None,
    warn: Warn | None = None,
) -> Library:
    """Read a library folder, or build a survey log's library unless the cache has it.

    The cache knows a library by the content of log and pictures and by the channels' parameters; what is
    damaged there is built again. LogError for anything that is neither library nor survey.
    """
    if path.is_dir():
        return load_library(path)
    kept = cache_root() / "libraries" / library_key(path, channels, keep_going=keep_going)
    cached = _from_cache(kept, warn)
    if cached is not None and set(chosen_channels(channels)) <= set(cached.index):
        return cached  # else a channel failed when it was built, and may have been mended since
    warnings: list[str] = []
    built = build_library(path, channels, keep_going=keep_going, progress=progress, warn=warnings.append)
    kept_now = _into_cache(built, kept, warnings)
    for text in warnings:
        (warn or silent)(text)
    return kept_now


def library_key(survey: Path, channels: Sequence[str] | None = None, *, keep_going: bool = False) -> str:
    """Name a survey's library by content: log, pictures, channel parameters, and what decodes pictures."""
    parameters = {name: channel.parameters() for name, channel in chosen_channels(channels).items()}
    made_by = [VERSION, keep_going, parameters, cv2.__version__]
    _, kind = read_header(survey)
    digest = hashlib.sha256(json.dumps(made_by, sort_keys=True).encode())
    digest.update(hash_file(survey).encode())
    for record in read_records(survey, kind, Findings(keep_going=True)):
        if isinstance(record, PictureRecord) and record.path is not None:
            file = survey.parent / record.path
            digest.update((hash_file(file) if file.is_file() else "missing").encode())
    return digest.hexdigest()[:32]


def _from_cache(kept: Path, warn: Warn | None) -> Library | None:
    try:
        library = load_library(kept)
        for text in manifest_warnings(kept):
            (warn or silent)(text)
    except (LogError, ValueError):  # not there, or damaged: it is only a cache
        return None
    return library


def _into_cache(built: Library, kept: Path, warnings: list[str]) -> Library:
    """Keep a library; where that fails the built one serves as well, with its pictures at the survey."""
    there = kept.exists()  # asked before it is read: what comes into place afterwards is never thrown away
    quicker = _from_cache(kept, None)
    if quicker is not None and set(built.index) <= set(quicker.index):
        return quicker
    try:
        if there:
            discard(kept)  # it is damaged, or lacks a channel
        save_library(built, kept, warnings=warnings)
        not_kept = "it was removed meanwhile"
    except (LogError, OSError) as problem:
        not_kept = str(problem)
    library = _from_cache(kept, None)  # ours, or that of another process that was quicker still
    if library is None:
        warnings.append(f"the library was not kept for next time: {not_kept}")
    return library or built
