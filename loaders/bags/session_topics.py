"""What only our own MCAP files hold: the session's header, and motions to the last bit.

ROS has no message for a start, motion parameters or a survey, and a path of poses neither tells several
motions between two pictures apart nor keeps their last bits.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import ClassVar

import numpy as np

from maurice_mcl.session import SessionInfo

from ..errors import InputError
from ..io.fields import read_json
from ..recording import Motion
from ..session_log.header import header_from_json
from .messages import TEXT
from .readers import MESSAGE_ERRORS, OneTopic, Timed, time_s
from .source import BagSource, Message
from .topics import readable

HEADER = "/session/header"  # std_msgs/String: the first line of the native log
MOTIONS = "/session/motions"  # of the type VECTOR: forward_m, left_m, turn_rad
VECTOR = "geometry_msgs/Vector3Stamped"


def header_of(path: Path, bag: BagSource) -> SessionInfo | None:
    """Read the header that our own files carry; None in others' files. InputError for one that is damaged."""
    if not any(topic.name == HEADER for topic in readable(bag.topics, {TEXT})):
        return None
    for message in islice(bag.messages({HEADER}), 1):
        try:
            return header_from_json(read_json(str(message.decode().data)), path)[0]
        except MESSAGE_ERRORS as problem:
            raise InputError(path, f"{HEADER}: {problem}; is it damaged?") from None
    return None


def has_motions(bag: BagSource) -> bool:
    """Tell whether motions are there as such."""
    return any(topic.name == MOTIONS for topic in readable(bag.topics, {VECTOR}))


@dataclass(frozen=True, slots=True)
class MotionReader(OneTopic):
    """Makes motions of their topic's messages."""

    types: ClassVar[Collection[str]] = (VECTOR,)
    offset_s: float  # added to the times

    def records(self, message: Message, number: int, *, recorded: bool) -> Iterator[Timed]:
        """Give the motion of one message."""
        del number
        if self.hears(message):
            found = message.decode()
            vector = found.vector
            t_s = time_s(found, message.log_ns, recorded=recorded) + self.offset_s
            yield Motion(t_s, np.array([vector.x, vector.y, vector.z], np.float64))
