"""Entities of explanations, and the names and colors of their columns."""

from __future__ import annotations

from maurice_mcl.analysis.explanation import ASKED, ESTIMATE, TRUTH, WINNER, Explained, StepExplanation

from .. import style as look
from ..entities import RunPaths
from ..style import RANK, RGB

COLORS: dict[str, RGB] = {TRUTH: look.TRUTH, ESTIMATE: look.ESTIMATE, WINNER: RANK, ASKED: (86, 180, 233)}
NAMES = {TRUTH: "truth's", ESTIMATE: "estimate's", WINNER: "winner", ASKED: "asked for"}
OUTSIDE = "outside free space"
NOT_KNOWN = "truth not known here"
KINDS = ("sample", "reference", "cost")  # of bars

Column = tuple[str, Explained | None]  # which reference; None: the truth is not known at this update


def columns_of(has_truth: bool) -> tuple[str, ...]:
    """Return the references that have a column."""
    return (TRUTH, ESTIMATE, WINNER) if has_truth else (ESTIMATE, WINNER)


def columns(step: StepExplanation, has_truth: bool) -> list[Column]:
    """Return the content of each column; always the same number of columns."""
    return [(who, step.of(who)) for who in columns_of(has_truth)]


def card_path(paths: RunPaths, who: str) -> str:
    """Return the entity of a column's pictures: one EncodedImage."""
    return paths.at("explain", "card", who)


def chart_path(paths: RunPaths, kind: str) -> str:
    """Return the entity of bars: `kind` is one of KINDS, "tints" or "feet"."""
    return paths.at("explain", "chart", kind)


def table_path(paths: RunPaths) -> str:
    """Return the entity of the table: one TextDocument."""
    return paths.at("explain", "table")


def marks_path(paths: RunPaths) -> str:
    """Return the entity of the references on the map: one Arrows2D, an arrow per column."""
    return paths.at("explain", "marks")
