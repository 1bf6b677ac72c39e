"""Figures about histograms: of a picture and its reference, smoothed, summed, of edges, in other light."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from maurice_mcl.fitting.sensor import COLORS
from maurice_mcl.sensor.descriptors.histograms import BINS
from maurice_mcl.sensor.descriptors.registry import CHANNELS
from maurice_mcl.values.arrays import F32, F64
from maurice_viz.plots.calibration import HATCHES, INK, RGB, dress

from .example import MORE_LIGHT, DrivePictures, PicturePair, in_other_light
from .marks import (
    BIN_AXIS,
    COUNT_AXIS,
    LINES,
    MARKERS,
    NUMBERS,
    bin_ticks,
    draw_colors,
    grid_of_axes,
    remark,
)
from .material import Material, ThesisFigure, over_drives
from .over_particles import STYLES

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

GAINS = (0.6, 0.8, 1.0, 1.25, 1.6)  # of light
SHOWN_GAINS = (0.6, 1.0, 1.6)
FEATURES = ("color", "smoothed", "edges", "chromaticity")


def superposed(material: Material, channel: str) -> Figure:
    """Draw red, green and blue of a picture, and of its reference beside it."""
    pair = material.pictures.usual
    drawing, panels_ = grid_of_axes(2, same=True)
    measured, referred = pair.described(channel)
    for axes, values, title in zip(panels_, (measured, referred), _titles(pair), strict=True):
        dress(axes, title, BIN_AXIS, COUNT_AXIS)
        bin_ticks(axes)
        draw_colors(axes, values)
        if channel == "edges":  # most edges are weak
            axes.set_yscale("log")
            axes.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    return drawing


def by_channel(material: Material, channel: str) -> Figure:
    """Draw what every bin adds to the thesis's difference between a picture and its reference."""
    pair = material.pictures.usual
    drawing, (axes,) = grid_of_axes(1)
    dress(axes, "", BIN_AXIS, "(|sample - reference| - noise) / relevance")
    bin_ticks(axes)
    parts = pair.differences(channel).reshape(3, BINS)
    for k, (name, color) in enumerate(zip(COLORS, RGB, strict=True)):
        label = f"{name}: sum {parts[k].sum():.2f}"
        at = NUMBERS + 0.27 * (k - 1)
        axes.bar(at, parts[k], 0.27, color=color, hatch=HATCHES[k], edgecolor="white", lw=0, label=label)
    axes.legend(fontsize=8)
    sums = [_sums(album, channel) for album in material.several]
    own = float(parts.sum())
    caption = f"step {pair.step}: sum {own:.2f} of {parts.size} (D = {own / parts.size:.3f}); "
    remark(drawing, f"{caption}over {_pictures(material)} mean {over_drives(sums).text(1, 2)}")
    return drawing


def _sums(pictures: DrivePictures, channel: str) -> F64:
    pairs = (PicturePair(pictures, number) for number in range(len(pictures.known)))
    return np.array([float(pair.differences(channel).sum()) for pair in pairs])


def in_shifted_light(material: Material) -> Figure:
    """Draw the histograms of a picture in more light and of its reference, and how usual a shift is."""
    pair = material.pictures.shifted
    drawing, (left, right) = grid_of_axes(2)
    dress(left, _told(pair), BIN_AXIS, COUNT_AXIS)
    over_each_other(left, *pair.described("color"))
    dress(right, f"all {_pictures(material)}", "brighter than its reference (gray levels)", "pictures")
    shifts = [album.brighter for album in material.several]
    relit_shifts = [album.in_light(MORE_LIGHT).brighter for album in material.several]
    driven, relit = np.concatenate(shifts), np.concatenate(relit_shifts)
    edges = np.linspace(min(driven.min(), relit.min()), max(driven.max(), relit.max()), 30)
    right.hist(driven, list(edges), color="#888D96", edgecolor="white", label="in the light of the drive")
    label = f"in {MORE_LIGHT:g} x the light"
    right.hist(relit, list(edges), histtype="step", color=STYLES[1][0], hatch="///", label=label)
    right.legend(fontsize=8)
    size, relit_size = (over_drives([np.abs(album) for album in some]) for some in (shifts, relit_shifts))
    caption = f"size of the shift, mean: {size.text(1, 2)} gray levels as driven"
    remark(drawing, f"{caption}, {relit_size.text(1, 2)} in {MORE_LIGHT:g} x the light")
    return drawing


def summed(material: Material) -> Figure:
    """Draw the summation histograms of a picture and its reference: how much is darker than each level."""
    pair = material.pictures.shifted
    drawing, panels_ = grid_of_axes(3, same=True)
    measured, referred = (album.reshape(3, BINS) for album in pair.described("cumulative"))
    for k, (name, color) in enumerate(zip(COLORS, RGB, strict=True)):
        dress(panels_[k], name, "bin", "256 x share, summed")
        bin_ticks(panels_[k])
        panels_[k].set_xticks(NUMBERS[::6])
        panels_[k].plot(NUMBERS, measured[k], "-", color=color, label="sample")
        panels_[k].plot(NUMBERS, referred[k], "--", color=INK, label="reference")
        panels_[k].fill_between(NUMBERS, measured[k], referred[k], color=color, alpha=0.15, lw=0)
        panels_[k].legend(fontsize=8, loc="lower right")
    caption = "the shaded area is what must move, and how far: the earth mover's distance"
    remark(drawing, f"{_told(pair)}; {caption}")
    return drawing


def smoothed(material: Material) -> Figure:
    """Draw what every bin adds to the difference with and without smoothing, in other light."""
    pair = material.pictures.shifted
    drawing, panels_ = grid_of_axes(3, same=True)
    plain, smooth = (pair.differences(name).reshape(3, BINS) for name in ("color", "smoothed"))
    for k, (name, color) in enumerate(zip(COLORS, RGB, strict=True)):
        axes = panels_[k]
        dress(axes, name, "bin", "part of the difference")
        bin_ticks(axes)
        axes.set_xticks(NUMBERS[::6])
        axes.bar(NUMBERS, plain[k], 0.9, color=color, alpha=0.45, label=f"plain, sum {plain[k].sum():.2f}")
        label = f"smoothed, sum {smooth[k].sum():.2f}"
        axes.plot(NUMBERS, smooth[k], "-", marker="o", ms=3, color=INK, label=label)
        axes.legend(fontsize=8)
    top = max(axes.get_ylim()[1] for axes in panels_)
    for axes in panels_:
        axes.set_ylim(0, top * 1.15)
    relit = [album.in_light(MORE_LIGHT) for album in material.several]
    sums = [(_sums(album, "color"), _sums(album, "smoothed")) for album in relit]
    cut = [100 * (1 - smooth / np.maximum(plain, 1e-6)) for plain, smooth in sums]
    less = over_drives(cut).text(1, 0)
    remark(drawing, f"{_told(pair)}; over {_pictures(material)} smoothing lowers the sum by {less} %")
    return drawing


def over_each_other(axes: Axes, measured: F32, referred: F32) -> None:
    """Draw a picture's histogram over that of its reference, color by color, and the mean of each."""
    both = measured.reshape(3, BINS), referred.reshape(3, BINS)
    for k, (name, color) in enumerate(zip(COLORS, RGB, strict=True)):
        axes.plot(NUMBERS, both[0][k], "-", marker=MARKERS[k], ms=4, color=color, label=f"{name}, sample")
        axes.plot(NUMBERS, both[1][k], "--", marker=MARKERS[k], ms=4, mfc="white", color=color)
    axes.plot([], [], "--", color=INK, label="the same, reference")
    bin_ticks(axes)
    axes.legend(fontsize=8)


def by_gain(material: Material) -> Figure:
    """Draw how more or less light shifts a picture's histogram, and what that does to the matching."""
    pair = material.pictures.usual
    drawing, (left, right) = grid_of_axes(2)
    dress(left, f"green of step {pair.step}", BIN_AXIS, COUNT_AXIS)
    for k, gain in enumerate(SHOWN_GAINS):
        values = CHANNELS["color"].describe(in_other_light(pair.sample, gain)).reshape(3, BINS)[1]
        color = STYLES[k][0]
        left.plot(NUMBERS, values, LINES[k], marker=MARKERS[k], ms=4, color=color, label=f"{gain:g} x light")
    bin_ticks(left)
    left.legend(fontsize=8)
    dress(
        right,
        "rank of the truth's reference",
        "light, times that of the drive",
        f"median rank, of {material.library.size} references",
    )
    for feature, (color, marker, line) in zip(FEATURES, STYLES, strict=True):
        panels_ = np.array([_medians(material, feature, gain) for gain in GAINS]).T
        middle, low, high = panels_
        spread = [middle - low, high - middle]
        right.errorbar(GAINS, middle, spread, color=color, marker=marker, ls=line, capsize=3, label=feature)
    right.set_yscale("log")
    right.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    right.set_xscale("log")
    right.set_xticks(GAINS, [f"{gain:g}" for gain in GAINS])
    right.minorticks_off()
    right.legend(fontsize=8)
    remark(drawing, f"the thesis's distance over {_pictures(material)}; lines: lowest and highest drive")
    return drawing


def _medians(material: Material, feature: str, gain: float) -> tuple[float, float, float]:
    """Return the median rank over all pictures, and the lowest and highest median of a drive."""
    ranks = [album.in_light(gain).ranks(feature) for album in material.several]
    medians = [float(np.median(some)) for some in ranks]
    return float(np.median(np.concatenate(ranks))), min(medians), max(medians)


def _told(pair: PicturePair) -> str:
    light = "" if pair.pictures.gain == 1 else f" in {pair.pictures.gain:g} x the light"
    return f"step {pair.step}{light}, and the truth's reference {pair.entry}"


def _titles(pair: PicturePair) -> tuple[str, str]:
    return f"sample of step {pair.step}", f"truth's reference, entry {pair.entry}"


def _pictures(material: Material) -> str:
    drives = len(material.several)
    pictures = sum(len(album.known) for album in material.several)
    return f"{pictures} pictures of {drives} drive{'s' * (drives > 1)}"


FIGURES = (
    ThesisFigure(21, "Histograms of a sample and of its reference", partial(superposed, channel="color")),
    ThesisFigure(22, "What every bin adds to the difference", partial(by_channel, channel="color")),
    ThesisFigure(42, "A shift of light between a sample and its reference", in_shifted_light),
    ThesisFigure(43, "Summation histograms of a sample and of its reference", summed),
    ThesisFigure(47, "What every bin adds to the difference, with and without smoothing", smoothed),
    ThesisFigure(52, "Histograms of edge images, sample and reference", partial(superposed, channel="edges")),
    ThesisFigure(53, "What every bin of edges adds to the difference", partial(by_channel, channel="edges")),
    ThesisFigure(73, "A histogram's shift with brightness", by_gain),
)
