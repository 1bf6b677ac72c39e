"""Monte Carlo localization against a library of reference pictures.

Five names run a filter, `make_localizer`, `run`, `score`, `PRESETS` and `InputError`; the others are the
values that go in (`Library`, `Session`, `Frame`, `Moment`) and come out (`Belief`, `FilterState`,
`StepRecord`, `RunScore`). `tiny_library` and `tiny_session` are made in memory, for examples.

The chapters, from the ground up:

- vocabulary: `arrays`, `errors`, `setting_rules`, `randomness`, `geometry`, `map`, `session`, `pose_sensor`,
  `library`, `radii`, `records`; `examples`: a tiny library and session
- `sensor`: what is measured in a picture, and how likely it makes every place
- `filter`: propose, measure, weight, estimate, resample, recover
- `config`: parameters, their checks, presets, and a filter built from them
- `analysis`: scores, events, modes, explanations, comparison of runs
- `calibration`: motion constants, the camera's noise floor, and weights of channels, fitted to drives
- `library_quality`: what a library covers, and how well it distinguishes its own places
- `diagnosis`: what is wrong with a recording, as codes and numbers

This package knows numpy, OpenCV and scipy, never a viewer; it never prints.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .analysis.metrics import RunScore as RunScore
    from .analysis.metrics import score as score
    from .config.build import make_localizer as make_localizer
    from .config.parameters import PRESETS as PRESETS
    from .errors import InputError as InputError
    from .examples import tiny_library as tiny_library
    from .examples import tiny_session as tiny_session
    from .filter.localizer import Localizer as Localizer
    from .filter.localizer import run as run
    from .library import Library as Library
    from .pose_sensor import PoseProposal as PoseProposal
    from .pose_sensor import PoseSensor as PoseSensor
    from .pose_sensor import PoseSpread as PoseSpread
    from .pose_sensor import Shown as Shown
    from .pose_sensor import ShownMarks as ShownMarks
    from .records import Belief as Belief
    from .records import FilterState as FilterState
    from .records import StepRecord as StepRecord
    from .session import Frame as Frame
    from .session import Moment as Moment
    from .session import Session as Session

# Looked up when first used, so that a command which needs one chapter does not load them all.
_HOME = {
    "Belief": "records",
    "FilterState": "records",
    "Frame": "session",
    "InputError": "errors",
    "Library": "library",
    "Localizer": "filter.localizer",
    "Moment": "session",
    "PRESETS": "config.parameters",
    "PoseProposal": "pose_sensor",
    "PoseSensor": "pose_sensor",
    "PoseSpread": "pose_sensor",
    "RunScore": "analysis.metrics",
    "Session": "session",
    "Shown": "pose_sensor",
    "ShownMarks": "pose_sensor",
    "StepRecord": "records",
    "make_localizer": "config.build",
    "run": "filter.localizer",
    "score": "analysis.metrics",
    "tiny_library": "examples",
    "tiny_session": "examples",
}
__all__ = list(_HOME)


def __getattr__(name: str) -> object:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from .errors import public

    return public(getattr(import_module(f".{_HOME[name]}", __name__), name))


def __dir__() -> list[str]:
    return list(_HOME)
