"""Presets: whole filters by name, as layers of configuration."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..sensor.features import FEATURES

PRESETS: Mapping[str, Mapping[str, Any]] = {
    # the thesis's first filter (its section 3), faithful to the letter where we hold the letter
    "thesis": {
        "particles": 2000,
        "sensor.weights": {"color": 1.0},
        "sensor.distances": {"color": "thesis", "edges": "thesis", "smoothed": "thesis"},
        "sensor.blend": "sum",
        "sensor.likelihood": "power",
        "sensor.sharpness": 1.0,
        "references.method": "nearest",
        "resampling.scheme": "multinomial",
        "resampling.when": "always",
        "recovery.strategy": "none",
    },
    # with the refinements of its section 4: smoothed color and edges blended, recovery under a threshold
    "refined": {
        "sensor.weights": {"smoothed": 0.5, "edges": 0.5},
        "sensor.distances": {"smoothed": "thesis", "edges": "thesis"},
        "sensor.blend": "sum",
        "sensor.likelihood": "power",
        "sensor.sharpness": 8.0,
        "references.method": "nearest",
        "resampling.scheme": "systematic",
        "recovery.strategy": "threshold",
        "recovery.draw": "evenly",
    },
    # what we would put on a robot
    "robust": {
        "sensor.weights": dict(FEATURES["best"]),
        "sensor.blend": "calibrated",
        "sensor.likelihood": "exponential",
        "references.method": "interpolated",
        "recovery.strategy": "threshold",
        "motion_outliers.share": 0.02,
    },
}
