"""The simulated Maurice: worlds, a robot that drives through them, what its camera sees.

The front page is three functions of the simulator and five of trials; the chapters are

* `sessions`, `surveys`: sessions and surveys as files; `live`: a robot that speaks over a socket
* `teleoperation`: a robot that a person drives
* `simulation`, `tasks`: what a session is made from, and which seeds may be tested on
* `worlds`: plans, furniture, surfaces; `render`: light, camera, people; `robot`: motion, behaviors, drives
* `folders`, `demos`: complete folders and their cache; the demo's drives
* `trials`: plans of many runs, the engine that makes them, rows, statistics

Axes in docstrings, besides those of `maurice_mcl.values.arrays`: K points or poses, F faces, S sources of
light, P points of a source or corners of an outline.

The folder is called `datasets` and installs as `maurice_datasets`: `datasets` is another project's package.
Python finds this folder under that name only from the repository's root, and then it steps aside.
"""

from __future__ import annotations

import importlib.machinery
import importlib.util
import sys
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .sessions import simulate as simulate
    from .sessions import simulation_plan as simulation_plan
    from .surveys import survey as survey
    from .trials.engine import run_plan as run_plan
    from .trials.plan import read_plan as read_plan
    from .trials.table import TrialsResult as TrialsResult
    from .trials.table import grouped as grouped
    from .trials.table import load_trials as load_trials
    from .trials.table import paired as paired
    from .worlds.build import load_world as load_world


def _step_aside() -> None:
    """Put the installed package `datasets` in this folder's place; ModuleNotFoundError if there is none."""
    here = Path(__file__).parents[1]
    elsewhere = [entry for entry in sys.path if Path(entry or ".").resolve() != here]
    spec = importlib.machinery.PathFinder.find_spec("datasets", elsewhere)
    if spec is None or spec.loader is None:
        raise ModuleNotFoundError("No module named 'datasets' (this folder installs as maurice_datasets)")
    theirs = importlib.util.module_from_spec(spec)
    sys.modules["datasets"] = theirs
    spec.loader.exec_module(theirs)


if __name__ == "datasets":
    _step_aside()
else:
    from maurice_mcl.errors import front_page

    __all__, __getattr__, __dir__ = front_page(__name__)
