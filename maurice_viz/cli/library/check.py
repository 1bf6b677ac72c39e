"""`maurice-replay library check LIBRARY`: which of its places look alike, and where are its gaps."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.table import Table

from maurice_mcl.library import Library
from maurice_mcl.library_quality import CURVE, Coverage, SelfSimilarity

from ...app.library import check_library
from ...style import Scale, scale_for
from ..console import listening, results
from ..errors import one_line_errors
from ..options import FeatureOption, ForceOption, JsonOption

MOST_PAIRS = 10  # listed; JSON has them all
MOST_PLACES = 5

LibraryArgument = Annotated[
    Path, typer.Argument(metavar="LIBRARY", help="A library folder or a survey log.", show_default=False)
]


def check(
    library: LibraryArgument,
    feature: FeatureOption = None,
    draw: Annotated[
        Path | None, typer.Option("--map", metavar="OUT.png", help="Draw the map of expected ambiguity.")
    ] = None,
    force: ForceOption = False,
    json_output: JsonOption = False,
) -> None:
    """Compare a library's pictures with each other: aliases, retrieval error, ambiguity, gaps."""
    with one_line_errors(), listening() as listener:
        found = check_library(library, feature=feature or "blended", to=draw, force=force, listener=listener)
    if json_output:
        results.print_json(json.dumps(found.to_json()))
        return
    scale = scale_for(found.library.display_units, found.library.arena)
    results.print(_table(found.library, found.similarity, found.coverage, scale))
    for line in [
        *_gap_lines(found.coverage, scale),
        *_pair_lines(found.library, found.similarity, scale),
    ]:
        results.print(line, soft_wrap=True)


def coverage_lines(covered: Coverage, scale: Scale) -> list[str]:
    """Describe how much of free space a library covers, and where its gaps are."""
    return [f"coverage: {_coverage(covered, scale)}", *_gap_lines(covered, scale)]


def _coverage(covered: Coverage, scale: Scale) -> str:
    where = "free space" if covered.mapped else "between its poses (no wall is known)"
    return (
        f"{covered.covered:.0%} of {scale.say_area(covered.free_m2)} {where} has an entry within "
        f"{scale.say(covered.reach_m)}; {covered.directions:.0%} of 8 directions there have one"
    )


def _gap_lines(covered: Coverage, scale: Scale) -> Iterator[str]:
    for gap in covered.gaps:
        x, y = scale.say(gap.x_m), scale.say(gap.y_m)
        where = f"{scale.say_area(gap.area_m2)} around ({x}, {y})"
        yield f"gap: {where}, up to {scale.say(gap.to_entry_m)} from an entry"


def _pair_lines(library: Library, found: SelfSimilarity, scale: Scale) -> Iterator[str]:
    for entry in found.aliased[:MOST_PAIRS].tolist():
        one, other = (scale.say_pose(library.poses[k]) for k in (entry, found.alias[entry]))
        by = -found.margin[entry]
        yield f"alias: {one} is more like {other} than like its neighbors, by {by:.2f} nats"
    if len(found.aliased) > MOST_PAIRS:
        yield f"... and {len(found.aliased) - MOST_PAIRS} more aliases; --json lists all"


def _table(library: Library, found: SelfSimilarity, covered: Coverage, scale: Scale) -> Table:
    table = Table(title=f"library {library.name}", title_justify="left", show_header=False)
    places = found.at_places(found.ambiguity)
    apart = scale.say(found.spacing_m)
    table.add_row(
        "entries",
        f"{library.size} at {len(found.places)} places; neighbors of one heading are {apart} apart",
    )
    table.add_row("coverage", _coverage(covered, scale))
    table.add_row(
        "left out, found again", f"{found.retrieved_right:.0%} at a neighboring place, same heading"
    )
    table.add_row("retrieval error", _error(found, scale))
    share = len(found.aliased) / library.size
    table.add_row("aliases", f"{len(found.aliased)} of {library.size} entries ({share:.0%})")
    middle, most = float(np.median(places)), float(places.max())
    table.add_row("ambiguity", f"{middle:.1f} places fit as well (median), {most:.1f} at worst")
    for place in np.argsort(-places, kind="stable")[:MOST_PLACES].tolist():
        x, y = (scale.say(float(v)) for v in found.places[place])
        table.add_row("", f"({x}, {y}): {places[place]:.1f} places fit")
    table.add_row("lowest cost by distance", _curve(found, scale))
    return table


def _error(found: SelfSimilarity, scale: Scale) -> str:
    known = found.retrieved >= 0
    if not known.any():
        return "- (one place only)"
    middle, high = np.percentile(found.error_m[known], [50, 90]).tolist()
    turned = float(np.degrees(np.median(found.error_rad[known])))
    return f"{scale.say(middle)} median, {scale.say(high)} at 90 %, heading {turned:.0f} deg median"


def _curve(found: SelfSimilarity, scale: Scale) -> str:
    """Return the self-similarity: the lowest cost in each range of distance."""
    names = [f"to {scale.say(k * found.spacing_m)}" for k in CURVE] + ["beyond"]
    pairs = zip(names, found.similarity, strict=True)
    return ", ".join(f"{name}: {cost:.2f}" for name, cost in pairs if np.isfinite(cost)) + " nats"
