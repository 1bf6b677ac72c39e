"""Figures about pictures and matching: samples, references, their qualities, and where the truth's ranks."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from maurice_mcl.fitting.sensor import stretched
from maurice_mcl.sensor.descriptors.histograms import edge_image
from maurice_mcl.values.arrays import F32
from maurice_mcl.values.geometry import INCH_M
from maurice_viz.plots.calibration import INK, dress

from .example import MORE_LIGHT, DrivePictures, PicturePair, ranks_of, reference_picture, rooms_of, with_noise
from .maps import map_axes
from .marks import draw_picture, grid_of_axes, remark, say_pose
from .material import Material, ThesisFigure, over_drives
from .over_particles import STYLES

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BEST = 5
ROOM_MARKS = (("#7A9CC6", "o"), ("#C6A27A", "x"), ("#8CBF9F", "^"))
NOISE = (0, 5, 10, 20, 40)  # sd in gray levels
SHOWN_NOISE = 20
NOISY = ("color", "smoothed", "edges")


def quality(material: Material, feature: str, beside: Sequence[str] = (), *, shifted: bool = False) -> Figure:
    """Draw the quality of every reference for one picture, and the truth's rank over all pictures.

    `beside` are features whose ranks are drawn for comparison; `shifted` takes all pictures in more light.
    """
    drawing, (left, right) = grid_of_axes(2, widths=(1.9, 1.0))
    among = [album.in_light(MORE_LIGHT if shifted else 1.0) for album in material.several]
    pair = among[0].usual
    found = pair.pictures.quality(feature)[pair.number]
    light = f" in {MORE_LIGHT:g} x the light" if shifted else ""
    dress(
        left,
        f"{feature}, step {pair.step}{light}",
        "number of the reference (entry)",
        "quality, 1 is perfect",
    )
    _by_entry(left, pair, found)
    dress(right, "", "rank of the truth's reference, at most", "share of pictures (%)")
    for number, name in enumerate((feature, *beside)):
        _ranks(right, among, name, number)
    right.set_xscale("log")
    right.xaxis.set_major_formatter(lambda value, _: f"{value:,.0f}")
    right.set_ylim(0, 101)
    right.legend(fontsize=8, loc="upper left")
    rank = int(pair.pictures.ranks(feature)[pair.number])
    remark(drawing, f"truth's reference: rank {rank} of {len(found)}; {_over_all(among, feature)}")
    return drawing


def _by_entry(axes: Axes, pair: PicturePair, found: F32) -> None:
    library = pair.pictures.library
    for (name, there), (color, marker) in zip(rooms_of(library), ROOM_MARKS, strict=False):
        at = np.flatnonzero(there)
        axes.plot(at, found[at], marker, ms=3.5, color=color, ls="", label=f"references in the {name}")
    best = np.argsort(-found, kind="stable")[:BEST]
    axes.plot(best, found[best], "s", ms=8, mfc="none", color=INK, label=f"best {len(best)}")
    label = f"truth's reference, entry {pair.entry}"
    axes.axvline(pair.entry, color=INK, lw=0.8, ls=":")
    axes.plot([pair.entry], [found[pair.entry]], "*", ms=15, color="#D55E00", mec=INK, label=label)
    axes.set_ylim(0, 1.02)
    axes.set_xlim(-len(found) * 0.01, len(found) * 1.01)
    axes.legend(fontsize=8, loc="upper center", bbox_to_anchor=(0.5, -0.13), ncols=4, frameon=False)


def _ranks(axes: Axes, among: Sequence[DrivePictures], feature: str, number: int) -> None:
    """Draw the share of pictures against rank, of all drives together; and the range of the drives."""
    color, _, line = STYLES[number]
    ranks = [album.ranks(feature) for album in among]
    at = np.arange(1, max(album.library.size for album in among) + 1)
    shares = 100 * np.array([(some[:, None] <= at).mean(axis=0) for some in ranks])
    together = np.concatenate(ranks)
    axes.step(
        at, 100 * (together[:, None] <= at).mean(axis=0), where="post", color=color, ls=line, label=feature
    )
    if len(ranks) > 1:
        low, high = shares.min(axis=0), shares.max(axis=0)
        label = "lowest to highest drive" if number == 0 else None
        axes.fill_between(at, low, high, step="post", color=color, alpha=0.13, lw=0, label=label)


def _over_all(among: Sequence[DrivePictures], feature: str) -> str:
    """Tell the ranks of the truth's references over all pictures."""
    ranks = [album.ranks(feature) for album in among]
    low, middle, high = np.percentile(np.concatenate(ranks), (10, 50, 90))
    count, drives = len(np.concatenate(ranks)), len(ranks)
    caption = f"over {count} pictures of {drives} drive{'s' * (drives > 1)}: median {middle:.0f}"
    return f"{caption}, 80 % from {low:.0f} to {high:.0f}"


def best_matches(material: Material, feature: str) -> Figure:
    """Draw a picture and the five references that match it best, with quality, place and heading."""
    pair, library = material.pictures.usual, material.pictures.library
    found = pair.pictures.quality(feature)[pair.number]
    best = np.argsort(-found, kind="stable")[:BEST]
    drawing, places = grid_of_axes(3, 2, height=6.4)
    draw_picture(places[0], pair.sample, f"sample of step {pair.step}", say_pose(pair.truth))
    for rank, (axes, entry) in enumerate(zip(places[1:], best.tolist(), strict=True), start=1):
        off = float(np.linalg.norm(library.poses[entry, :2] - pair.truth[:2])) / INCH_M
        title = f"{rank}. entry {entry}, quality {found[entry]:.3f}"
        true = ": the truth's reference" if entry == pair.entry else f": {off:.0f} in from the truth"
        draw_picture(axes, reference_picture(library, entry), title + true, say_pose(library.poses[entry]))
    remark(drawing, _within_best(material, feature))
    return drawing


def _within_best(material: Material, feature: str) -> str:
    ranks = [album.ranks(feature) for album in material.several]
    hits = over_drives([np.asarray(some <= BEST, np.float64) for some in ranks])
    over = f"{sum(map(len, ranks))} pictures of {len(ranks)} drives"
    return f"the truth's reference is among the best five in {hits.text(100, 0)} % of {over}"


def placed(material: Material, *, reference: bool) -> Figure:
    """Draw the sample, or the truth's reference, beside a map of where it was taken."""
    pair = material.pictures.usual
    drawing, (left, right) = grid_of_axes(2, widths=(1.25, 1.0))
    if reference:
        draw_picture(left, pair.reference, f"truth's reference, entry {pair.entry}", say_pose(pair.pose))
    else:
        draw_picture(left, pair.sample, f"sample of step {pair.step}", say_pose(pair.truth))
    _map(drawing, right, pair)
    gap = pair.pose - pair.truth
    off, turned = np.hypot(*gap[:2]) / INCH_M, np.degrees((gap[2] + np.pi) % (2 * np.pi) - np.pi)
    far = [_gap_in(PicturePair(album, k)) for album in material.several for k in range(len(album.known))]
    low, middle, high = np.percentile(far, (10, 50, 90))
    caption = f"the reference is {off:.1f} in and {turned:+.0f} deg from the sample"
    spread = f"median {middle:.1f} in, 80 % from {low:.1f} to {high:.1f} in"
    remark(drawing, f"{caption}; over {len(far)} pictures {spread}")
    return drawing


def _gap_in(pair: PicturePair) -> float:
    return float(np.hypot(*(pair.pose - pair.truth)[:2]) / INCH_M)


def _map(drawing: Figure, axes: Axes, pair: PicturePair) -> None:
    """Draw walls, obstacles and places of references, with the sample's pose and its reference's."""
    map_axes(drawing, axes, pair.pictures.library.arena)
    axes.set_title("where they were taken", loc="left", fontsize=9, color=INK)
    places = np.unique(pair.pictures.library.poses[:, :2], axis=0) / INCH_M
    axes.plot(*places.T, ".", ms=3, color="#888D96", label="places of references")
    for pose, name, (color, marker, line) in zip(
        (pair.truth, pair.pose), ("sample", "truth's reference"), STYLES, strict=False
    ):
        x, y = pose[:2] / INCH_M
        dx, dy = 14 * np.cos(pose[2]), 14 * np.sin(pose[2])
        axes.plot([x, x + dx], [y, y + dy], line, color=color, lw=2)
        axes.plot([x], [y], marker, ms=8, color=color, label=name)
    axes.legend(fontsize=8, loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=3, frameon=False)


def side_by_side(material: Material) -> Figure:
    """Draw a picture in the light of the drive and in more light, beside its reference."""
    drawing, places = grid_of_axes(3)
    for axes, pair in zip(places, (material.pictures.usual, material.pictures.shifted), strict=False):
        gain, shift = pair.pictures.gain, pair.pictures.brighter[pair.number]
        title = f"step {pair.step}, {gain:g} x the light: {shift:+.1f} gray levels"
        draw_picture(axes, pair.sample, title, say_pose(pair.truth))
    draw_picture(places[2], pair.reference, f"its reference, entry {pair.entry}", say_pose(pair.pose))
    every = np.concatenate([album.brighter for album in material.several])
    low, middle, high = np.percentile(every, (10, 50, 90))
    caption = f"as driven, samples are brighter than their references by: median {middle:+.1f}, 80 % from"
    over = f"{len(every)} pictures of {len(material.several)} drives"
    remark(drawing, f"{caption} {low:+.1f} to {high:+.1f} gray levels, of {over}")
    return drawing


def edges(material: Material) -> Figure:
    """Draw a sample and its edge image."""
    pair = material.pictures.usual
    drawing, (left, right) = grid_of_axes(2)
    draw_picture(left, pair.sample, f"sample of step {pair.step}", say_pose(pair.truth))
    found = edge_image(pair.sample)
    seen = 100 * float((found >= 16).mean())
    below = f"contrast stretched; {seen:.0f} % of the values are 16 or more, which the histogram counts"
    draw_picture(right, stretched(found), "its edge image, color by color", below)
    return drawing


def noise(material: Material) -> Figure:
    """Draw a sample before and after Gaussian noise, and what noise does to the matching."""
    pair, pictures = material.pictures.usual, material.pictures
    drawing, (before, after, axes) = grid_of_axes(3, widths=(1.0, 1.0, 1.25))
    draw_picture(before, pair.sample, f"sample of step {pair.step}", "as taken")
    draw_picture(after, with_noise(pair.sample, SHOWN_NOISE), "with noise", f"sd {SHOWN_NOISE} gray levels")
    label = f"median rank, of {pictures.library.size} references"
    dress(axes, "rank of the truth's reference", "sd of the noise (gray levels)", label)
    for feature, (color, marker, line) in zip(NOISY, STYLES, strict=False):
        low, middle, high = np.array([_noisy_ranks(material, feature, sd) for sd in NOISE]).T
        spread = [middle - low, high - middle]
        axes.errorbar(NOISE, middle, spread, color=color, marker=marker, ls=line, capsize=3, label=feature)
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axes.legend(fontsize=8)
    count = sum(len(album.known) for album in material.several)
    remark(drawing, f"the thesis's distance over {count} pictures; vertical lines: lowest and highest drive")
    return drawing


def _noisy_ranks(material: Material, feature: str, sd: float) -> tuple[float, float, float]:
    ranks = []
    for album in material.several:
        noisy = [with_noise(image, sd) for image in album.images]
        ranks.append(ranks_of(album.quality_of(feature, noisy), album.entries))
    medians = [float(np.median(some)) for some in ranks]
    return min(medians), float(np.median(np.concatenate(ranks))), max(medians)


FIGURES = (
    ThesisFigure(17, "Quality of every reference for one sample", partial(quality, feature="color")),
    ThesisFigure(18, "The five references that match a sample best", partial(best_matches, feature="color")),
    ThesisFigure(
        48,
        "Quality of every reference in other light, without smoothing",
        partial(quality, feature="color", beside=("smoothed",), shifted=True),
    ),
    ThesisFigure(
        49,
        "Quality of every reference in other light, with smoothing",
        partial(quality, feature="smoothed", beside=("color",), shifted=True),
    ),
    ThesisFigure(
        54, "The five references whose edges match a sample best", partial(best_matches, feature="edges")
    ),
    ThesisFigure(
        55,
        "Quality of every reference by edges",
        partial(quality, feature="edges", beside=("color",)),
    ),
    ThesisFigure(
        57,
        "Quality of every reference, color and edges blended",
        partial(quality, feature="blended", beside=("color", "edges")),
    ),
    ThesisFigure(19, "A sample, and where it was taken", partial(placed, reference=False)),
    ThesisFigure(20, "The reference nearest to it in position", partial(placed, reference=True)),
    ThesisFigure(41, "Samples and their references", side_by_side),
    ThesisFigure(51, "The edge image of a sample", edges),
    ThesisFigure(63, "A sample before and after Gaussian noise", noise),
)
