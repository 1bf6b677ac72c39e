"""When a message counts as measured: at the time it carries, or where that is of no use, when recorded."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

AGREE_S = 1.0  # stamps of two sensors that stray further apart are on different clocks
Stamps = Sequence[tuple[int | None, int]]  # of a topic's first messages: the stamp or None, time recorded


def use_recorded(first: Mapping[str, Stamps]) -> str:
    """Tell why the times of recording have to be used; "" when the stamps of the messages serve."""
    lag_s = {}
    for topic, stamps in first.items():
        if not stamps:
            continue
        if any(stamp is None for stamp, _ in stamps):
            return f"messages of {topic} carry no time"
        if len(stamps) > 1 and len({stamp for stamp, _ in stamps}) == 1 < len({log for _, log in stamps}):
            return f"the times that messages of {topic} carry stand still"
        lag_s[topic] = ((stamps[0][0] or 0) - stamps[0][1]) / 1e9
    if not lag_s:
        return ""
    low, high = min(lag_s, key=lambda t: lag_s[t]), max(lag_s, key=lambda t: lag_s[t])
    if lag_s[high] - lag_s[low] > AGREE_S:
        return f"the clocks of {low} and {high} are {lag_s[high] - lag_s[low]:.3f} s apart"
    return ""


def recorded_as_measured(first: Mapping[str, Stamps]) -> bool:
    """Tell whether the times of recording are near those that messages carry, or used for all."""
    lags_s = [(stamp - log) / 1e9 for stamps in first.values() for stamp, log in stamps if stamp is not None]
    return bool(use_recorded(first)) or all(abs(lag_s) <= AGREE_S for lag_s in lags_s)
