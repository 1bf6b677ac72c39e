"""What a scan says of a pose, in sentences and a table: how many beams agree, and how the others do not."""

from __future__ import annotations

from collections.abc import Mapping

from maurice_mcl.sensor.laser.beams import JUDGMENTS, BeamJudgment
from maurice_mcl.values import PoseProposal

from ...style import Scale

BEAMS = {
    "agrees": "agree with the map",
    "short": "end before a wall",
    "beyond": "end behind a wall",
    "unknown": "end where nobody has mapped",
    "miss": "hit nothing",
}
NATS = "Nats of beams, and bars: model `calibrated`; 0 for one that ends on a wall."
WITH_GAP = ("short", "beyond")


def scan_words(judgment: BeamJudgment, proposal: PoseProposal | None, scale: Scale) -> str:
    """Return what the scan says at the estimate, and what it proposed, if the filter asked for that."""
    words, lengths = judgment.words
    text = words.format(*map(scale.say, lengths))
    if proposal is None:
        return text
    count = len(proposal.weights)
    fits = "in one place" if count == 1 else f"in {count} places, the best with {proposal.weights.max():.0%}"
    return f"{text} The dots explained it badly, so that the whole map was searched: it fits {fits} (yellow)."


def say_beams(name: str, judgment: BeamJudgment, nats: float, scale: Scale) -> str:
    """Return how many beams are what at a pose: "At the truth 58 of 60 beams agree with the map, ..."."""
    parts = [
        f"{judgment.count(kind)} {words}{f' ({scale.say(judgment.gap_m(kind))})' if kind in WITH_GAP else ''}"
        for kind, words in list(BEAMS.items())[1:]
        if judgment.count(kind)
    ]
    first = f"{judgment.count('agrees')} of {len(judgment.judged)} beams agree with the map"
    return f"At the {name} {', '.join([first, *parts])}: {nats:z.1f} nats."


def scan_table(
    judged: Mapping[str, BeamJudgment], nats: Mapping[str, float], model: str, scale: Scale
) -> str:
    """Return a Markdown table of beams by what they are, and their nats, at each pose by its name."""
    rows = [["beams that", *(f"at the {name}" for name in judged)], ["---"] * (1 + len(judged))]
    rows += [
        [phrase, *(_cell(judgment, kind, scale) for judgment in judged.values())]
        for kind, phrase in BEAMS.items()
        if any(judgment.count(kind) for judgment in judged.values())
    ]
    rows.append([f"log-likelihood by `{model}`", *(f"{value:z.1f} nats" for value in nats.values())])
    table = "\n".join(f"| {' | '.join(row)} |" for row in rows)
    return f"{table}\n\n{NATS}"


def _cell(judgment: BeamJudgment, kind: str, scale: Scale) -> str:
    count = judgment.count(kind)
    gap = f", {scale.say(judgment.gap_m(kind))}" if count and kind in WITH_GAP else ""
    lost = float(judgment.nats[judgment.are(kind)].sum())
    return f"{count}{gap}{f', {lost:.1f} nats' if count and kind != 'miss' else ''}"


def scan_json(judged: Mapping[str, BeamJudgment], nats: Mapping[str, float]) -> dict[str, object]:
    """Return the same as JSON, lengths in meters."""
    return {
        name: {
            "nats": nats[name],
            "beams": {kind: judgment.count(kind) for kind in JUDGMENTS},
            "gap_m": {kind: judgment.gap_m(kind) for kind in WITH_GAP if judgment.count(kind)},
        }
        for name, judgment in judged.items()
    }
