"""Small logs and pictures, made on the spot."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from maurice_loaders.session_writer import SessionWriter
from maurice_mcl.session import SessionInfo
from maurice_mcl.typing import U8

HEADER = {"format": "maurice-session-log", "version": 1, "kind": "session", "name": "test"}
PIXEL = "iVBORw0KGgoAAAANSUhEUgAAAAIAAAABCAIAAAB7QOjdAAAADUlEQVQIHWPkEpEDAgAB2gCYpjaFTAAAAABJRU5ErkJggg=="
WriteLog = Callable[..., Path]


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


@pytest.fixture(autouse=True)
def _own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MAURICE_CACHE", str(tmp_path / "cache"))
