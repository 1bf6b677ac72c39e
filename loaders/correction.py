"""What is put right while a recording is read, and how it is typed."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

MOTIONS_ARE = ("poses", "steps")  # what numbers may hold that a format gives as motions


@dataclass(frozen=True, slots=True)
class Correction:
    """What is put right; the defaults change nothing. Each field is an option of reading."""

    odometry_scale: float = 1.0  # lengths of the odometry are multiplied by it: 0.001 for millimetres
    turn_scale: float = 1.0  # turns, or the headings of poses as they stand: -1 for clockwise
    turn_gain: float = 1.0  # true turn over measured turn; the way of poses is bent with it
    odometry_forward_rad: float = 0.0  # where the robot's forward points in the odometry's frame
    odometry_are: str | None = None  # one of MOTIONS_ARE, where motions are expected
    truth_scale: float = 1.0
    truth_turn_scale: float = 1.0
    camera_yaw_rad: float = 0.0  # where the camera looks; headings become the camera's
    picture_offset_s: float = 0.0  # added to the times
    odometry_offset_s: float = 0.0
    truth_offset_s: float = 0.0

    @property
    def typed(self) -> tuple[str, ...]:
        """Give what is not as usual as it is typed: "--turn-scale -1"."""
        usual = Correction()
        changed = [f.name for f in fields(self) if getattr(self, f.name) != getattr(usual, f.name)]
        return tuple(f"{option_name(name)} {option_value(name, getattr(self, name))}" for name in changed)


def option_name(field: str) -> str:
    """Give the option of a field: `camera_yaw_rad` is `--camera-yaw`."""
    return "--" + field.removesuffix("_rad").removesuffix("_s").removesuffix("_m").replace("_", "-")


def option_value(field: str, value: object) -> str:
    """Write a value as it is typed, angles in degrees."""
    if not isinstance(value, float):
        return str(value)
    return f"{round(math.degrees(value) if field.endswith('_rad') else value, 7):.15g}"
