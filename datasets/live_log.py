"""A session log as lines with everything in them: what a live robot speaks."""

from __future__ import annotations

import base64
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from maurice_loaders.header import header_to_json
from maurice_loaders.pictures import encode_jpeg
from maurice_mcl.session import SessionInfo
from maurice_mcl.typing import F64, U8

Say = Callable[[float, bytes], None]  # takes a line and the time it belongs to, in s


def header_line(info: SessionInfo) -> bytes:
    """Give the first line of a session log; a relative survey path stays as it is."""
    return line_of(header_to_json(info, "session", Path()))


def line_of(value: dict[str, Any]) -> bytes:
    """Give one line of a log, with its end."""
    return (json.dumps(value, ensure_ascii=False, allow_nan=False) + "\n").encode()


class LiveLog:
    """Says each record of a session as a line, pictures inline; truth and events only if wanted."""

    def __init__(self, say: Say, *, truth: bool = True) -> None:
        self._say = say
        self._truth = truth

    def odometry(self, t_s: float, motion: F64, encoders_m: F64 | None = None) -> None:
        """Say a movement."""
        wheels = {} if encoders_m is None else {"encoders_m": [float(v) for v in encoders_m]}
        self._put(t_s, {"odometry": [float(v) for v in motion]} | wheels)

    def image(self, t_s: float, image_rgb: U8, *, camera: str | None = None) -> None:
        """Say a picture: JPEG in base64."""
        data = base64.b64encode(encode_jpeg(image_rgb)).decode("ascii")
        named = {} if camera is None else {"camera": camera}
        self._put(t_s, {"image": {"base64": data}} | named)

    def truth(self, t_s: float, pose: F64) -> None:
        """Say where the robot really is."""
        if self._truth:
            self._put(t_s, {"truth": [float(v) for v in pose]})

    def event(self, t_s: float, text: str) -> None:
        """Say what happens, which a robot that must not tell the truth would not know either."""
        if self._truth:
            self._put(t_s, {"event": text})

    def _put(self, t_s: float, record: dict[str, Any]) -> None:
        self._say(t_s, line_of({"t": float(t_s)} | record))
