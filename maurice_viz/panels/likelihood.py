"""Likelihood over the whole map: for every place, how likely the picture is there in its best heading.

A map a channel, and one of all channels together. Only surveyed references are shown, each over the part of
the map that is nearest to it, so that what is drawn is what was measured.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import rerun as rr

from maurice_mcl.arrays import F32, I32, U8
from maurice_mcl.library import Library
from maurice_mcl.records import Comparison
from maurice_mcl.sensor.references import NearestReference

from ..entities import RunPaths
from ..style import DEEPEST, LUT, MISSING, Scale

MOST_PX = 120  # along the longer side of a map
BLENDED = "all"  # the map of all channels together


@dataclass(frozen=True, slots=True, eq=False)
class LikelihoodMaps:
    """Tables to draw with: pixels to places, and entries sorted by place."""

    place_of_pixel: I32  # (H, W), -1 outside free space; row 0 on top
    entries: I32  # (L,) sorted by place
    first: I32  # (P,) where each place's entries begin
    left_top: tuple[float, float]  # of the first pixel, in drawn units
    unit_per_px: float

    def prepare(self, rec: rr.RecordingStream, paths: RunPaths, channels: tuple[str, ...]) -> None:
        """Log where the maps lie, static."""
        for name in names(channels):
            rec.log(
                paths.likelihood(name),
                rr.Transform3D(translation=[*self.left_top, 0], scale=self.unit_per_px),
                rr.EncodedImage.from_fields(media_type="image/png", draw_order=-5.0, opacity=0.85),
                static=True,
            )

    def draw(self, rec: rr.RecordingStream, paths: RunPaths, comparison: Comparison) -> None:
        """Log one map a channel, and one of all."""
        parts = dict(zip(comparison.channels, -comparison.channel_cost, strict=True))
        for name in names(comparison.channels):
            logs = comparison.log_likelihood if name == BLENDED else parts[name]
            rec.log(paths.likelihood(name), rr.EncodedImage.from_fields(blob=self.encoded(logs)))

    def encoded(self, log_likelihood: F32) -> bytes:
        """Draw log-likelihoods (L,) as a PNG: bright where likely, nothing where a robot cannot be."""
        best = np.maximum.reduceat(log_likelihood[self.entries], self.first)
        share = 1 + (best - best.max()) / DEEPEST
        colors = _BGR[np.clip(share * 255, 0, 255).astype(np.uint8)]
        image = np.concatenate([colors, _OUTSIDE])[self.place_of_pixel]  # -1 is the last
        ok, data = cv2.imencode(".png", image, [cv2.IMWRITE_PNG_COMPRESSION, 1])
        assert ok
        return bytes(data)


def _bgr() -> U8:
    return np.stack([LUT >> 8 & 255, LUT >> 16 & 255, LUT >> 24], axis=1).astype(np.uint8)


_BGR = _bgr()
_OUTSIDE: U8 = np.array([MISSING[::-1]], np.uint8)


def names(channels: tuple[str, ...]) -> tuple[str, ...]:
    """Name the maps: all channels together first, then each, unless there is but one."""
    return (BLENDED, *channels) if len(channels) > 1 else (BLENDED,)


def likelihood_maps(library: Library, nearest: NearestReference, scale: Scale) -> LikelihoodMaps:
    """Make the tables for a library with at least one entry."""
    grid = nearest.grid
    step = max(1, -(-max(grid.shape) // MOST_PX))
    cells = nearest.place_of_cell[:-1].reshape(grid.shape)
    cells = cells[step // 2 :: step, step // 2 :: step]
    place = _place_of_entry(nearest, library.size)
    by_place = np.argsort(place, kind="stable").astype(np.int32)
    first = np.searchsorted(place[by_place], np.arange(len(nearest.places))).astype(np.int32)
    size_m = step * grid.cell_m
    top_left_m = np.array([[grid.corner[0], grid.corner[1] + len(cells) * size_m]])
    left, top = scale.screen(top_left_m)[0].tolist()
    return LikelihoodMaps(
        np.ascontiguousarray(cells[::-1]), by_place, first, (left, top), scale.length(size_m)
    )


def _place_of_entry(nearest: NearestReference, entries: int) -> I32:
    place = np.zeros(entries, np.int32)
    for number, row in enumerate(nearest.entry_of[:-1]):
        place[np.unique(row)] = number
    return place
