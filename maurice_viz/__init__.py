"""Looking: the command line, the Rerun drawings, and for notebooks `show`, `results` and `traces`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .app.notebook import results, show, traces

__all__ = ["results", "show", "traces"]


def __getattr__(name: str) -> Any:
    """Import what notebooks use when it is asked for: the command line starts quicker without it."""
    if name in __all__:
        from .app import notebook

        return getattr(notebook, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
