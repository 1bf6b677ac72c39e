"""From parameters to a localizer: every name is looked up here and nowhere else."""

from __future__ import annotations

import numpy as np

from ..filter.localizer import Localizer
from ..filter.motion import motion_model
from ..filter.proposal import regions
from ..filter.recovery import RecoveryStrategy, none
from ..filter.recovery import always as always_some
from ..filter.resampling import RESAMPLERS, ResamplePolicy, always, below_effective, every
from ..filter.resampling_step import ResamplingStep
from ..library import Library
from ..sensor.model import SensorModel
from ..sensor.references import (
    NearestReference,
    interpolated_reference,
    nearest_reference,
    virtual_references,
)
from ..session import Session
from .parameters import FilterParameters, RecoveryParameters, ResamplingParameters


def make_localizer(
    library: Library,
    session: Session,
    parameters: FilterParameters | None = None,
    *,
    reference: NearestReference | None = None,
    seed: int = 0,
) -> Localizer:
    """Put together the localizer for a session; the robot's own motion model is used unless one is given.

    `reference`, the library's tables, can be shared among localizers: they take a while to build.

    Raises KeyError for an unknown name, ValueError for bad motion parameters.
    """
    p = parameters or FilterParameters()
    nearest = reference or nearest_reference(library.poses, library.arena)
    return Localizer(
        library=library,
        reference=nearest,
        motion=motion_model(session.info.motion if p.motion is None else p.motion, nearest.grid),
        sensor=_sensor(library, nearest, p),
        resampling=_resampling_step(library, nearest, p),
        outliers=p.motion_outliers,
        particles=p.particles,
        seed=seed,
    )


def _sensor(library: Library, nearest: NearestReference, p: FilterParameters) -> SensorModel:
    p.sensor.check_names()
    sensors = {"nearest": _by_nearest, "interpolated": _by_interpolation}
    return sensors[p.references.method](library, nearest, p)


def _by_nearest(library: Library, nearest: NearestReference, p: FilterParameters) -> SensorModel:
    return SensorModel(library, nearest, p.sensor)


def _by_interpolation(library: Library, nearest: NearestReference, p: FilterParameters) -> SensorModel:
    how = p.references.interpolation
    if not how.virtual:
        return SensorModel(
            library, interpolated_reference(nearest, library.poses, library.arena, how), p.sensor
        )
    more = virtual_references(library.poses, library.arena)
    references = np.concatenate([library.poses, more.poses])
    index = more.extend({name: library.index[name] for name in p.sensor.weights})
    return SensorModel(
        library, interpolated_reference(nearest, references, library.arena, how), p.sensor, index
    )


def _resampling_step(library: Library, nearest: NearestReference, p: FilterParameters) -> ResamplingStep:
    return ResamplingStep(
        nearest=nearest,
        where=regions(nearest, library.size),
        resampler=RESAMPLERS[p.resampling.scheme],
        when=_when(p.resampling),
        strategy=_strategy(p.recovery),
        draw_evenly={"evenly": True, "likelihood": False}[p.recovery.draw],
        roughening=p.resampling.roughening,
        kld=p.resampling.kld if p.resampling.adaptive else None,
        mixture=p.recovery.mixture if p.recovery.strategy == "mixture" else None,
    )


def _when(p: ResamplingParameters) -> ResamplePolicy:
    return {"always": always, "effective": below_effective(p.below), "every": every(p.every)}[p.when]


def _strategy(p: RecoveryParameters) -> RecoveryStrategy:
    strategies: dict[str, RecoveryStrategy] = {
        "none": none,
        "mixture": none,
        "always": always_some(p.share),
        "threshold": p.threshold,
        "sensor": p.sensor,
        "augmented": p.augmented,
        "expansion": p.expansion,
    }
    return strategies[p.strategy]
