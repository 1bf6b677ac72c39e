"""The map in a bag: an OccupancyGrid, as map_server publishes it once for all who come later."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from itertools import islice
from pathlib import Path
from typing import Any, TypeVar

from maurice_mcl.values import OccupancyMap

from ..errors import InputError
from ..files.maps import occupancy_of_message
from ..formats.registry import chosen
from ..reading.options import Reading
from .messages import MESSAGE_ERRORS
from .recording import BAGS
from .source import BagSource
from .topics import map_topics

Map = TypeVar("Map")


def map_in(path: Path, options: Reading | None = None) -> OccupancyMap | None:
    """Return the map that a recording holds; None for one that holds none, as all that are no bags.

    InputError for a map that cannot be used, and as for `open_recording`.
    """
    name = chosen(path, options or Reading()).name
    if name not in BAGS:
        return None
    with BAGS[name](path) as bag:
        return map_of(path, bag, occupancy_of_message)


def expected_map(path: Path) -> OccupancyMap:
    """Return the map that a bag holds. InputError as of `map_in`, and without one."""
    occupancy = map_in(path)
    if occupancy is None:
        raise InputError(path, "found a bag without a map, expected one; name a map.yaml with --map")
    return occupancy


def map_of(path: Path, bag: BagSource, make: Callable[[Any], Map]) -> Map | None:
    """Return the last map of a bag's first topic that can be used. InputError where there are only others.

    A SLAM publishes its map again and again as it grows.
    """
    problem = ""
    for topic in map_topics(bag.topics):
        for message in deque(islice(bag.messages({topic.name}), topic.count), maxlen=1):
            try:
                return make(message.decode())
            except (InputError, *MESSAGE_ERRORS) as fault:
                problem = problem or f"its map {topic.name} cannot be used: {fault}"
    if problem:
        raise InputError(path, problem)
    return None
