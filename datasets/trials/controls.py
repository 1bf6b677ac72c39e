"""Controls: filters that are deliberately given something wrong, to show what a result depends on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from maurice_mcl.filter.localizer import Localizer
from maurice_mcl.filter.motion import motion_model

from .drives import Bench, Drive
from .plan import MISJUDGED, SHUFFLED

MORE = 1.3


def filter_for(drive: Drive, settings: Mapping[str, Any], seed: int) -> Localizer:
    """Return the filter of a variant for one run of a drive, with its control where it names one."""
    control = settings.get("control")
    plain = {key: value for key, value in settings.items() if key != "control"}
    bench = drive.bench if control != SHUFFLED else shuffled(drive.bench, seed)
    localizer = replace(bench.localizer(plain), seed=seed)
    if control == MISJUDGED:
        motion = misjudged(drive.session.info.motion or {})
        localizer = replace(localizer, motion=motion_model(motion, localizer.reference.grid))
    return localizer.of_session(drive.session)


def shuffled(bench: Bench, seed: int) -> Bench:
    """Return a library whose pictures belong to other poses: nothing but chance can localize with it."""
    library = bench.library
    order = np.random.default_rng(seed).permutation(library.size)
    return Bench.of(replace(library, poses=library.poses[order]))


def misjudged(motion: Mapping[str, Any]) -> dict[str, Any]:
    """Return motion constants that are all 30 percent too large, as of a robot that was badly calibrated."""
    return {
        key: misjudged(value) if isinstance(value, Mapping) else value * MORE if key != "model" else value
        for key, value in motion.items()
    }
