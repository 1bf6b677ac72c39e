"""What can be tried on a run that is lost: every remedy that is a setting of the filter."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

from maurice_mcl.config.parameters import PRECISE, PRESETS, FilterParameters
from maurice_mcl.map import MOVABLE
from maurice_mcl.sensor.descriptors.registry import FEATURES

from .branch import BranchChange, BranchPoint

STRATEGIES = ("none", "always", "threshold", "sensor", "augmented", "expansion", "mixture")
FOUR = 4
MANY_TIMES = (16, 64)  # the particles, where that is
MOST_PARTICLES = 32_000  # at most
OUTLIER_COST: float = PRECISE["sensor.outlier_cost"]
ROBUST = "robust"  # the preset that is also tried with more particles


@dataclass(frozen=True, slots=True)
class Remedy:
    """One thing to try from the branch on."""

    name: str
    change: BranchChange


def candidates(point: BranchPoint) -> tuple[list[Remedy], list[str]]:
    """Return what can be tried on a run, and what cannot, with the reason."""
    own = point.run.configuration.parameters
    found = [Remedy(name, BranchChange(settings=values)) for name, values in _settings(own)]
    found += [Remedy(name, change) for name, change in _clouds(own.particles)]
    sensors = {f"feature {name}": (BranchChange(feature=name), weights) for name, weights in FEATURES.items()}
    for name, values in PRESETS.items():
        sensors[f"preset {name}"] = BranchChange(preset=name), values["sensor.weights"]
    more = BranchChange(preset=ROBUST, particles=FOUR * own.particles)
    sensors[f"preset {ROBUST}, particles x{FOUR}"] = more, PRESETS[ROBUST]["sensor.weights"]
    left_out = []
    for name, (change, weights) in sensors.items():
        missing = [channel for channel in weights if channel not in point.library.index]
        if missing:
            left_out.append(f"{name}: the library has no channel {missing[0]}")
        elif change.configuration(point.run.configuration).parameters != own:
            found.append(Remedy(name, change))
    return found, left_out


def _clouds(particles: int) -> Iterator[tuple[str, BranchChange]]:
    """Yield other clouds to go on with, by name."""
    four = BranchChange(particles=FOUR * particles)
    yield f"particles x{FOUR}", four
    for times in MANY_TIMES:
        if times * particles <= MOST_PARTICLES:
            yield f"particles x{times}", BranchChange(particles=times * particles)
    yield "anywhere", BranchChange(anywhere=True)
    yield f"anywhere, particles x{FOUR}", replace(four, anywhere=True)


def _settings(own: FilterParameters) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Yield what can be set, by name, without what the run has already."""
    for name in STRATEGIES:
        if name != own.recovery.strategy:
            yield f"recovery {name}", {"recovery.strategy": name}
    if own.resampling.roughening <= 0:
        yield "roughening 0.2", {"resampling.roughening": 0.2}
    if own.resampling.when == "always":
        yield "resampling when needed", {"resampling.when": "effective"}
    if own.resampling.scheme != "systematic":
        yield "resampling systematic", {"resampling.scheme": "systematic"}
    yield "motion noise x2", {"motion_outliers.share": 1.0, "motion_outliers.widen": 2.0}
    moved = {"map.obstacles": MOVABLE, "sensor.outlier_cost": OUTLIER_COST}
    if own.map.obstacles != MOVABLE:
        yield "obstacles movable", {"map.obstacles": MOVABLE}
    if own.sensor.outlier_cost <= 0:
        yield f"obstacles movable, outlier cost {OUTLIER_COST:g}", moved
    if own.motion_outliers.share < 0.1:
        yield "motion outliers 10 %", {"motion_outliers.share": 0.1, "motion_outliers.widen": 4.0}
    weights = own.sensor.weights
    for name in weights:
        others = {other: weight for other, weight in weights.items() if other != name}
        if any(others.values()):
            yield f"without {name}", {"sensor.weights": others}
    if own.sensor.sharpness > 0:
        yield "sharpness x0.5", {"sensor.sharpness": own.sensor.sharpness / 2}
