"""What each channel costs: milliseconds to measure a picture, and to compare it with a library.

Pictures are those of a simulated drive, 176 x 144. Each round measures every channel once, so that a busy
neighbor troubles all alike; medians are printed. Run: python -m benchmarks.speed.channels (some seconds,
and a minute more the first time, when the drive is simulated).
"""

from __future__ import annotations

import itertools
from time import perf_counter

import cv2
import numpy as np

import maurice_loaders as ml
import maurice_mcl as mcl
from maurice_datasets.demos import demo_paths
from maurice_mcl.sensor.descriptors.registry import CHANNELS
from maurice_mcl.sensor.distances import DISTANCES
from maurice_mcl.values.arrays import U8

PICTURES, ROUNDS = 40, 3


def timed(image: U8, name: str, library: mcl.Library) -> tuple[float, float]:
    """Return the seconds to measure one picture and to compare it with all references."""
    channel = CHANNELS[name]
    began = perf_counter()
    features = channel.describe(image)
    measured = perf_counter()
    DISTANCES[channel.distance](features, library.index[name])
    return measured - began, perf_counter() - measured


def main() -> None:
    cv2.setNumThreads(1)
    paths = demo_paths(0)
    library = ml.open_library(paths.survey)
    moments = itertools.islice(ml.open_session(paths.session).moments(), PICTURES)
    images = [moment.frame.image for moment in moments]
    took: dict[str, list[tuple[float, float]]] = {name: [] for name in library.index}
    for image in images * ROUNDS:
        for name in took:
            took[name].append(timed(image, name, library))
    print(f"{'channel':14}{'D':>5}{'measure, ms':>14}{f'against {library.size}, ms':>18}")
    for name, times in took.items():
        measure, compare = 1000 * np.median(np.array(times), axis=0)
        size = library.index[name].references.shape[1]
        print(f"{name:14}{size:5d}{measure:14.2f}{compare:18.2f}")


if __name__ == "__main__":
    main()
