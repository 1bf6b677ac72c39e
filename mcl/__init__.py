"""Monte Carlo localization against a library of reference pictures.

Five names run a filter, `make_localizer`, `run`, `score`, `PRESETS` and `InputError`; the others are the
values that go in (`Library`, `Session`, `Frame`, `Moment`) and come out (`Belief`, `FilterState`,
`StepRecord`, `RunScore`). `tiny_library` and `tiny_session` are made in memory, for examples.

The chapters, from the ground up:

- `values`: the vocabulary; `errors`: bad input; `examples`: a tiny library and session
- `sensor`: what is measured in a picture, and how likely it makes every place
- `library`: what a library covers, and how well it distinguishes its own places
- `filter`: propose, measure, weight, estimate, resample, recover
- `config`: parameters, their checks, presets, and a filter built from them
- `scoring`: how good a run is; `reasons`: why it was so
- `fitting`: motion constants, the camera's noise floor, and weights of channels, fitted to drives

This package knows numpy, OpenCV, scipy and, for tables, polars, never a viewer; it never prints.
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from .errors import front_page

if TYPE_CHECKING:
    from .config.build import make_localizer as make_localizer
    from .config.parameters import PRESETS as PRESETS
    from .errors import InputError as InputError
    from .examples import tiny_library as tiny_library
    from .examples import tiny_session as tiny_session
    from .filter.localizer import Localizer as Localizer
    from .filter.localizer import run as run
    from .filter.motion import RobotMotion as RobotMotion
    from .filter.recovery import Recovery as Recovery
    from .scoring.demands import Demands as Demands
    from .scoring.episodes import table as table
    from .scoring.metrics import RunScore as RunScore
    from .scoring.metrics import score as score
    from .scoring.table import RunTable as RunTable
    from .values.library import Library as Library
    from .values.pose_sensor import PoseProposal as PoseProposal
    from .values.pose_sensor import PoseSensor as PoseSensor
    from .values.pose_sensor import PoseSpread as PoseSpread
    from .values.pose_sensor import Shown as Shown
    from .values.pose_sensor import ShownMarks as ShownMarks
    from .values.records import Belief as Belief
    from .values.records import FilterState as FilterState
    from .values.records import RecoveryState as RecoveryState
    from .values.records import StepRecord as StepRecord
    from .values.session import Frame as Frame
    from .values.session import Moment as Moment
    from .values.session import Session as Session

THREADS = (
    "OPENBLAS_NUM_THREADS",
    "OMP_NUM_THREADS",
    "MKL_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
    "OPENCV_FOR_THREADS_NUM",
)


def bound_threads() -> None:
    """Let an operation of numpy and OpenCV use one thread, where the user does not say otherwise.

    Reading, comparing, filtering and drawing already run side by side, and their operations are small: on two
    cores a second thread of the libraries made them slower. Results do not depend on it.
    """
    for name in THREADS:
        os.environ.setdefault(name, "1")


bound_threads()  # before the first import of numpy and OpenCV, which read these
__all__, __getattr__, __dir__ = front_page(__name__)
