"""How a run stands at its last update: localized, searching or lost, and since when."""

from __future__ import annotations

from dataclasses import dataclass, replace

from .episodes import KIDNAPPED, LOST, PROBABLY_LOST, SEARCHING, EpisodeFinder
from .lost_signal import KNOWS_ABOVE

LOCALIZED, PROBABLY_LOCALIZED = "localized", "probably localized"
WORDS = {PROBABLY_LOST: "probably lost", KIDNAPPED: "carried away, as the log says"}


@dataclass(frozen=True, slots=True)
class Standing:
    """How a run stands; probably so where no truth is known, and the lost signal tells.

    `state` is LOCALIZED, SEARCHING, KIDNAPPED (until it is known how the run takes that), LOST,
    PROBABLY_LOCALIZED or PROBABLY_LOST.
    """

    state: str
    since: int  # step from which on that is so
    places: int = 1  # that fit what is sensed about as well, the estimate's among them, without truth

    @property
    def is_lost(self) -> bool:
        """Whether it is lost, or probably so."""
        return self.state in (LOST, PROBABLY_LOST)

    @property
    def is_bad(self) -> bool:
        """Whether it is lost, or was carried away and has not found itself yet."""
        return self.is_lost or self.state == KIDNAPPED

    @property
    def words(self) -> str:
        """The state in words."""
        words = WORDS.get(self.state, self.state)
        return words if self.places < 2 else f"{words}, at one of {self.places} places that look alike"


@dataclass(slots=True)
class StandingFinder:
    """Follows how one run stands, by its episodes; by the lost signal while no truth was seen.

    >>> finder = StandingFinder()
    >>> finder.standing is None
    True
    """

    standing: Standing | None = None  # None: not known yet, or nothing can tell
    _has_truth: bool = False

    def see(self, step: int, finder: EpisodeFinder) -> None:
        """Process an update that the finder of episodes has seen."""
        if finder.score.correct is not None:
            self._has_truth = True
            self.standing = _by_truth(step, finder)
        elif not self._has_truth:
            self.standing = self._by_signal(step, finder)

    def _by_signal(self, step: int, finder: EpisodeFinder) -> Standing | None:
        signal, before = finder.signal, self.standing
        if signal.knows is None:
            return before
        places = signal.places
        if signal.probably_lost:
            return Standing(PROBABLY_LOST, finder.doubts[-1][0], places)
        state = PROBABLY_LOCALIZED if signal.knows > KNOWS_ABOVE else SEARCHING
        # it doubts no run that knew where it was before the alarm, unless another place is as likely
        kept = (state,) if places > 1 else (state, PROBABLY_LOCALIZED)
        if before is not None and before.state in kept:
            return replace(before, places=places)
        return Standing(state, step, places)


def _by_truth(step: int, finder: EpisodeFinder) -> Standing:
    if finder.open_episode is None:
        ended = finder.episodes[-1].localized if finder.episodes else finder.localized
        return Standing(LOCALIZED, step if ended is None else ended)
    episode = finder.open_episode
    declared = LOST if episode.lost is not None else episode.kind
    return Standing(SEARCHING if episode.kind == SEARCHING else declared, episode.onset)
