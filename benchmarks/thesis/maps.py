"""Maps on paper, in inches: walls and things, clouds, true paths and estimates, readable in gray."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from maurice_mcl.values.arrays import F64
from maurice_mcl.values.geometry import INCH_M
from maurice_mcl.values.map import Arena
from maurice_mcl.values.records import Belief, Estimate
from maurice_viz.plots.calibration import BAND, INK

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

CLOUD, ESTIMATE, TRUTH = "#7A828E", "#D55E00", INK
X, Y = "x (in)", "y (in)"
CLOSE_IN = 40.0  # half the side of a close-up


def map_axes(made: Figure, axes: Axes, arena: Arena) -> None:
    """Draw walls and things of a map, to scale."""
    for thing in arena.obstacles:
        axes.fill(*(thing.polygon / INCH_M).T, facecolor=BAND, edgecolor="#AEB4BE", linewidth=0.8, zorder=0)
    for x1, y1, x2, y2 in arena.walls / INCH_M:
        axes.plot([x1, x2], [y1, y2], color=INK, linewidth=1.8, solid_capstyle="round", zorder=1)
    left, bottom, right, top = np.array(arena.bounds) / INCH_M
    edge = 0.01 * (right - left)
    axes.set_xlim(left - edge, right + edge)
    axes.set_ylim(bottom - edge, top + edge)
    axes.set_aspect("equal")
    axes.grid(False)
    axes.set_xlabel(X)
    axes.set_ylabel(Y)


def close_up(axes: Axes, pose: F64) -> None:
    """Show only what is near a pose (3,)."""
    x, y = pose[:2] / INCH_M
    axes.set_xlim(x - CLOSE_IN, x + CLOSE_IN)
    axes.set_ylim(y - CLOSE_IN, y + CLOSE_IN)


def cloud(
    axes: Axes, poses_m: F64, label: str | None, color: str = CLOUD, marker: str = ".", size: float = 2.0
) -> None:
    """Draw particles (N, 2 or 3) in the map's frame."""
    axes.plot(
        *(poses_m[:, :2] / INCH_M).T,
        linestyle="",
        marker=marker,
        markersize=size,
        markeredgewidth=0,
        color=color,
        alpha=0.6,
        zorder=2,
        rasterized=True,
    )
    if label is not None:  # in a legend, large enough to be seen
        axes.plot([], [], linestyle="", marker=marker, markersize=max(size, 6.0), color=color, label=label)


def poses_of(belief: Belief) -> F64:
    """Return the particles (N, 3) of a belief in the map's frame."""
    poses = belief.poses.astype(np.float64)
    poses[:, :2] += belief.origin
    return poses


def path(axes: Axes, poses_m: F64, label: str) -> None:
    """Draw a true path (K, 3) with an arrow where it starts and a dot where it ends."""
    at = poses_m[:, :2] / INCH_M
    axes.plot(*at.T, color=TRUTH, linewidth=1.2, zorder=4, label=label)
    heading = poses_m[0, 2]
    tip = at[0] + 14 * np.array([np.cos(heading), np.sin(heading)])
    arrow = {"arrowstyle": "-|>", "color": ESTIMATE, "linewidth": 2.5, "mutation_scale": 20}
    axes.annotate("", tip, at[0], arrowprops=arrow, zorder=6)


def truth(axes: Axes, pose: F64, label: str | None = "truth") -> None:
    """Draw a true pose (3,), solid, with its heading."""
    _disc(axes, pose, label, TRUTH, TRUTH)


def estimate(axes: Axes, pose: F64, label: str | None = "estimate") -> None:
    """Draw an estimate (3,), hollow, with its heading."""
    _disc(axes, pose, label, "none", ESTIMATE)


def _disc(axes: Axes, pose: F64, label: str | None, face: str, edge: str) -> None:
    x, y = pose[:2] / INCH_M
    tip = np.array([x, y]) + 9 * np.array([np.cos(pose[2]), np.sin(pose[2])])
    axes.plot([x, tip[0]], [y, tip[1]], color=edge, linewidth=1.6, zorder=5)
    axes.plot(
        x,
        y,
        "o",
        markersize=9,
        markerfacecolor=face,
        markeredgecolor=edge,
        markeredgewidth=1.8,
        linestyle="",
        label=label,
        zorder=5,
    )


def estimates(axes: Axes, found: Sequence[Estimate], truths: Sequence[F64], label: str) -> None:
    """Draw estimates, hollow, each tied to the true place by a thin line."""
    at = np.array([pose.pose[:2] for pose in found]) / INCH_M
    true = np.array([pose[:2] for pose in truths]) / INCH_M
    for number in range(len(at)):
        axes.plot(*np.stack([at[number], true[number]]).T, color=ESTIMATE, linewidth=0.6, alpha=0.6, zorder=3)
    axes.plot(
        *at.T, "o", markersize=5, markerfacecolor="none", markeredgecolor=ESTIMATE, label=label, zorder=4
    )


def legend_beside(made: Figure, axes: Axes) -> None:
    """Write the legend right of a map."""
    made.legend(*axes.get_legend_handles_labels(), loc="outside right center", fontsize=8)


def off_in(found: Estimate, true: F64) -> float:
    """Return the distance of an estimate from the true place, in inches."""
    return float(np.hypot(*(found.pose[:2] - true[:2]))) / INCH_M
