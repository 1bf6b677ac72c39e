"""One clock for a session whose source may begin anew: times that do not fall."""

from __future__ import annotations

import math

from .fields import MOST_T_S, FieldError, up_to

APART_S = 2.0  # put between two beginnings: truth is not joined over more than 1 s
SET_BACK = 20  # records running that fall mean that the clock was set back


class LiveClock:
    """Moves the times of a source that begins anew behind those that it said before."""

    def __init__(self) -> None:
        self.shift_s = 0.0  # added to what the source says
        self.last_s = -math.inf  # the last time given
        self._anew = True
        self._falls = 0

    def begin_anew(self) -> None:
        """Hear that the next time may come from another clock."""
        self._anew = True

    def time(self, t_s: float) -> float:
        """Give the session's time for the source's. FieldError for one that falls, or is too large.

        A clock that goes on after a pause keeps its times. One that has begun anew, or that falls for 20
        records running, is moved to 2 s behind the last time.
        """
        if t_s + self.shift_s < self.last_s:
            self._falls += 1
            if not self._anew and self._falls < SET_BACK:
                found = f"found t {t_s:.15g} after t {self.last_s - self.shift_s:.15g}"
                raise FieldError(f"{found}, expected time not to fall")
            self.shift_s = self.last_s + APART_S - t_s
        if abs(t_s + self.shift_s) > MOST_T_S:
            raise FieldError(f"found t {t_s:.15g}, expected {up_to(MOST_T_S)}")
        self._anew, self._falls = False, 0
        self.last_s = t_s + self.shift_s
        return self.last_s
