from __future__ import annotations

import importlib.util
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest
import rerun as rr


def _load(name: str) -> ModuleType:
    """Load a helper beside the tests: with --import-mode=importlib they cannot import it themselves."""
    spec = importlib.util.spec_from_file_location(name, Path(__file__).with_name(f"{name}.py"))
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


_load("viz_fakes")
_load("viz_recordings")


@pytest.fixture(autouse=True)
def strict_rerun() -> Iterator[None]:
    """Wrong data is an error, not a warning."""
    rr.set_strict_mode(True)
    yield
    rr.set_strict_mode(False)
