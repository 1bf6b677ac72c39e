"""Figures that show pictures: samples, references and where they were taken, edge images, added noise."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from maurice_mcl.calibration.sensor import stretched
from maurice_mcl.geometry import INCH_M
from maurice_mcl.sensor.descriptors.edges import edge_image

from .calibration import INK, dress
from .example import PicturePair, ranks_of, with_noise
from .marks import draw_picture, grid_of_axes, remark, say_pose
from .material import Material, ThesisFigure
from .over_particles import STYLES

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

NOISE = (0, 5, 10, 20, 40)  # sd in gray levels
SHOWN_NOISE = 20
NOISY = ("color", "smoothed", "edges")


def placed(material: Material, *, reference: bool) -> Figure:
    """Draw the sample, or the truth's reference, beside a map of where it was taken."""
    pair = material.pictures.usual
    made, (left, right) = grid_of_axes(2, widths=(1.25, 1.0))
    if reference:
        draw_picture(left, pair.reference, f"truth's reference, entry {pair.entry}", say_pose(pair.pose))
    else:
        draw_picture(left, pair.sample, f"sample of step {pair.step}", say_pose(pair.truth))
    _map(right, pair)
    gap = pair.pose - pair.truth
    off, turned = np.hypot(*gap[:2]) / INCH_M, np.degrees((gap[2] + np.pi) % (2 * np.pi) - np.pi)
    far = [_gap_in(PicturePair(one, k)) for one in material.several for k in range(len(one.known))]
    low, middle, high = np.percentile(far, (10, 50, 90))
    told = f"the reference is {off:.1f} in and {turned:+.0f} deg from the sample"
    spread = f"median {middle:.1f} in, 80 % from {low:.1f} to {high:.1f} in"
    remark(made, f"{told}; over {len(far)} pictures {spread}")
    return made


def _gap_in(pair: PicturePair) -> float:
    return float(np.hypot(*(pair.pose - pair.truth)[:2]) / INCH_M)


def _map(axes: Axes, pair: PicturePair) -> None:
    """Draw walls, obstacles and places of references, with the sample's pose and its reference's."""
    arena = pair.pictures.library.arena
    dress(axes, "where they were taken", "x (in)", "y (in)")
    for x1, y1, x2, y2 in arena.walls / INCH_M:
        axes.plot([x1, x2], [y1, y2], color=INK, lw=1.6)
    for obstacle in arena.obstacles:
        axes.fill(*(obstacle.polygon.T / INCH_M), color="#B9BDC6", lw=0)
    places = np.unique(pair.pictures.library.poses[:, :2], axis=0) / INCH_M
    axes.plot(*places.T, ".", ms=3, color="#888D96", label="places of references")
    for pose, name, (color, marker, line) in zip(
        (pair.truth, pair.pose), ("sample", "truth's reference"), STYLES, strict=False
    ):
        x, y = pose[:2] / INCH_M
        dx, dy = 14 * np.cos(pose[2]), 14 * np.sin(pose[2])
        axes.plot([x, x + dx], [y, y + dy], line, color=color, lw=2)
        axes.plot([x], [y], marker, ms=8, color=color, label=name)
    axes.set_aspect("equal")
    axes.legend(fontsize=8, loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=3, frameon=False)


def side_by_side(material: Material) -> Figure:
    """Draw a picture in the light of the drive and in more light, beside its reference."""
    made, found = grid_of_axes(3)
    for axes, pair in zip(found, (material.pictures.usual, material.pictures.shifted), strict=False):
        gain, shift = pair.pictures.gain, pair.pictures.brighter[pair.number]
        title = f"step {pair.step}, {gain:g} x the light: {shift:+.1f} gray levels"
        draw_picture(axes, pair.sample, title, say_pose(pair.truth))
    draw_picture(found[2], pair.reference, f"its reference, entry {pair.entry}", say_pose(pair.pose))
    every = np.concatenate([one.brighter for one in material.several])
    low, middle, high = np.percentile(every, (10, 50, 90))
    told = f"as driven, samples are brighter than their references by: median {middle:+.1f}, 80 % from"
    over = f"{len(every)} pictures of {len(material.several)} drives"
    remark(made, f"{told} {low:+.1f} to {high:+.1f} gray levels, of {over}")
    return made


def edges(material: Material) -> Figure:
    """Draw a sample and its edge image."""
    pair = material.pictures.usual
    made, (left, right) = grid_of_axes(2)
    draw_picture(left, pair.sample, f"sample of step {pair.step}", say_pose(pair.truth))
    found = edge_image(pair.sample)
    seen = 100 * float((found >= 16).mean())
    below = f"contrast stretched; {seen:.0f} % of the values are 16 or more, which the histogram counts"
    draw_picture(right, stretched(found), "its edge image, color by color", below)
    return made


def noise(material: Material) -> Figure:
    """Draw a sample before and after Gaussian noise, and what noise does to the matching."""
    pair, pictures = material.pictures.usual, material.pictures
    made, (before, after, axes) = grid_of_axes(3, widths=(1.0, 1.0, 1.25))
    draw_picture(before, pair.sample, f"sample of step {pair.step}", "as taken")
    draw_picture(after, with_noise(pair.sample, SHOWN_NOISE), "with noise", f"sd {SHOWN_NOISE} gray levels")
    label = f"median rank, of {pictures.library.size} references"
    dress(axes, "rank of the truth's reference", "sd of the noise (gray levels)", label)
    for feature, (color, marker, line) in zip(NOISY, STYLES, strict=False):
        low, middle, high = np.array([_ranks(material, feature, sd) for sd in NOISE]).T
        spread = [middle - low, high - middle]
        axes.errorbar(NOISE, middle, spread, color=color, marker=marker, ls=line, capsize=3, label=feature)
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axes.legend(fontsize=8)
    count = sum(len(one.known) for one in material.several)
    remark(made, f"the thesis's distance over {count} pictures; vertical lines: lowest and highest drive")
    return made


def _ranks(material: Material, feature: str, sd: float) -> tuple[float, float, float]:
    ranks = []
    for one in material.several:
        noisy = [with_noise(image, sd) for image in one.images]
        ranks.append(ranks_of(one.quality_of(feature, noisy), one.entries))
    medians = [float(np.median(some)) for some in ranks]
    return min(medians), float(np.median(np.concatenate(ranks))), max(medians)


PICTURE_FIGURES = (
    ThesisFigure(19, "A sample, and where it was taken", partial(placed, reference=False)),
    ThesisFigure(20, "The reference nearest to it in position", partial(placed, reference=True)),
    ThesisFigure(41, "Samples and their references", side_by_side),
    ThesisFigure(51, "The edge image of a sample", edges),
    ThesisFigure(63, "A sample before and after Gaussian noise", noise),
)
