"""Parts of a recorded drive with true poses: its second half, or stretches that begin anywhere in it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from maurice_loaders.errors import InputError
from maurice_mcl.values import F64, I64, KIDNAPPED, UNKNOWN, LaserScan, Moment, OccupancyMap, compose

LEAST_MAPPED = 0.5  # share of a scan's beams that end where the map is known, for a stretch to begin there
ORDER_SEED = 0  # of the places where stretches begin
CARRIED_M = 2.0  # a robot that is carried less far was not carried away
CARRIED_S = 1.0  # that carrying it takes


def mapped_share(occupancy: OccupancyMap, scan: LaserScan | None, pose: F64 | None) -> float:
    """Return the share of a scan's beams from a pose (3,) that end where the map is known; NaN: no scan."""
    if scan is None or pose is None or not scan.hits.any():
        return np.nan
    laser = compose(pose, scan.mount)
    angles = scan.angles_rad[scan.hits] - scan.mount[2] + laser[2]
    ends = laser[:2] + scan.ranges_m[scan.hits, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return float((occupancy.states_at(ends) != UNKNOWN).mean())


@dataclass(frozen=True, slots=True, eq=False)
class Stretches:
    """Stretches of the updates of one drive; all have true poses."""

    moments: tuple[Moment, ...]
    begins: I64  # (P,) numbers of the updates where one may begin, in the order of runs

    @classmethod
    def of(cls, moments: Iterable[Moment], occupancy: OccupancyMap | None) -> Stretches:
        """Order the places of a drive; on an occupancy map those where it knows what the laser sees."""
        known = tuple(moment for moment in moments if moment.truth is not None)
        shares = [
            1.0 if occupancy is None else mapped_share(occupancy, moment.frame.scan, moment.truth)
            for moment in known
        ]
        begins = np.flatnonzero(np.array(shares) >= LEAST_MAPPED)
        return cls(known, np.random.default_rng(ORDER_SEED).permutation(begins))

    def of_run(self, run: int, updates: int, kidnap_at: int | None) -> tuple[Moment, ...]:
        """Return the updates of run `run`, numbered from 1; 0 updates: all. InputError for a drive too short.

        From update `kidnap_at` on it is a stretch from elsewhere, as if the robot had been carried there.
        """
        if not updates:
            return _numbered(self.moments)
        parts = [updates] if kidnap_at is None else [kidnap_at - 1, updates - kidnap_at + 1]
        first = self._begin(run, max(parts), None)
        if kidnap_at is None:
            return _numbered(self.moments[first : first + updates])
        before = self.moments[first : first + parts[0]]
        second = self._begin(run + 1, max(parts), before[-1].truth)
        after = self.moments[second : second + parts[1]]
        carried = replace(after[0], events=(*after[0].events, KIDNAPPED))
        return _numbered([*before, carried, *after[1:]])

    def _begin(self, run: int, updates: int, away_from: F64 | None) -> int:
        """Return where a stretch begins: the next place that has enough updates, away from a pose (3,)."""
        begins = self.begins[self.begins + updates <= len(self.moments)]
        if not len(begins):
            raise InputError(None, f"found no {updates} updates in a row from where the map is known")
        begins = np.roll(begins, -run)
        if away_from is None:
            return int(begins[0])
        places = np.array([self.moments[begin].truth for begin in begins])[:, :2]
        far = np.hypot(*(places - away_from[:2]).T) > CARRIED_M
        return int(begins[far.argmax()])


def _numbered(moments: Sequence[Moment]) -> tuple[Moment, ...]:
    """Return updates numbered from 1 whose times do not go back; nothing moved before the first."""
    numbered, shift_s = list[Moment](), 0.0
    for step, moment in enumerate(moments, 1):
        frame = moment.frame
        if moment.kidnapped and numbered:
            shift_s = numbered[-1].frame.time_s + CARRIED_S - frame.time_s
        frame = replace(frame, step=step, time_s=frame.time_s + shift_s)
        if step == 1:
            frame = replace(frame, motions=frame.motions[:0])
        numbered.append(replace(moment, frame=frame))
    return tuple(numbered)
