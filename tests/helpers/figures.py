"""Whether what a figure shows can be told apart: by shape, or in gray, also by the color-blind."""

from __future__ import annotations

from itertools import combinations
from typing import Any

import numpy as np
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

APART = 12.0  # of 100, in lightness L*: gray prints and color-blind eyes tell less, not surely
# Linear RGB to an eye without its medium or its long cones (Machado, Oliveira, Fernandes 2009).
DEUTERANOPIA = np.array(
    [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.01182, 0.04294, 0.968881]]
)
PROTANOPIA = np.array(
    [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]
)
EYES = (np.eye(3), DEUTERANOPIA, PROTANOPIA)


def lightness(color: Any) -> np.ndarray:
    """L* (3,) of a color, to each kind of eye."""
    values = np.array(to_rgb(color))
    linear = np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)
    y = np.clip([np.array([0.2126, 0.7152, 0.0722]) @ (eye @ linear) for eye in EYES], 0, 1)
    return np.asarray(np.where(y > 0.008856, 116 * np.cbrt(y) - 16, 903.3 * y))


def look_of(handle: Any) -> tuple[tuple[object, ...], Any]:
    """The shape of what a legend shows, and its color."""
    if isinstance(handle, tuple) and len(handle):  # error bars, bars
        handle = handle[0]
    if hasattr(handle, "get_marker"):
        size = round(np.log2(handle.get_markersize()))
        hollow = handle.get_markerfacecolor() in ("none", "white")
        return ("line", handle.get_marker(), handle.get_linestyle(), size, hollow), handle.get_color()
    if hasattr(handle, "get_hatch") and hasattr(handle, "get_facecolor"):
        faces = np.atleast_2d(handle.get_facecolor())
        paths = handle.get_paths() if hasattr(handle, "get_paths") else []
        shape = len(paths[0].vertices) if paths else 0
        edge = handle.get_edgecolor() if not len(faces) else faces
        return (type(handle).__name__, handle.get_hatch(), shape, bool(len(faces))), np.atleast_2d(edge)[0][
            :3
        ]
    return (type(handle).__name__,), np.atleast_2d(handle.get_color())[0][:3]


def alike(drawing: Figure) -> list[tuple[str, str]]:
    """Pairs of labels of the same axes that neither shape nor lightness tells apart."""
    pairs = []
    for axes in drawing.axes:
        named = [
            (label, *look_of(handle)) for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
        ]
        for (first, shape, color), (other, its_shape, its_color) in combinations(named, 2):
            apart = np.abs(lightness(color) - lightness(its_color)).min()
            if shape == its_shape and apart < APART:
                pairs.append((first, other))
    return pairs
