"""A radio beacon at a known point, which tells how far away it is: a sensor for Maurice Replay.

`python -m beacon SESSION.log OUT.log` writes a session log again, with readings of a simulated beacon.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np

import maurice_mcl as mcl

PLACE_M = (1.0, 0.5)  # of the beacon, in the map's frame
NOISE_M = 0.1  # standard deviation of a range
WORST_NATS = 8.0  # that a pose costs at most, so that one bad range does not rule the truth out
EXACT = mcl.PoseSpread()  # poses that stand for themselves alone


class Beacon:
    name = "beacon"  # a lower-case word: in `sensor.weights`, tables and panels

    def read(self, frame):
        """Return the newest range in a frame, in meters; None: the beacon was not heard."""
        return frame.readings.get("range")

    def log_likelihood(self, reading, poses, origin, spread=EXACT):
        """Return nats (N,) for poses (N, 3) relative to `origin`: at most 0, finite."""
        away = np.hypot(poses[:, 0] + origin[0] - PLACE_M[0], poses[:, 1] + origin[1] - PLACE_M[1])
        deviations = (away - reading) / np.hypot(NOISE_M, spread.position_m)
        return np.maximum(-0.5 * deviations**2, -WORST_NATS).astype(np.float32)

    def propose(self, reading):
        """Return None: a range alone cannot tell where the robot is."""

    def shown(self, reading, poses):
        """Return what people see of a range: a sentence, and the beacon on the map."""
        place = np.array([[PLACE_M]], np.float32)
        beacon = mcl.ShownMarks("beacon", "map", place)
        return mcl.Shown("the beacon is {} away", marks=(beacon,), lengths_m=(reading,))


def with_ranges(session: Path, target: Path, seed: int = 0) -> int:
    """Write a session log with true poses again, with a range before every picture; return their number."""
    rng, lines, count, true_pose = np.random.default_rng(seed), [], 0, None
    for line in session.read_text().splitlines():
        record = json.loads(line)
        true_pose = record.get("truth", true_pose)
        if "image" in record and true_pose is not None:
            away_m = np.hypot(true_pose[0] - PLACE_M[0], true_pose[1] - PLACE_M[1])
            reading = {"range": round(float(away_m + rng.normal(0, NOISE_M)), 3)}
            lines.append(json.dumps({"t": record["t"], "reading": reading}))
            count += 1
        lines.append(line)
    target.write_text("\n".join(lines) + "\n")
    return count


if __name__ == "__main__":
    print(with_ranges(Path(sys.argv[1]), Path(sys.argv[2])), "ranges written")
