from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
import rerun as rr


@pytest.fixture(autouse=True)
def _own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let every test stand in a folder of its own, as a person does who types a command."""
    monkeypatch.chdir(tmp_path)


@pytest.fixture(autouse=True)
def strict_rerun() -> Iterator[None]:
    """Wrong data is an error, not a warning."""
    rr.set_strict_mode(True)
    yield
    rr.set_strict_mode(False)
