"""Pictures measured and compared ahead of the filter: neither depends on the particles.

A separate thread reads, measures and compares the next few pictures while the filter works on this one;
OpenCV and numpy let both run at once. Every picture is compared alone: the numbers are those without it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from time import perf_counter
from typing import Protocol

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


class KnownDescriptors(Protocol):
    """Descriptors of pictures that were measured before: the same to the last bit as measured now."""

    def find(self, image: U8, channels: Iterable[str]) -> dict[str, F32]:
        """Return the descriptors of a picture (H, W, 3) that are known, by channel."""
        ...

    def keep(self, image: U8, descriptors: Mapping[str, F32]) -> None:
        """Keep descriptors of a picture, by channel."""
        ...

    def flush(self) -> None:
        """Do what is left to do: no picture follows."""
        ...


def measured(
    image: U8, channels: Iterable[str], known: KnownDescriptors | None = None
) -> tuple[dict[str, F32], dict[str, float]]:
    """Return what channels measure in a picture (H, W, 3) RGB, and the seconds that each took."""
    names, began = tuple(dict.fromkeys(channels)), perf_counter()
    found = {} if known is None else known.find(image, names)
    took_s = dict.fromkeys(names, (perf_counter() - began) / max(len(names), 1))
    missing = [name for name in names if name not in found]
    for name in missing:
        began = perf_counter()
        found[name] = CHANNELS[name].describe(image)
        took_s[name] += perf_counter() - began
    if known is not None and missing:
        known.keep(image, {name: found[name] for name in missing})
    return found, took_s


def compared(
    sensors: Sequence[SensorModel], image: U8, known: KnownDescriptors | None = None
) -> tuple[Compared, ...]:
    """Compare a picture (H, W, 3) RGB by each sensor model; a channel that several use is measured once."""
    descriptors, took_s = measured(
        image, (name for sensor in sensors for name in sensor.parameters.weights), known
    )
    found = []
    for sensor in sensors:
        began = perf_counter()
        comparison = sensor.compare({name: descriptors[name] for name in sensor.parameters.weights})
        comparison.prepare()
        took = perf_counter() - began + sum(took_s[name] for name in sensor.parameters.weights)
        found.append(Compared(comparison, took))
    return tuple(found)


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
        return None if moment is None else (moment, compared(sensors, moment.frame.image, known))

    worker = ThreadPoolExecutor(1)
    try:
        waiting = deque(worker.submit(take) for _ in range(PICTURES_AHEAD))
        while (found := waiting.popleft().result()) is not None:
            waiting.append(worker.submit(take))
            yield found
    finally:
        worker.shutdown(cancel_futures=True)
        if known is not None:
            known.flush()
