"""Features by name: which channels, with which weights, and the measured scale of each channel's distance.

Fitted by log score on fitting drives (arena seed = seed = 1 to 8 in each of the tiers nominal, dim and hard),
as `maurice-replay library tune` does for any library; docs/results.md has the figures.
"""

from __future__ import annotations

from collections.abc import Mapping

# (channel, distance) -> the distance that costs one nat of log-likelihood
SCALES: Mapping[tuple[str, str], float] = {
    ("color", "hellinger"): 0.173,
    ("color", "l1"): 0.791,
    ("color", "l2"): 1.307,
    ("color", "chi2"): 0.401,
    ("color", "thesis"): 0.0198,
    ("color", "floor_only"): 0.584,
    ("color", "relevance_only"): 0.0220,
    ("edges", "hellinger"): 0.0751,
    ("edges", "l1"): 0.146,
    ("edges", "thesis"): 0.0236,
    ("smoothed", "hellinger"): 0.169,
    ("smoothed", "l1"): 0.779,
    ("smoothed", "thesis"): 0.0224,
    ("blurred", "hellinger"): 0.195,
    ("blurred", "l1"): 0.853,
    ("blurred", "thesis"): 0.00884,
    ("edge_color", "hellinger"): 0.0932,
    ("edge_color", "l1"): 0.142,
    ("edge_color", "thesis"): 0.0300,
    ("cumulative", "hellinger"): 0.267,
    ("cumulative", "l1"): 3.35,
    ("chromaticity", "hellinger"): 0.00300,
    ("chromaticity", "l1"): 0.000306,
    ("chromaticity", "thesis"): 0.00196,
    ("color_layout", "l1"): 0.00357,
    ("color_layout", "hellinger"): 0.00441,
    ("gain_color", "hellinger"): 0.133,
    ("gain_color", "l1"): 0.578,
    ("color_grid", "l1"): 0.000915,
    ("color_grid", "hellinger"): 0.00708,
    ("tiny", "l1"): 0.00624,
    ("tiny", "hellinger"): 0.00400,
    ("hog", "l1"): 0.00257,
    ("hog", "hellinger"): 0.00590,
    ("moments", "hellinger"): 0.159,
    ("moments", "l2"): 3.45,
    ("moments", "l1"): 2.88,
}

# name -> channel -> weight of its calibrated distance; a single channel needs no entry here
FEATURES: Mapping[str, Mapping[str, float]] = {
    "color": {"color": 1.0},
    "edges": {"edges": 1.0},
    "blended": {"color": 0.63, "edges": 0.57},  # the thesis's two
    "best": {"chromaticity": 0.54, "blurred": 0.28, "edges": 0.22, "tiny": 0.21},  # of all sets tried
}


def weights_of(feature: str) -> dict[str, float]:
    """Return channel -> weight of a feature: a key of `FEATURES`, or the name of any one channel."""
    return dict(FEATURES.get(feature, {feature: 1.0}))
