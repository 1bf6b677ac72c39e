"""What tuning found: a table for people, JSON for programs, TOML for --config."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from rich.table import Table

from maurice_loaders.io.toml import toml_value
from maurice_mcl.calibration.tuning import Scores, Tuned

DIGITS = 4  # of scales and weights; more would be noise


@dataclass(frozen=True, slots=True)
class Report:
    """What was fitted, on what, and what it is worth."""

    tuned: Tuned
    distances: Mapping[str, str]
    library: str
    fitted_on: tuple[str, ...]  # sessions; none: the library, one reference left out at a time
    fitted: Scores
    scored_on: tuple[str, ...]
    scored: Scores | None

    @property
    def scales(self) -> dict[str, float]:
        """The distance of one nat, for every channel that was tuned."""
        return {name: _rounded(v) for name, v in zip(self.tuned.channels, self.tuned.scales, strict=True)}

    @property
    def weights(self) -> dict[str, float]:
        """Weights of the channels that add something."""
        pairs = zip(self.tuned.channels, self.tuned.weights, strict=True)
        return {name: _rounded(weight) for name, weight in pairs if weight > 0}


def tuned_toml(report: Report) -> str:
    """Give what was fitted as a configuration file."""
    source = ", ".join(report.fitted_on) or "its own references, each left out in turn"
    comment = f"library {report.library}, fitted on {source}: {_gain(report)}"
    used = report.weights
    values: dict[str, Any] = {
        "weights": used,
        "distances": {name: report.distances[name] for name in used},
        "scales": {name: report.scales[name] for name in used},
        "blend": "calibrated",
        "likelihood": "exponential",
        "sharpness": 1.0,
    }
    lines = [f"{key} = {toml_value(value)}" for key, value in values.items()]
    return "\n".join([f"# {' '.join(comment.split())}", "[sensor]", *lines]) + "\n"


def tuned_table(report: Report) -> Table:
    """Give a row for each channel, then the blends."""
    table = Table(title=f"library {report.library}", title_justify="left", caption=_gain(report))
    for name in ("", "distance", "scale", "weight", "log score, fitted"):
        table.add_column(name, justify="left" if name in ("", "distance") else "right")
    sets = [report.fitted]
    if report.scored is not None:
        table.add_column("log score, scored", justify="right")
        sets.append(report.scored)
    for k, name in enumerate(report.tuned.channels):
        weight = report.weights.get(name)
        shown = "-" if weight is None else f"{weight:g}"
        cells = [name, report.distances[name], f"{report.scales[name]:g}", shown]
        table.add_row(*cells, *(f"{s.alone[k]:.3f}" for s in sets))
    table.add_section()
    table.add_row("tuned blend", "", "", "", *(f"{s.together:.3f}" for s in sets))
    table.add_row("default blend", "", "", "", *(f"{s.before:.3f}" for s in sets))
    table.add_row("knowing nothing", "", "", "", *(f"{s.blind:.3f}" for s in sets))
    table.add_row("pictures", "", "", "", *(str(s.pictures) for s in sets))
    return table


def tuned_json(report: Report) -> dict[str, Any]:
    """Give everything in the table; log scores in nats a picture."""
    return {
        "library": report.library,
        "fitted_on": list(report.fitted_on),
        "scored_on": list(report.scored_on),
        "distances": {name: report.distances[name] for name in report.tuned.channels},
        "scales": report.scales,
        "weights": report.weights,
        "fitted": _scores_json(report, report.fitted),
        "scored": None if report.scored is None else _scores_json(report, report.scored),
    }


def _scores_json(report: Report, scores: Scores) -> dict[str, Any]:
    return {
        "pictures": scores.pictures,
        "alone": dict(zip(report.tuned.channels, scores.alone, strict=True)),
        "tuned": scores.together,
        "default": scores.before,
        "blind": scores.blind,
        "gained": scores.gained,
    }


def _gain(report: Report) -> str:
    scores = report.scored or report.fitted
    held_out = "that were not fitted on" if report.scored else "fitted on"
    gained = f"gained over the default {scores.gained:+.3f} nats a picture"
    return f"{gained}, on {scores.pictures} pictures {held_out}"


def _rounded(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")
