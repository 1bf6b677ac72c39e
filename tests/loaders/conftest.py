"""Small logs and pictures, made on the spot."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from maurice_loaders.config_files import to_toml
from maurice_loaders.formats.registry import open_session
from maurice_loaders.libraries.store import build_library
from maurice_loaders.runs.manifest import RunManifest, library_hash, source_of, versions_now
from maurice_loaders.runs.store import SavedRun, open_runs
from maurice_loaders.runs.writer import RunWriter
from maurice_loaders.session_log.writer import SessionWriter
from maurice_mcl.config.build import build_localizer
from maurice_mcl.config.parameters import Layer, configure
from maurice_mcl.filter.localizer import run
from maurice_mcl.values.arrays import U8
from maurice_mcl.values.library import Library, radii_of
from maurice_mcl.values.records import StepRecord
from maurice_mcl.values.session import Moment, SessionInfo

HEADER = {"format": "maurice-session-log", "version": 1, "kind": "session", "name": "test"}
PIXEL = "iVBORw0KGgoAAAANSUhEUgAAAAIAAAABCAIAAAB7QOjdAAAADUlEQVQIHWPkEpEDAgAB2gCYpjaFTAAAAABJRU5ErkJggg=="
WriteLog = Callable[..., Path]
Played = list[tuple[Moment, StepRecord]]
Save = Callable[..., tuple[Path, Played]]


@pytest.fixture
def image() -> U8:
    return np.random.default_rng(1).integers(0, 256, (12, 16, 3), dtype=np.uint8)


@pytest.fixture
def write_log(tmp_path: Path) -> WriteLog:
    """Write a log of records (objects, or text as it stands); `header` adds to a plain one."""

    def write(*records: dict[str, Any] | str, name: str = "session.log", **header: Any) -> Path:
        lines = [json.dumps(HEADER | header)]
        lines += [record if isinstance(record, str) else json.dumps(record) for record in records]
        path = tmp_path / name
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
        return path

    return write


@pytest.fixture
def pixel() -> dict[str, Any]:
    """An inline picture of two pixels: (10, 20, 30) and (40, 50, 60)."""
    return {"base64": PIXEL}


@pytest.fixture
def survey(tmp_path: Path) -> Path:
    """A survey of five pictures of unequal brightness and two covered ones."""
    rng = np.random.default_rng(2)
    path = tmp_path / "survey.log"
    with SessionWriter(path, SessionInfo("place", display_units="in"), "survey") as writer:
        for t, high in enumerate((20, 24)):
            writer.image(t, rng.integers(0, high, (12, 16, 3), dtype=np.uint8), covered=True)
        for k in range(5):
            picture = rng.integers(20 * k, 100 + 30 * k, (12, 16, 3), dtype=np.uint8)
            writer.image(2 + k, picture, pose=[0.5 * k, 1.0, 0.1 * k])
    return path


@pytest.fixture(scope="session")
def run_library(_small_session: Path) -> Library:
    return build_library(_small_session.with_name("survey.log"), ["color", "edges"])


def manifest_for(session: Path, library: Library, folder: Path, toml: str) -> RunManifest:
    survey = session.parent / "survey.log"
    channels = ("color", "edges")
    return RunManifest(
        label="blended",
        seed=5,
        start=None,
        channels=channels,
        origin_m=tuple(library.origin.tolist()),
        name="kleine Fahrt",
        display_units="m",
        pictures=14,
        has_truth=True,
        keep_going=False,
        session=source_of(session, folder),
        library=source_of(survey, folder),
        library_content=library_hash(library, channels),
        configuration_sha256=sha256(toml.encode()).hexdigest(),
        versions=versions_now(),
        radii=radii_of(library),
    )


@pytest.fixture
def save_run(small_session: Path, run_library: Library, tmp_path: Path) -> Save:
    """Play the small session with some settings and save it; give the folder and what was saved."""

    def saved(times: int = 1, close: str | None = "complete", **settings: Any) -> tuple[Path, Played]:
        chosen = {"particles": 50, "sensor.weights": {"color": 1.0, "edges": 1.0}} | settings
        configuration = configure([Layer("test", chosen)])
        log, folder, toml = open_session(small_session), tmp_path / "run", to_toml(configuration)
        localizer = build_localizer(run_library, log, configuration.parameters, seed=5)
        played = numbered(list(run(localizer, log, None)) * times)
        writer = RunWriter(
            folder,
            manifest_for(small_session, run_library, folder, toml),
            toml,
            run_library.arena,
            force=True,
        )
        for moment, record in played:
            writer.add(moment, record)
        if close is not None:
            writer.close(close)
        return folder, played

    return saved


def opened(folder: Path) -> SavedRun:
    (saved,) = open_runs(folder)
    return saved


def edit(file: Path, **changes: Any) -> None:
    """Change values of a JSON file."""
    file.write_text(json.dumps(json.loads(file.read_text()) | changes))


def numbered(played: Played) -> Played:
    """Count steps and seconds on, so that one short drive serves as a long one."""
    frames = [
        replace(moment.frame, step=step, time_s=2.0 * step) for step, (moment, _) in enumerate(played, 1)
    ]
    pairs = zip(played, frames, strict=True)
    return [(replace(m, frame=f), replace(r, frame=f)) for (m, r), f in pairs]
