"""What makes commands start sooner."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from types import ModuleType


class _NoPandas:
    """A finder by which nothing is called pandas."""

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> None:
        """Raise for pandas; leave the rest to others."""
        if name == "pandas":
            raise ModuleNotFoundError("pandas is not needed here", name=name)


def skip_pandas() -> None:
    """Keep pyarrow from importing pandas, which takes a third of a second and which no command uses.

    It does so with the first array that it makes, where pandas is installed, and remembers what it found.
    Who asks it for a table of pandas still gets one.
    """
    if "pandas" in sys.modules:
        return
    import pyarrow as pa  # type: ignore[import-untyped]  # has no types

    finder = _NoPandas()
    sys.meta_path.insert(0, finder)
    try:
        pa.array([0.0])
    finally:
        sys.meta_path.remove(finder)
