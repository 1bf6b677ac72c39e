"""Tasks and tiers: the thesis's three problems, at three levels of difficulty.

A tier sets what the world looks like (its light, how much hangs on its walls) and what happens during the
session (occluders, light that drifts). Numbers are invented; docs/arena.md has what they do to the filter.
"""

from __future__ import annotations

from dataclasses import dataclass

# How hard a session is: three tiers, nominal, dim and hard, as data.


@dataclass(frozen=True, slots=True)
class Tier:
    """One tier."""

    name: str
    light: float = 1.0  # all lamps and windows times this
    bare: float = 0.0  # share of textures and things on walls that are left out, 0 to 1
    occluded: float = 0.0  # share of the session's frames in which people stand in the view
    drift: float = 0.0  # slow drift of the light within the session: largest change of gain as a share
    tint: float = 0.0  # the same for the white balance of red and blue


TIERS: dict[str, Tier] = {
    tier.name: tier
    for tier in (
        Tier("nominal"),
        Tier("dim", light=0.3),
        Tier("hard", light=0.45, bare=0.6, occluded=0.3, drift=0.2, tint=0.1),
    )
}


# The thesis's three problems (its section 1) as tasks that a robot can be given.

UPDATES = 120  # of a drive, unless asked otherwise: more than 1000 in


@dataclass(frozen=True, slots=True)
class Task:
    """What is known at the start, and what is done to the robot."""

    name: str
    title: str
    start_known: bool  # the session's header says where the drive begins
    kidnapped: bool  # once the robot is carried elsewhere, and its odometry does not see it

    def kidnap_at(self, updates: int, asked: int | None) -> int | None:
        """Return the update after which the robot is carried away: halfway unless asked otherwise.

        ValueError where the task has no kidnapping, or where no update would come after it.
        """
        if not self.kidnapped:
            if asked is not None:
                raise ValueError(
                    f"found a kidnapping in the task {self.name}; leave --kidnap-at out or choose kidnapped"
                )
            return None
        if updates < 2:
            raise ValueError(f"found {updates} update, expected 2 or more: one comes after the kidnapping")
        at = updates // 2 if asked is None else asked
        if not 1 <= at < updates:
            raise ValueError(f"found kidnapping after update {at} of {updates}, expected 1 to {updates - 1}")
        return at


TASKS: dict[str, Task] = {
    task.name: task
    for task in (
        Task("tracking", "position tracking", start_known=True, kidnapped=False),
        Task("global", "global localization", start_known=False, kidnapped=False),
        Task("kidnapped", "kidnapped robot", start_known=True, kidnapped=True),
    )
}
