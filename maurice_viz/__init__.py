"""Replaying, comparing, explaining and drawing runs of a localizer, from Python as from the command line.

| function | what it does |
|---|---|
| `replay` | replays a session once: scores, and where asked a Rerun recording and a saved run |
| `compare` | replays two to four runs side by side and compares their scores |
| `show` | shows a run, a recording or a session in a notebook's widget |
| `results`, `traces` | a saved run's scores and its numbers step by step, as polars frames |
| `explain` | explains one update of a saved run |
| `snapshot`, `movie` | a picture or a movie of what the viewer shows |
| `report` | one self-contained page about a saved run |
| `figures` | the figures of a calibration, for a paper |

Each takes plain arguments, returns values and raises `maurice_loaders.InputError` for bad input. None prints
or exits; remarks, warnings and progress go to the `Listener` that the caller may pass. Each is imported when
it is first used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .app.compare import compare as compare
    from .app.explain import explain as explain
    from .app.listener import Listener as Listener
    from .app.notebook import results as results
    from .app.notebook import show as show
    from .app.notebook import traces as traces
    from .app.replay import replay as replay
    from .app.run import RunScores as RunScores
    from .app.snapshot import movie as movie
    from .app.snapshot import snapshot as snapshot
    from .reports.make import report as report

_WHERE = {
    "Listener": ".app.listener",
    "RunScores": ".app.run",
    "compare": ".app.compare",
    "explain": ".app.explain",
    "movie": ".app.snapshot",
    "replay": ".app.replay",
    "report": ".reports.make",
    "results": ".app.notebook",
    "show": ".app.notebook",
    "snapshot": ".app.snapshot",
    "traces": ".app.notebook",
}
__all__ = tuple(_WHERE)


def __getattr__(name: str) -> Any:
    """Import a function when it is first used."""
    if name in _WHERE:
        return getattr(import_module(_WHERE[name], __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *_WHERE})
