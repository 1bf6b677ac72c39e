"""One picture: decoded, described by every channel, and compared with libraries of several sizes."""

from __future__ import annotations

from functools import partial

import cv2
import numpy as np

from maurice_mcl.sensor.descriptors.registry import CHANNELS
from maurice_mcl.sensor.distances import DISTANCES
from maurice_mcl.values.arrays import F64
from maurice_mcl.values.library import ChannelIndex

from .filter_step import random_index
from .measure import Table, Work, interleaved, ratio

LIBRARIES = {624: 20, 4_272: 10, 10_000: 5, 100_000: 2}  # references -> rounds
COMPARED = {"hellinger": 256, "l1": 324, "thesis": 84}  # distance -> elements: chromaticity, tiny, color


def one_picture(quick: bool) -> Table:
    """Measure one descriptor against libraries of several sizes, beside float64 broadcasting."""
    rows = []
    for references, rounds in LIBRARIES.items():
        for name, size in COMPARED.items():
            index = random_index(np.random.default_rng([2007, 3]), references, size)
            sample = index.references[300] + np.float32(0.25)
            naive = partial(broadcast, name, sample.astype(np.float64), index)
            distance = DISTANCES[name]
            distance(sample, index)  # what a library computes once
            works = {"ours": partial(distance, sample, index), "naive": naive}
            took = interleaved(works, max(rounds // 5, 2) if quick else rounds, 3)
            own, slow = took["ours"], took["naive"]
            cells = [f"{own.median * 1e3:.3f}", f"{slow.median * 1e3:.3f}", ratio(slow, own)]
            rows.append([f"{references:,}", f"{name}, {size}", *cells])
    return Table(
        "one-picture",
        "One picture against a library, milliseconds",
        ["references", "distance, elements", "ours", "float64 broadcasting", "ratio"],
        rows,
    )


def broadcast(name: str, sample: F64, index: ChannelIndex) -> F64:
    """Return the distances (L,) of a descriptor (D,) in float64, as one writes them first."""
    references = index.references.astype(np.float64)
    match name:
        case "hellinger":
            return np.sqrt(np.square(np.sqrt(references) - np.sqrt(sample)).mean(axis=1))
        case "l1":
            return np.abs(references - sample).mean(axis=1)
        case _:
            over = np.maximum(np.abs(references - sample) - index.noise_floor, 0)
            return (over / index.relevance).mean(axis=1)


PICTURES = {(144, 176): 40, (480, 640): 20, (1080, 1920): 5}  # height, width -> rounds


def pictures(quick: bool) -> Table:
    """Measure decoding a picture and every channel at several sizes."""
    rows: dict[str, list[str]] = {"JPEG, decode": [], "PNG, decode": [], **{name: [] for name in CHANNELS}}
    for (height, width), rounds in PICTURES.items():
        noise = np.random.default_rng(1).integers(0, 256, (height, width, 3), np.uint8)
        image = np.asarray(cv2.GaussianBlur(noise, (0, 0), 1.5), np.uint8)
        stored = {kind: cv2.imencode(end, image)[1] for kind, end in (("JPEG", ".jpg"), ("PNG", ".png"))}
        works: dict[str, Work] = {
            f"{kind}, decode": partial(cv2.imdecode, data, cv2.IMREAD_COLOR) for kind, data in stored.items()
        }
        works |= {name: partial(channel.describe, image) for name, channel in CHANNELS.items()}
        took = interleaved(works, max(rounds // 5, 2) if quick else rounds)
        for name, times in took.items():
            rows[name].append(f"{times.median * 1e3:.2f}")
    return Table(
        "pictures",
        "Decoding and describing a picture, milliseconds",
        ["", *(f"{width} x {height}" for height, width in PICTURES)],
        [[name, *cells] for name, cells in rows.items()],
    )
