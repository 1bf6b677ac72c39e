"""Roughening: a little noise on copies, so that they differ (Gordon, Salmond and Smith 1993)."""

from __future__ import annotations

import numpy as np

from .belief import Belief
from .geometry import circular_mean, wrap
from .typing import F32


def roughen(belief: Belief, share: float, normals: F32) -> Belief:
    """Add normal noise of sd share * E * N^(-1/3), E the extent of the cloud in each of x, y and heading.

    Gordon, Salmond and Smith tune with share 0.2; `normals` is (N, 3). Not exact: it widens the belief.
    """
    if share <= 0 or belief.size == 0:
        return belief
    extent = np.ptp(belief.poses, axis=0)
    middle = circular_mean(belief.poses[:, 2], belief.weights)[0]
    extent[2] = np.ptp(wrap(belief.poses[:, 2] - np.float32(middle)))
    sd = np.asarray(share * extent * belief.size ** (-1 / 3), np.float32)
    poses = belief.poses + normals * sd
    poses[:, 2] = wrap(poses[:, 2])
    return Belief(np.asarray(poses, np.float32), belief.log_weights, belief.origin)
