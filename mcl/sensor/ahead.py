"""Pictures measured and compared ahead of the filter: neither depends on the particles.

A separate thread reads, measures and compares the next few pictures while the filter works on this one;
OpenCV and numpy let both run at once. Every picture is compared alone: the numbers are those without it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from time import perf_counter

from ..arrays import F32, U8
from ..records import Comparison
from ..session import Moment
from .descriptors.registry import CHANNELS
from .model import SensorModel

PICTURES_AHEAD = 8


@dataclass(frozen=True, slots=True, eq=False)
class Compared:
    """A picture's comparison, and how long measuring and comparing took, as if for one filter alone."""

    comparison: Comparison
    took_s: float


def compared(sensors: Sequence[SensorModel], image: U8) -> tuple[Compared, ...]:
    """Compare a picture (H, W, 3) RGB by each sensor model; a channel that several use is measured once."""
    measured: dict[str, F32] = {}
    took_s: dict[str, float] = {}
    for channel in dict.fromkeys(name for sensor in sensors for name in sensor.parameters.weights):
        began = perf_counter()
        measured[channel] = CHANNELS[channel].describe(image)
        took_s[channel] = perf_counter() - began
    found = []
    for sensor in sensors:
        began = perf_counter()
        comparison = sensor.compare({name: measured[name] for name in sensor.parameters.weights})
        comparison.prepare()
        took = perf_counter() - began + sum(took_s[name] for name in sensor.parameters.weights)
        found.append(Compared(comparison, took))
    return tuple(found)


def compared_ahead(
    sensors: Sequence[SensorModel], moments: Iterable[Moment]
) -> Iterator[tuple[Moment, tuple[Compared, ...]]]:
    """Yield every moment with its picture compared by each sensor model, in order.

    Up to `PICTURES_AHEAD` moments are read before they are asked for: not for a live source. An error in
    reading or measuring is raised after all moments before it were yielded.
    """
    source = iter(moments)

    def take() -> tuple[Moment, tuple[Compared, ...]] | None:
        moment = next(source, None)
        return None if moment is None else (moment, compared(sensors, moment.frame.image))

    worker = ThreadPoolExecutor(1)
    try:
        waiting = deque(worker.submit(take) for _ in range(PICTURES_AHEAD))
        while (found := waiting.popleft().result()) is not None:
            waiting.append(worker.submit(take))
            yield found
    finally:
        worker.shutdown(cancel_futures=True)
