"""Monte Carlo localization against a library of reference pictures.

Five names run a filter, `make_localizer`, `run`, `score`, `PRESETS` and `InputError`; the others are the
values that go in (`Library`, `Session`, `Frame`, `Moment`) and come out (`Belief`, `FilterState`,
`StepRecord`, `RunScore`). `tiny_library` and `tiny_session` are made in memory, for examples.

The chapters, from the ground up:

- `values`: the vocabulary; `errors`: bad input; `examples`: a tiny library and session
- `threads`: one an operation, also of numpy and OpenCV, unless a variable of theirs is set
- `sensor`: what is measured in a picture, and how likely it makes every place
- `library`: what a library covers, and how well it distinguishes its own places
- `filter`: propose, measure, weight, estimate, resample, recover
- `config`: parameters, their checks, presets, and a filter built from them
- `scoring`: how good a run is; `reasons`: why it was so
- `fitting`: motion constants, the camera's noise floor, and weights of channels, fitted to drives

This package knows numpy, OpenCV and scipy, never a viewer; it never prints.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from .errors import front_page
from .threads import bound_threads

if TYPE_CHECKING:
    from .config.build import make_localizer as make_localizer
    from .config.parameters import PRESETS as PRESETS
    from .errors import InputError as InputError
    from .examples import tiny_library as tiny_library
    from .examples import tiny_session as tiny_session
    from .filter.localizer import Localizer as Localizer
    from .filter.localizer import run as run
    from .scoring.metrics import RunScore as RunScore
    from .scoring.metrics import score as score
    from .values.library import Library as Library
    from .values.pose_sensor import PoseProposal as PoseProposal
    from .values.pose_sensor import PoseSensor as PoseSensor
    from .values.pose_sensor import PoseSpread as PoseSpread
    from .values.pose_sensor import Shown as Shown
    from .values.pose_sensor import ShownMarks as ShownMarks
    from .values.records import Belief as Belief
    from .values.records import FilterState as FilterState
    from .values.records import StepRecord as StepRecord
    from .values.session import Frame as Frame
    from .values.session import Moment as Moment
    from .values.session import Session as Session

bound_threads()  # before the first import of numpy

# Looked up when first used, so that a command which needs one chapter does not load them all.
_HOME = {
    "Belief": ".values.records",
    "FilterState": ".values.records",
    "Frame": ".values.session",
    "InputError": ".errors",
    "Library": ".values.library",
    "Localizer": ".filter.localizer",
    "Moment": ".values.session",
    "PRESETS": ".config.parameters",
    "PoseProposal": ".values.pose_sensor",
    "PoseSensor": ".values.pose_sensor",
    "PoseSpread": ".values.pose_sensor",
    "RunScore": ".scoring.metrics",
    "Session": ".values.session",
    "Shown": ".values.pose_sensor",
    "ShownMarks": ".values.pose_sensor",
    "StepRecord": ".values.records",
    "make_localizer": ".config.build",
    "run": ".filter.localizer",
    "score": ".scoring.metrics",
    "tiny_library": ".examples",
    "tiny_session": ".examples",
}
__all__ = list(_HOME)
__getattr__, __dir__ = front_page(__name__, _HOME)
