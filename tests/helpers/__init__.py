"""What several tests share. Import it as `from helpers.step_records import made`.

- `bags`: small bags of every kind, by `rosbags` or byte by byte
- `commands`: the command in this process
- `filter_world`: a small two-room library, and a drive through it with its truth
- `foxglove_bridge`: a script that serves a drive as a Foxglove bridge
- `lost_runs`: updates of a run that is lost, for the rules of a diagnosis
- `live_peers`: peers that send a live session what a test scripts
- `rosbridge`: a robot behind rosbridge
- `small_session`: a small session and survey on disk
- `step_records`: step records of a few particles, made by hand
"""

from __future__ import annotations

import maurice_mcl  # noqa: F401  # before numpy, whose threads it bounds: each process of the tests has a core


def expect_facts(text: str, *facts: str) -> None:
    """Expect that a text holds facts, in this order; the words between them are free."""
    at = 0
    for fact in facts:
        place = text.find(fact, at)
        assert place >= 0, f"expected {fact!r} after {text[:at]!r}, found {text[at:]!r}"
        at = place + len(fact)
