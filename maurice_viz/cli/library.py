"""`maurice-replay library build|show|check|tune`: reference pictures with poses, used by every run."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import groupby
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.box import SIMPLE_HEAD
from rich.table import Table

from maurice_datasets.trials.recognition import FIRST, PlaceRecognition
from maurice_mcl.library.advice import AMBIGUITY, GAP, HEADING, LibraryAdvice
from maurice_mcl.library.quality import Coverage, SelfSimilarity
from maurice_mcl.sensor.descriptors.registry import CHANNELS
from maurice_mcl.values import ChannelIndex, Library

from ..app.library import TuningResult, build_library
from ..app.library import tune as tune_channels
from ..app.library_check import LibraryCheck, check_library
from ..running.open import library_at
from ..running.output import by_suffix
from ..style import Scale, scale_for, units_named
from ..text.explanation import SHARES, say_times
from ..text.library import drive_score_of, say_drive, say_places, say_recognition, scores_of
from .shared import options as opt
from .shared.console import listening, note, print_json, results
from .shared.options import argument, option
from .shared.values import reading_of

MOST_HEADINGS = 16  # more than this are counted, not listed
MOST_PAIRS = 10  # listed; JSON has them all
MOST_PLACES = 5
DIRECTIONS = 8  # of a new place

LibraryArgument = Annotated[
    Path, argument("LIBRARY", "A library folder, a survey log, or a table of surveyed pictures.")
]


def build(
    survey: Annotated[
        Path,
        argument("SURVEY", "A survey log, or any recording of a drive with truth."),
    ],
    *,
    reading: opt.ReadingSet,
    output: Annotated[Path, opt.writes("LIBRARY", "The folder to write.")],
    every: Annotated[
        str | None,
        option(
            "--every",
            "Distance or turn between the entries of a drive: 0.4m,45deg. "
            "[default: this for a drive; every picture of a survey log]",
            metavar="LENGTH,ANGLE",
        ),
    ] = None,
    add: Annotated[
        list[Path] | None,
        option("--add", "Another survey of the same place, whose references are added.", metavar="SURVEY"),
    ] = None,
    yaw: Annotated[
        float,
        option(
            "--yaw",
            "Yaw of the robot's camera relative to the survey's, in degrees, counter-clockwise.",
            min=-180,
            max=180,
        ),
    ] = 0.0,
    map_file: opt.MapFile = None,
    map_unit: opt.MapUnit = "mm",
    landmarks: Annotated[
        bool, typer.Option("--landmarks", help="Also find landmarks, for --feature landmarks or all.")
    ] = False,
    force: opt.Force = False,
) -> None:
    """Measure every picture of a survey, or some of a drive, and write a self-contained library."""
    with listening() as listener:
        result = build_library(
            survey,
            output,
            every=every,
            add=add or (),
            yaw_rad=float(np.radians(yaw)),
            map_file=map_file,
            map_unit=map_unit,
            landmarks=landmarks,
            reading=reading.options(),
            force=force,
            listener=listener,
        )
    built, covered = result.library, result.coverage
    also = f", {sensor_facts(built)}" if built.sensors else ""
    results.say(f"{output}: {built.size} entries, channels {', '.join(built.index)}{also}")
    if covered is not None:
        scale = scale_for(built.display_units, built.arena)
        for line in (f"coverage: {_coverage(covered, scale)}", *_gap_lines(covered, scale)):
            results.say(line)


def sensor_facts(library: Library) -> str:
    """Return one line on the pose sensors of a library: "landmarks: 2,134 of 624 references"."""
    return "; ".join(
        f"{name}: {getattr(sensor, 'summary', 'there')}" for name, sensor in library.sensors.items()
    )


def show(path: LibraryArgument, json_output: opt.Json = False) -> None:
    """Show what a library holds: entries, places, headings, channels, map."""
    with listening() as listener:
        library = library_at(path, listener)
    if json_output:
        print_json(_facts(library))
    else:
        results.print(_facts_table(library))


def _facts(library: Library) -> dict[str, object]:
    """Return what a library holds as JSON, in meters."""
    width_m, depth_m = library.arena.size_m
    places = np.unique(np.round(library.poses[:, :2], 3), axis=0)
    headings = np.unique(np.round(np.rad2deg(library.poses[:, 2]) % 360, 1))
    return {
        "name": library.name,
        "entries": library.size,
        "places": len(places),
        "headings_deg": headings.tolist() if len(headings) <= MOST_HEADINGS else len(headings),
        "pictures_kept": sum(picture is not None for picture in library.pictures),
        "display_units": library.display_units,
        "width_m": width_m,
        "depth_m": depth_m,
        "walls": len(library.arena.walls),
        "obstacles": [region.name for region in library.arena.obstacles],
        "floors": list(dict.fromkeys(region.name for region in library.arena.floors)),
        "channels": {name: _channel_facts(name, index) for name, index in library.index.items()},
        "sensors": {name: getattr(sensor, "summary", "there") for name, sensor in library.sensors.items()},
    }


def _channel_facts(name: str, index: ChannelIndex) -> dict[str, float | str]:
    return {
        "unit": CHANNELS[name].unit if name in CHANNELS else "its own unit",
        "length": len(index.relevance),
        "noise_floor_peak": float(index.noise_floor.max()),
        "relevance_peak": float(index.relevance.max()),
    }


def _facts_table(library: Library) -> Table:
    facts, units = _facts(library), units_named(library.display_units)
    table = _table_of(library.name)
    headings = facts["headings_deg"]
    named = ", ".join(f"{heading:g}" for heading in headings) if isinstance(headings, list) else str(headings)
    width, depth = (length * units.per_m for length in library.arena.size_m)
    table.add_row(
        "entries", f"{library.size} pictures with a pose, {facts['pictures_kept']} of them kept here"
    )
    table.add_row("places", str(facts["places"]))
    table.add_row("headings (deg)", named)
    table.add_row(f"map ({units.name})", f"{width:.{units.digits}f} x {depth:.{units.digits}f}")
    table.add_row("walls", str(facts["walls"]))
    table.add_row("obstacles", ", ".join(region.name for region in library.arena.obstacles) or "none")
    table.add_row(
        "floors", ", ".join(dict.fromkeys(region.name for region in library.arena.floors)) or "none named"
    )
    for name, index in library.index.items():
        channel = _channel_facts(name, index)
        unit, whole = f" ({channel['unit']})", SHARES.get(str(channel["unit"]))
        noise, relevance = float(index.noise_floor.max()), float(index.relevance.max())
        if whole is not None:
            noise, relevance, unit = 100 * noise / whole, 100 * relevance / whole, "% of the pixels"
        table.add_row(
            f"channel {name}",
            f"{channel['length']} numbers, noise floor up to {noise:.3g}, "
            f"relevance up to {relevance:.3g}{unit}",
        )
    for name, sensor in library.sensors.items():
        table.add_row(f"sensor {name}", getattr(sensor, "summary", "there"))
    return table


def _table_of(name: str) -> Table:
    return Table(title=f"library {name}", title_justify="left", show_header=False)


def check(
    library: LibraryArgument,
    drive: Annotated[
        Path | None,
        option(
            "--drive",
            "A drive with truth whose pictures are looked up: how often they find the right reference.",
            metavar="SESSION",
        ),
    ] = None,
    feature: opt.Feature = None,
    files: Annotated[
        list[Path] | None,
        opt.writes(
            "OUT.png|OUT.csv|OUT.svg",
            "OUT.png: draw the map of expected ambiguity. OUT.csv: write the references to add, for "
            "`survey --poses`. OUT.svg: with --drive, precision over recall. Repeatable.",
        ),
    ] = None,
    reading: opt.ReadingPairs = None,
    force: opt.Force = False,
    json_output: opt.Json = False,
) -> None:
    """Compare a library's pictures with each other: look-alikes, ambiguity, gaps, and references to add."""
    outputs = by_suffix(files, (".png", ".csv", ".svg"))
    with listening() as listener:
        report = check_library(
            library,
            feature=feature or "blended",
            to=outputs.get(".png"),
            poses=outputs.get(".csv"),
            curves=outputs.get(".svg"),
            drive=drive,
            reading=reading_of(reading),
            force=force,
            listener=listener,
        )
    if json_output:
        print_json(report)
    else:
        _print(report)


def _print(report: LibraryCheck) -> None:
    weights = report.weights
    name, scale = report.library.name, scale_for(report.library.display_units, report.library.arena)
    table = _check_table(report.library, report.similarity, report.coverage, scale)
    table.add_row("places", scores_of(report.telling))
    if report.drive is not None:
        table.add_row("drive", drive_score_of(report.drive))
    table.add_row("to add", _to_add(report.advice, scale))
    results.print(table)
    lines = [*say_places(name, weights, report.telling), *_sparse_lines(report, scale)]
    if report.drive is not None and report.found is not None:
        if report.found.right:
            results.print(_found_table(report.found, scale))
        lines += [*say_drive(name, weights, report.drive), *say_recognition(report.found)]
    lines += _gap_lines(report.coverage, scale)
    lines += _pair_lines(report.library, report.similarity, scale)
    lines += (*_missing_lines(report.advice, scale), *_add_lines(report.advice, scale))
    for line in lines:
        results.say(line)


def _found_table(found: PlaceRecognition, scale: Scale) -> Table:
    within = f"within {scale.say(found.right_m)} and 30 deg of the true pose"
    of = f"{found.right} of {found.pictures} pictures, in {found.stretches} stretches of the drive"
    table = Table(title="a right reference is found", title_justify="left", caption_justify="left")
    table.box, table.padding, table.pad_edge = SIMPLE_HEAD, (0, 1, 0, 0), False
    table.caption = f"right is a reference {within}, or the nearest; {of} have one; in %, with 95 % intervals"
    recalls = (f"among {first}" if first > 1 else "first" for first in FIRST)
    for column in ("", *recalls, "area", "rank"):
        table.add_column(column, justify="right" if column else "left")
    for way in found.ways:
        figures = [value.text(100, 0) for value in (*way.recall.values(), way.area)]
        table.add_row(way.name, *figures, f"{way.median_rank:g}", style=None if way.is_used else "dim")
    others = [way.name for way in found.ways if not way.is_used]
    if others:
        table.caption += f"; not used: {', '.join(others)}"
    return table


def _coverage(covered: Coverage, scale: Scale) -> str:
    where = "free space" if covered.mapped else "between its poses (no wall is known)"
    return (
        f"{covered.covered:.0%} of {scale.say_area(covered.free_m2)} {where} has an entry within "
        f"{scale.say(covered.reach_m)}; {covered.directions:.0%} of 8 directions there have one"
    )


def _sparse_lines(report: LibraryCheck, scale: Scale) -> Iterator[str]:
    similarity, covered = report.similarity, report.coverage
    if report.wanted_m < similarity.spacing_m:
        places, area = len(similarity.places), scale.say_area(covered.free_m2)
        yield (
            f"sparse: {places} places {scale.say(similarity.spacing_m)} apart for {area}; at "
            f"{scale.say(report.wanted_m)} {covered.covered:.0%} of it has one, and `to add` is for that"
        )


def _gap_lines(covered: Coverage, scale: Scale) -> Iterator[str]:
    for gap in covered.gaps:
        where = f"{scale.say_area(gap.area_m2)} around {scale.say_point(gap.x_m, gap.y_m)}"
        yield f"gap: {where}, up to {scale.say(gap.to_entry_m)} from an entry"


def _pair_lines(library: Library, similarity: SelfSimilarity, scale: Scale) -> Iterator[str]:
    for entry in similarity.aliased[:MOST_PAIRS].tolist():
        pose, alias = (scale.say_pose(library.poses[k]) for k in (entry, similarity.alias[entry]))
        times, share = say_times(-similarity.margin[entry]), similarity.confusion[entry]
        away = f"{share:.0%} of the likelihood is far away"
        yield f"look-alike: {pose} is {times} times more like {alias} than like any neighbor; {away}"
    if len(similarity.aliased) > MOST_PAIRS:
        yield f"... and {len(similarity.aliased) - MOST_PAIRS} more look-alikes; --json lists all"


def _to_add(advice: LibraryAdvice, scale: Scale) -> str:
    if not advice.added:
        near, confused = "nothing: every heading has a reference near", len(advice.confusions)
        if confused:
            return f"{near}, and there is no free place beside the {confused} that are confused"
        return f"{near}, and no entry is confused"
    reasons = {GAP: "in gaps", HEADING: "for headings", AMBIGUITY: "between places that are confused"}
    counts = [f"{advice.count(why)} {where}" for why, where in reasons.items() if advice.count(why)]
    return f"{len(advice.added)} references: {', '.join(counts)}"


def _missing_lines(advice: LibraryAdvice, scale: Scale) -> Iterator[str]:
    for place in advice.missing[:MOST_PLACES]:
        degrees = ", ".join(f"{round(np.degrees(heading))}" for heading in place.headings_rad)
        yield f"headings: none near {scale.say_point(place.x_m, place.y_m)} looks {degrees} deg"
    if len(advice.missing) > MOST_PLACES:
        yield f"... and {len(advice.missing) - MOST_PLACES} more places that lack headings; --json lists all"


def _add_lines(advice: LibraryAdvice, scale: Scale) -> Iterator[str]:
    places = [
        (place, list(references))
        for place, references in groupby(advice.added, lambda added: (*added.pose[:2].tolist(), added.why))
    ]
    for (x_m, y_m, why), references in places[:MOST_PAIRS]:
        degrees = ", ".join(f"{round(np.degrees(reference.pose[2])) % 360}" for reference in references)
        looking = "in all 8 directions" if len(references) == DIRECTIONS else f"at {degrees} deg"
        yield f"add: {scale.say_point(x_m, y_m)}, looking {looking} ({why})"
    if len(places) > MOST_PAIRS:
        yield f"... and {len(places) - MOST_PAIRS} more places; -o OUT.csv writes every pose"


def _check_table(library: Library, similarity: SelfSimilarity, covered: Coverage, scale: Scale) -> Table:
    table, places = _table_of(library.name), similarity.at_places(similarity.ambiguity)
    spacing = f"neighbors of one heading are {scale.say(similarity.spacing_m)} apart"
    table.add_row("entries", f"{library.size} at {len(similarity.places)} places; {spacing}")
    table.add_row("view", f"a picture looks like its reference up to {scale.say(similarity.reach_m)} away")
    table.add_row("coverage", _coverage(covered, scale))
    retrieved = f"{similarity.retrieved_right:.0%} at a neighboring place, same heading"
    table.add_row("left out, found again", retrieved)
    share = len(similarity.aliased) / library.size
    table.add_row(
        "look-alikes",
        f"{len(similarity.aliased)} of {library.size} entries ({share:.0%}) are more like one far away than "
        "like any neighbor",
    )
    mean, often = float(similarity.confusion.mean()), len(similarity.confused)
    table.add_row(
        "confused",
        f"{mean:.0%} of a picture's likelihood is far away on average; {often} entries are like one far away "
        "and have over half there",
    )
    middle, most = float(np.median(places)), float(places.max())
    table.add_row("ambiguity", f"{middle:.1f} places fit a picture (median), {most:.1f} at worst")
    for place in np.argsort(-places, kind="stable")[:MOST_PLACES].tolist():
        x_m, y_m = similarity.places[place].tolist()
        table.add_row("", f"{scale.say_point(x_m, y_m)}: {places[place]:.1f} places fit")
    return table


def tune(
    library: LibraryArgument,
    sessions: Annotated[
        list[Path] | None,
        argument("DRIVE...", "Drives with truth to fit on. [default: the library's own pictures]"),
    ] = None,
    score: Annotated[
        list[Path] | None,
        option("--drive", "A drive with truth to score on; may be repeated.", metavar="DRIVE"),
    ] = None,
    channels: Annotated[
        str | None, option("--channels", "Channels to fit. [default: all of the library]", metavar="A,B,C")
    ] = None,
    output: Annotated[Path | None, opt.writes("TUNED.toml", "Write the result here.")] = None,
    *,
    reading: opt.ReadingSet,
    force: opt.Force = False,
    json_output: opt.Json = False,
) -> None:
    """Fit scales and weights of channels by log score, on drives with truth or on the library alone."""
    with listening() as listener:
        tuning = tune_channels(
            library,
            sessions=sessions or (),
            score=score or (),
            channels=None if channels is None else channels.split(","),
            to=output,
            reading=reading.options(),
            force=force,
            listener=listener,
        )
    if json_output:
        print_json(tuning)
        return
    results.print(_tuning_table(tuning))
    if output is None:
        typer.echo(tuning.to_toml(), nl=False)
    else:
        note(f"{output} written; now try: maurice-replay SESSION --config {output}")


LOG_SCORE = "log score: log of the probability that a picture alone gives its place, higher is better"


def _tuning_table(tuning: TuningResult) -> Table:
    table = Table(title=f"library {tuning.library}", title_justify="left", caption_justify="left")
    table.caption = f"{tuning.gain}\n{LOG_SCORE}"
    for name in ("", "distance", "scale", "weight", "log score, fitted"):
        table.add_column(name, justify="left" if name in ("", "distance") else "right")
    sets = [tuning.fitted]
    if tuning.scored is not None:
        table.add_column("log score, scored", justify="right")
        sets.append(tuning.scored)
    for channel, name in enumerate(tuning.tuned.channels):
        weight = tuning.weights.get(name)
        shown = "-" if weight is None else f"{weight:g}"
        cells = [name, tuning.distances[name], f"{tuning.scales[name]:g}", shown]
        table.add_row(*cells, *(f"{scores.alone[channel]:.3f}" for scores in sets))
    table.add_section()
    blends = {"tuned blend": "together", "default blend": "before", "knowing nothing": "blind"}
    for name, kind in blends.items():
        table.add_row(name, "", "", "", *(f"{getattr(scores, kind):.3f}" for scores in sets))
    table.add_row("pictures", "", "", "", *(str(scores.pictures) for scores in sets))
    return table
