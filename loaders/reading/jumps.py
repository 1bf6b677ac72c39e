"""Single jumps of odometry: a driver that began again, a counter that overflowed, a pose that was set."""

from __future__ import annotations

import numpy as np

from maurice_mcl.values.arrays import F64, I32
from maurice_mcl.values.geometry import motions_between, wrap_angle

from ..errors import ReadingNotes
from .options import JUMPING, Reading
from .recording import Motion, OdometryPose, Recording

FEWEST = 8  # records with a time between them
MOST_JUMPS, MOST_SHARE = 20, 0.1  # records, and share of those that move: more are no single jumps
TIMES_FASTER = 4.0  # than every other record
LEAST_M, LEAST_M_S = 0.3, 2.0
LEAST_RAD, LEAST_RAD_S = 0.5, 12.0


def jumps_in(t_s: F64, motions: F64) -> I32:
    """Return which motions (K, 3) at times (K,) are jumps, in order: far faster than every other one."""
    passed_s = np.diff(t_s, prepend=np.nan)
    if (passed_s > 0).sum() < FEWEST:
        return np.zeros(0, np.int32)
    usual_s = float(np.median(passed_s[passed_s > 0]))  # stamps may come in pairs, and hardly apart
    passed_s = np.fmax(passed_s, usual_s)
    ways_m, turns_rad = np.hypot(motions[:, 0], motions[:, 1]), np.abs(wrap_angle(motions[:, 2]))
    jumps = _apart(ways_m / passed_s, LEAST_M_S) & (ways_m > LEAST_M)
    jumps |= _apart(turns_rad / passed_s, LEAST_RAD_S) & (turns_rad > LEAST_RAD)
    return np.flatnonzero(jumps).astype(np.int32)


def _apart(speeds: F64, least: float) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Return which of some speeds (K,) are above `least`, and far above all others."""
    most = min(MOST_JUMPS, int(MOST_SHARE * (speeds > 0).sum()))
    top = np.sort(speeds)[::-1][: most + 1]
    drops = np.flatnonzero((top[:-1] > least) & (top[:-1] > TIMES_FASTER * top[1:]))
    return speeds >= (top[drops[-1]] if len(drops) else np.inf)


def jumps_of(recording: Recording, options: Reading) -> frozenset[int]:
    """Return which records of a recording's odometry jump; none unless the options say that it does."""
    if options.odometry_are != JUMPING:
        return frozenset()
    times, values, poses = list[float](), list[F64](), False
    for record in recording.records(ReadingNotes(keep_going=True)):
        if isinstance(record, Motion | OdometryPose):
            poses = isinstance(record, OdometryPose)
            times.append(record.t_s)
            values.append(record.pose if isinstance(record, OdometryPose) else record.motion)
    units = np.array([options.odometry_scale, options.odometry_scale, options.turn_scale])
    array = np.array(values, np.float64).reshape(-1, 3) * units
    return frozenset(jumps_in(np.array(times), motions_between(array) if poses else array).tolist())
