"""The section of what happened: how often each kind, and step by step."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from maurice_mcl.events import KINDS

from .choosing import OFTEN, Happening, counted, listed, said_steps
from .contents import Report
from .markup import Markup, joined, table, tag


def events(report: Report) -> Markup:
    """Give both tables; a sentence where nothing happened."""
    counts = counted(report.happened)
    if not counts:
        return tag("p", "Nothing happened that has a name.")
    numbers = (_count_row(kind, steps) for kind, steps in counts.items())
    counts_head = ("kind", "how often", "what it means", "at which steps")
    counts_table = table("How often each kind happened", counts_head, numbers, "stack")
    shown = listed(report.happened)
    if not shown:
        return counts_table
    pictured = {scene.step: scene.number for scene in report.scenes}
    several = len(report.runs) > 1
    head = ["step", "time", *(["run"] if several else []), "kind", "picture", "what"]
    rows = (_event_row(one, several, len(report.runs), pictured) for one in shown)
    words = f"Routine events and kinds with more than {OFTEN} events are only counted above."
    return joined(
        [counts_table, table("What happened, step by step", head, rows, "stack events"), tag("p", words)]
    )


def _count_row(kind: str, steps: Sequence[int]) -> Iterator[str]:
    yield kind
    yield "once" if len(steps) == 1 else f"{len(steps)} times"
    yield KINDS.get(kind, "")
    yield f"{'step' if len(set(steps)) == 1 else 'steps'} {said_steps(steps)}"


def _event_row(one: Happening, several: bool, runs: int, pictured: Mapping[int, int]) -> Iterator[str]:
    event = one.event
    yield str(event.step)
    yield f"{event.time_s:.1f} s"
    if several:
        yield "all runs" if len(one.labels) == runs else ", ".join(one.labels)
    yield event.kind
    shown = pictured.get(event.step)
    yield "" if shown is None else tag("a", f"picture {shown}", href=f"#picture-{shown}")
    yield event.text
