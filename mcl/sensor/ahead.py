"""What other threads do ahead, as OpenCV and numpy let them run at once: the numbers are those of one thread.

A separate thread measures, reads and compares the next few frames while the filter works on this one: none of
it depends on the particles. What is done once with every picture of a library is done on all cores.
"""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import islice
from time import perf_counter
from typing import Any, Protocol, TypeVar

from ..values import F32, U8, Comparison, Frame, Moment, PoseSensor
from .descriptors.registry import CHANNELS, reduced
from .model import SensorModel

PICTURES_AHEAD = 8
ITEMS_AHEAD = 4  # a core

Item = TypeVar("Item")
Result = TypeVar("Result")


@dataclass(frozen=True, slots=True, eq=False)
class Compared:
    """A frame's comparison, and how long measuring and comparing took, as if for one filter alone."""

    comparison: Comparison
    took_s: float


class KnownDescriptors(Protocol):
    """Descriptors of pictures that were measured before: the same to the last bit as measured now."""

    def find(self, image: U8, channels: Iterable[str]) -> dict[str, F32]:
        """Return the descriptors of a picture (H, W, 3) that are known, by channel."""
        ...

    def keep(self, image: U8, descriptors: Mapping[str, F32]) -> None:
        """Keep descriptors of a picture, by channel."""
        ...

    def reading(self, sensor: Any, frame: Frame) -> Any:
        """Return what a pose sensor reads in a frame, which knows readings as numbers: known, or read now."""
        ...

    def flush(self) -> None:
        """Do what is left to do: no picture follows."""
        ...


def measured(
    image: U8, channels: Iterable[str], known: KnownDescriptors | None = None
) -> tuple[dict[str, F32], dict[str, float]]:
    """Return what channels measure in a picture (H, W, 3) RGB, and the seconds that each took."""
    names, start_s = tuple(dict.fromkeys(channels)), perf_counter()
    image = reduced(image)
    descriptors = {} if known is None else known.find(image, names)
    took_s = dict.fromkeys(names, (perf_counter() - start_s) / max(len(names), 1))
    missing = [name for name in names if name not in descriptors]
    for name in missing:
        start_s = perf_counter()
        descriptors[name] = CHANNELS[name].describe(image)
        took_s[name] += perf_counter() - start_s
    if known is not None and missing:
        known.keep(image, {name: descriptors[name] for name in missing})
    return descriptors, took_s


def compared(
    sensors: Sequence[SensorModel], frame: Frame, known: KnownDescriptors | None = None
) -> tuple[Compared, ...]:
    """Compare a frame by each sensor model; what several use is measured and read once."""
    names = [name for sensor in sensors for name in sensor.weights]
    descriptors, took_s = measured(frame.image, names, known)
    readings: dict[int, tuple[Any, float]] = {}  # and how long each took
    results = []
    for sensor in sensors:
        shared = 0.0
        for pose_sensor in sensor.sensors.values():
            if id(pose_sensor) not in readings:
                readings[id(pose_sensor)] = _read(pose_sensor, frame, known)
            shared += readings[id(pose_sensor)][1]
        start_s = perf_counter()
        read = {name: readings[id(used)][0] for name, used in sensor.sensors.items()}
        comparison = sensor.compare(
            {name: descriptors[name] for name in sensor.weights},
            {name: value for name, value in read.items() if value is not None},
        )
        comparison.prepare()
        took = perf_counter() - start_s + shared + sum(took_s[name] for name in sensor.weights)
        results.append(Compared(comparison, took))
    return tuple(results)


def _read(sensor: PoseSensor, frame: Frame, known: KnownDescriptors | None) -> tuple[Any, float]:
    """Return what a pose sensor reads, and how long that took."""
    start_s, keeps = perf_counter(), hasattr(sensor, "of_numbers")
    reading = known.reading(sensor, frame) if known is not None and keeps else sensor.read(frame)
    return reading, perf_counter() - start_s


def compared_ahead(
    sensors: Sequence[SensorModel], moments: Iterable[Moment], known: KnownDescriptors | None = None
) -> Iterator[tuple[Moment, tuple[Compared, ...]]]:
    """Yield every moment with its picture compared by each sensor model, in order.

    Up to `PICTURES_AHEAD` moments are read before they are asked for: not for a live source. An error in
    reading or measuring is raised after all moments before it were yielded. Pictures in `known` are not
    measured again.
    """
    source = iter(moments)

    def take() -> tuple[Moment, tuple[Compared, ...]] | None:
        moment = next(source, None)
        return None if moment is None else (moment, compared(sensors, moment.frame, known))

    worker = ThreadPoolExecutor(1)
    try:
        waiting = deque(worker.submit(take) for _ in range(PICTURES_AHEAD))
        while (result := waiting.popleft().result()) is not None:
            waiting.append(worker.submit(take))
            yield result
    finally:
        worker.shutdown(cancel_futures=True)
        if known is not None:
            known.flush()


def on_all_cores(call: Callable[[Item], Result], items: Iterable[Item]) -> Iterator[Result]:
    """Yield the result of each item, in order. Items are taken by the caller's thread, a few ahead."""
    cores, source = os.cpu_count() or 1, iter(items)
    pool = ThreadPoolExecutor(cores)
    try:
        waiting = deque(pool.submit(call, item) for item in islice(source, ITEMS_AHEAD * cores))
        while waiting:
            yield waiting.popleft().result()
            waiting.extend(pool.submit(call, item) for item in islice(source, 1))
    finally:
        pool.shutdown(cancel_futures=True)  # after Ctrl-C nobody waits for the others
