"""Precision over recall, and recall over how many references are looked at, of a drive in a library."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from maurice_datasets.trials.recognition import ChannelRecall, PlaceRecognition

from .calibration import dress, expect_matplotlib, save

RANKS = 25  # references along the axis
OTHERS = "#B8BEC8"  # of channels that are not in use


def draw_retrieval(found: PlaceRecognition, name: str, file: Path, *, force: bool) -> None:
    """Draw both figures beside each other. InputError where matplotlib is missing, and for another ending."""
    expect_matplotlib(file)
    from matplotlib.figure import Figure

    drawing = Figure(figsize=(11.0, 4.8), layout="constrained")
    left, right = drawing.subplots(1, 2)
    dress(left, f"Pictures of {name}: precision over recall", "recall", "precision")
    dress(right, "A right reference among the first", "references", "share of the pictures")
    places = np.arange(1, RANKS + 1)
    for number, way in enumerate(found.ways):
        looks = _look(way, number)
        recall, precision = way.ranking.curve()
        left.plot(recall, precision, **looks)
        right.plot(places, [way.ranking.among(place).mean() for place in places.tolist()], **looks)
    for axes in (left, right):
        axes.set_ylim(0, 1.02)
    left.set_xlim(0, 1.02)
    right.legend(loc="lower right", fontsize=9)
    save(drawing, file, force=force)


def _look(way: ChannelRecall, number: int) -> dict[str, object]:
    label = f"{way.name}: area {way.area.value:.2f}"
    if not way.is_used:
        return {"label": label, "color": OTHERS, "linewidth": 1.0}
    return {"label": label, "color": f"C{number}", "linewidth": 2.8 if number == 0 else 1.6}
