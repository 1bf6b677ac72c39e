"""`maurice-replay library check LIBRARY`: can its places be told apart, and where are its gaps."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.table import Table

from maurice_loaders.errors import InputError
from maurice_loaders.io.files import expect_absent, write_whole
from maurice_loaders.libraries.store import open_library
from maurice_mcl.library import Library
from maurice_mcl.library_quality.coverage import Coverage, coverage_of
from maurice_mcl.library_quality.self_similarity import CURVE, SelfSimilarity, self_similarity_of
from maurice_mcl.sensor.features import FEATURES
from maurice_mcl.sensor.model import SensorModel, SensorParameters
from maurice_mcl.sensor.references import nearest_reference

from ...style import Scale, scale_for
from ..console import note, progress, results
from ..errors import one_line_errors
from ..options import FeatureOption, ForceOption, JsonOption

MOST_PAIRS = 10  # listed; JSON has them all
MOST_PLACES = 5


def check_library_folder(
    path: Annotated[
        Path, typer.Argument(metavar="LIBRARY", help="A library folder or a survey log.", show_default=False)
    ],
    feature: FeatureOption = None,
    draw: Annotated[
        Path | None, typer.Option("--map", metavar="OUT.png", help="Draw the map of expected ambiguity.")
    ] = None,
    force: ForceOption = False,
    json_output: JsonOption = False,
) -> None:
    """Compare a library's pictures with each other: look-alikes, retrieval error, ambiguity, gaps."""
    if draw is not None and draw.suffix != ".png":
        raise typer.BadParameter(f"--map ends in .png, found {str(draw)!r}")
    with one_line_errors():
        if draw is not None:
            expect_absent(draw, force=force)
        with progress("library") as advance:
            library = open_library(path, progress=advance, warn=note)
        sensor = _sensor(path, library, feature or "blended")
        with progress("comparing") as advance:
            found = self_similarity_of(library, sensor, advance)
        if draw is not None:
            _draw(draw, library, found, force)
    covered = coverage_of(library, found.spacing_m)
    if json_output:
        results.print_json(json.dumps(_facts(library, found, covered)))
        return
    scale = scale_for(library.display_units, library.arena)
    results.print(_table(library, found, covered, scale))
    for line in [*_gap_lines(covered, scale), *_pair_lines(library, found, scale)]:
        results.print(line, soft_wrap=True)


def _sensor(path: Path, library: Library, feature: str) -> SensorModel:
    weights = FEATURES.get(feature, {feature: 1.0})
    missing = [name for name in weights if name not in library.index]
    if missing:
        found = f"the library {library.name!r} holds {', '.join(library.index) or 'no channel'}"
        raise InputError(path, f"{found}, and {missing[0]} is wanted; build the library again")
    return SensorModel(
        library, nearest_reference(library.poses, library.arena), SensorParameters(dict(weights))
    )


def coverage_lines(library: Library, reach_m: float) -> list[str]:
    """Say how much of free space a library covers, and where its gaps are."""
    scale = scale_for(library.display_units, library.arena)
    covered = coverage_of(library, reach_m)
    return [f"coverage: {_coverage(covered, scale)}", *_gap_lines(covered, scale)]


def _coverage(covered: Coverage, scale: Scale) -> str:
    where = "free space" if covered.mapped else "between its poses (no wall is known)"
    return (
        f"{covered.covered:.0%} of {scale.say_area(covered.free_m2)} {where} has an entry within "
        f"{scale.say(covered.reach_m)}; {covered.directions:.0%} of 8 directions are looked in there"
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
        yield f"look-alikes: {one} is more like {other} than like its neighbors, by {by:.2f} nats"
    if len(found.aliased) > MOST_PAIRS:
        yield f"... and {len(found.aliased) - MOST_PAIRS} more look-alikes; --json lists all"


def _table(library: Library, found: SelfSimilarity, covered: Coverage, scale: Scale) -> Table:
    table = Table(title=f"library {library.name}", title_justify="left", show_header=False)
    places = found.at_places(found.ambiguity)
    apart = scale.say(found.spacing_m)
    table.add_row(
        "entries",
        f"{library.size} at {len(found.places)} places; looking the same way every {apart}",
    )
    table.add_row("coverage", _coverage(covered, scale))
    table.add_row("left out, found again", f"{found.retrieved_right:.0%} at a neighboring place, same way")
    table.add_row("retrieval error", _error(found, scale))
    share = len(found.aliased) / library.size
    table.add_row("look-alikes", f"{len(found.aliased)} of {library.size} entries ({share:.0%})")
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
    """Write the self-similarity: how unlike the most similar picture of each range of distance is."""
    names = [f"to {scale.say(k * found.spacing_m)}" for k in CURVE] + ["beyond"]
    pairs = zip(names, found.similarity, strict=True)
    return ", ".join(f"{name}: {cost:.2f}" for name, cost in pairs if np.isfinite(cost)) + " nats"


def _facts(library: Library, found: SelfSimilarity, covered: Coverage) -> dict[str, object]:
    """Give everything as JSON, in metres and radians."""
    known, places = found.retrieved >= 0, found.at_places(found.ambiguity)
    return {
        "name": library.name,
        "entries": library.size,
        "places": len(found.places),
        "spacing_m": found.spacing_m,
        "covered_share": covered.covered,
        "directions_share": covered.directions,
        "gaps": [
            {"x_m": g.x_m, "y_m": g.y_m, "area_m2": g.area_m2, "to_entry_m": g.to_entry_m}
            for g in covered.gaps
        ],
        "retrieved_right_share": found.retrieved_right,
        "retrieval_error_median_m": float(np.median(found.error_m[known])) if known.any() else None,
        "retrieval_error_90_m": float(np.percentile(found.error_m[known], 90)) if known.any() else None,
        "look_alikes": [
            {"entry": entry, "like": int(found.alias[entry]), "nats": float(-found.margin[entry])}
            for entry in found.aliased.tolist()
        ],
        "ambiguity_median": float(np.median(places)),
        "ambiguity": [
            {"x_m": float(x), "y_m": float(y), "places": float(value)}
            for (x, y), value in zip(found.places, places, strict=True)
        ],
        "similarity_nats": [None if np.isnan(v) else float(v) for v in found.similarity],
    }


def _draw(path: Path, library: Library, found: SelfSimilarity, force: bool) -> None:
    from ...drawing.raster import png
    from ...plots.sheets import draw_ambiguity

    scale = scale_for(library.display_units, library.arena)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, png(draw_ambiguity(library, found, scale)), force=force)
