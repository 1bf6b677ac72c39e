"""From a saved run to a page: once through all updates for numbers, once more for the pictures."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path, PurePath
from typing import Any

import numpy as np
from markupsafe import Markup

from maurice_loaders.errors import InputError
from maurice_loaders.files.text import read_toml
from maurice_loaders.files.writing import expect_absent, write_whole
from maurice_loaders.runs.manifest import CONFIGURATION, Source, versions_now
from maurice_loaders.runs.store import SavedRun
from maurice_mcl.reasons.verdict import decisive_step
from maurice_mcl.scoring.events import KINDS
from maurice_mcl.values import Library, SessionInfo

from ..errors import SILENT, Listener, OptionError
from ..running.saved import Opened, open_saved
from ..running.saved_steps import Collected, Pictures, collect, restored_together
from ..style import RGB, RUN_COLORS, TRUTH, Scale, scale_for
from ..text.summary import paired_rows, score_rows, short_rows
from ..text.verdict import account, headline
from .charts import Chart, ChartLine, DrawnChart, Mark, page_of_template
from .lanes import DrawnLanes
from .map import DrawnMap, linked
from .shots import (
    MOST_LISTED,
    RULE,
    Photographer,
    PicturedStep,
    ReportedEvent,
    Shot,
    choose,
    events_of,
    listed,
    shots,
    step_ranges,
    steps_by_kind,
)

Facts = Iterator[tuple[str, str]]

SHORT_HASH = 16  # digits of a SHA-256 that are shown: enough to compare by eye
DIGEST = Markup('<code title="{}">{}...</code>')
MISSING = "not available"
PICTURE_LINK = Markup('<a href="#picture-{0}">picture {0}</a>')


def report(
    run: str | Path, to: str | Path = "report.html", *, force: bool = False, listener: Listener = SILENT
) -> Path:
    """Write one self-contained HTML page about a saved run, or about all runs of a comparison.

    The page needs no other file and no network: verdict, linked map and traces, scores, events with pictures,
    configuration. The same run makes the same page, byte for byte. Returns the file. Raises InputError when
    the run cannot be read or has no step, or when the file exists and `force` is not given.

        >>> import maurice_viz as mv
        >>> mv.report("my-run", to="report.html").name
        'report.html'
    """
    folder, file = Path(run), Path(to)
    if file.suffix.lower() not in (".html", ".htm"):
        raise OptionError(f"found {file.name!r}, expected a name that ends in .html")
    expect_absent(file, force=force)
    write_whole(file, page_of(open_saved(folder, listener), folder, listener).encode(), force=force)
    return file


NOT_RECORDED = "Another localizer's run, as recorded: the settings that it ran with are not in the recording."


def page_of(opened: Opened, folder: Path, listener: Listener = SILENT) -> str:
    """Return the page about an opened run. InputError if it has no step."""
    library, info, runs = opened.scene.library, opened.scene.info, opened.runs
    scale = scale_for(info.display_units, library.arena)
    pictures = Pictures(opened.session, listener.warning)
    collected = collect(opened.restored, pictures, scale, library.arena, listener)
    if not collected.steps:
        raise InputError(folder, "found a run without a step, so there is nothing to report; replay again")
    events = events_of(collected)
    pictured = choose(collected, events)
    estimates = dict(zip([track.label for track in collected.tracks], RUN_COLORS, strict=False))
    sees = "laser" if library.is_map else "camera" if opened.scene.has_pictures else ""
    photographer = Photographer(library.arena, scale, sees if opened.session is not None else "", estimates)
    again = restored_together(opened.restored, Pictures(opened.session))  # warned before
    shot = shots(photographer, again, [picture.step for picture in pictured])
    charts, unknown = _charts(scale, collected, _marks(pictured, events, len(runs)), library.is_map)
    results, units = collected.results, scale.units
    verdicts = {result.label: result.verdict for result in results}
    numbered = [(picture.step, picture.number) for picture in pictured]
    drawn_map = DrawnMap(library.arena, scale, collected.tracks, numbered, results[0].radii.lost_m)
    return page_of_template(
        "page.html",
        info=info,
        version=version("maurice-replay"),
        labels=[track.label for track in collected.tracks],
        headline=headline(verdicts, scale).replace("`", ""),
        account=[line.replace("`", "") for line in account(verdicts, scale)],
        scores=[(name, *cells) for name, cells in short_rows(results, units)],
        all_scores=[
            (name, *cells) for rows in (score_rows, paired_rows) for name, cells in rows(results, units)
        ],
        lanes=DrawnLanes(collected),
        map=drawn_map,
        linked=linked(drawn_map, charts, collected, scale, decisive_step(verdicts)),
        charts=charts,
        unknown=unknown,
        many=MOST_LISTED,
        counts=list(_counts(events)),
        events=list(_event_rows(listed(events), pictured, len(runs))),
        rule=RULE,
        disks=_disks(runs[0].manifest.has_truth, estimates),
        pictures=[_picture(picture, shot[picture.step], collected, scale) for picture in pictured],
        differing=_differing(runs),
        sees=sees,
        recorded=NOT_RECORDED if runs[0].manifest.recorded else "",
        configurations=[(run.folder / CONFIGURATION).read_text(encoding="utf-8").strip() for run in runs],
        session_facts=list(_session_facts(info, runs[0], collected, scale, library.is_map)),
        library_facts=list(_library_facts(library, runs, scale)),
        run_facts=list(_facts_of_runs(runs, scale)),
    )


def _disks(has_truth: bool, estimates: Mapping[str, RGB]) -> list[tuple[str, RGB]]:
    """Return name and color of each robot on the maps of steps."""
    truth = [("truth", TRUTH)] if has_truth else []
    if len(estimates) == 1:
        return [*truth, ("estimate", RUN_COLORS[0])]
    return truth + [(f"estimate of {label}", color) for label, color in estimates.items()]


def _charts(
    scale: Scale, collected: Collected, marks: Sequence[Mark], by_laser: bool
) -> tuple[list[DrawnChart], list[str]]:
    """Return a chart for each trace that is known, and the names of the others."""
    unit, per_m, per_rad = scale.units.name, scale.units.per_m, 180 / np.pi
    near = f"Weight within {scale.say(collected.results[0].radii.confidence_m)} of the estimate."
    fits = "the scan fits the map there" if by_laser else "pictures fit there and elsewhere"
    knows = f"That the estimate is right, by how well {fits}; needs no truth."
    explained = f"How well the cloud explained each {'scan' if by_laser else 'picture'}; higher is better."
    kinds = (
        (Chart("Position error", unit, "From estimate to truth."), "error_m", per_m),
        (Chart("Heading error", "deg", "Between estimate and truth."), "heading_error_rad", per_rad),
        (Chart("Spread", unit, "Standard deviation of the complete cloud."), "spread_m", per_m),
        (Chart("Confidence", "share", near, top=1.0), "confidence", 1.0),
        (Chart("Knows where it is", "probability", knows, top=1.0), "knows", 1.0),
        (
            Chart("Effective sample size", "share", "Of all particles.", top=1.0, is_told=False),
            "ess_share",
            1.0,
        ),
        (Chart("Evidence", "nats", explained, from_zero=False, is_told=False), "calibrated_evidence", 1.0),
    )
    drawn, unknown = list[DrawnChart](), list[str]()
    for chart, column, factor in kinds:
        lines = []
        for run, track in enumerate(collected.tracks):
            values = getattr(track.table, column) * factor
            values[~np.isfinite(values)] = np.nan
            lines.append(ChartLine(track.label, run, track.table.steps.astype(float), values))
        if all(np.isnan(line.y).all() for line in lines):
            unknown.append(chart.title.lower())
        else:
            drawn.append(DrawnChart(chart, lines, marks))
    return drawn, unknown


def _marks(pictured: Sequence[PicturedStep], events: Sequence[ReportedEvent], runs: int) -> list[Mark]:
    numbered = {picture.step for picture in pictured}
    marks = [Mark(picture.step, "; ".join(picture.reasons), picture.number) for picture in pictured]
    others = [item for item in listed(events) if item.event.step not in numbered]
    return marks + [Mark(item.event.step, item.reason(runs)) for item in others]


def _counts(events: Sequence[ReportedEvent]) -> Iterator[tuple[str, str, str, str]]:
    for kind, steps in steps_by_kind(events).items():
        word = "step" if len(set(steps)) == 1 else "steps"
        count = "once" if len(steps) == 1 else f"{len(steps)} times"
        yield kind, count, KINDS[kind].meaning, f"{word} {step_ranges(steps)}"


def _event_rows(
    shown: Sequence[ReportedEvent], pictured: Sequence[PicturedStep], runs: int
) -> Iterator[list[str]]:
    numbers = {picture.step: picture.number for picture in pictured}
    for item in shown:
        event = item.event
        labels = "all runs" if len(item.labels) == runs else ", ".join(item.labels)
        link = PICTURE_LINK.format(numbers[event.step]) if event.step in numbers else ""
        who = [labels] if runs > 1 else []
        yield [str(event.step), f"{event.time_s:.1f} s", *who, event.kind, link, event.text]


def _picture(picture: PicturedStep, shot: Shot, collected: Collected, scale: Scale) -> Mapping[str, Any]:
    """Return what the template shows of a step: numbers, camera image, for each run a map with text."""
    row = int(np.flatnonzero(collected.tracks[0].table.steps == picture.step)[0])
    maps = []
    for track in collected.tracks:
        error = float(track.table.error_m[row])
        off = f", error {scale.say(error)}" if np.isfinite(error) else ""
        pose = scale.say_pose(track.table.poses[row])
        text = f"{track.label}: estimate {pose}{off}, confidence {track.table.confidence[row]:.0%}"
        maps.append((shot.maps[track.label], text))
    time_s = float(collected.tracks[0].table.times_s[row])
    return {"number": picture.number, "step": picture.step, "reasons": picture.reasons, "time_s": time_s,
            "camera": shot.camera, "maps": maps}  # fmt: skip


# Facts of saved runs: what they were made from, with what, and their configurations.


def _session_facts(
    info: SessionInfo, run: SavedRun, collected: Collected, scale: Scale, by_laser: bool
) -> Facts:
    manifest, table = run.manifest, collected.tracks[0].table
    yield "session", manifest.name
    yield "log", _place(manifest.session)
    yield "SHA-256 of the log", _digest(manifest.session.sha256)
    yield "robot", info.robot
    what = "updates" if manifest.recorded else "scans" if by_laser else "pictures"
    yield what, f"{manifest.pictures} ({collected.steps} in this report)"
    if collected.picture_size is not None and what == "pictures":
        yield "picture size", "{} x {} px".format(*collected.picture_size)
    yield "duration", f"{table.times_s[-1]:.0f} s to the last step"
    yield "distance by odometry", scale.say(float(np.nansum(table.odometry_m)))
    known = table.known.sum()
    yield "truth", f"known at {known} of {collected.steps} steps" if known else "not known"


def _library_facts(library: Library, runs: Sequence[SavedRun], scale: Scale) -> Facts:
    """Yield name and value of what is known of the library, and the channels of it that the runs used."""
    manifest = runs[0].manifest
    if manifest.recorded:
        yield "map", " x ".join(scale.say(side) for side in library.arena.size_m)
        return
    yield "map" if library.is_map else "library", library.name if library.size else MISSING
    yield "made from", _place(manifest.library)
    yield "SHA-256", _digest(manifest.library.sha256)
    if library.size:
        places = np.unique(np.round(library.poses[:, :2], 3), axis=0)
        yield "references", f"{library.size} at {len(places)} places"
    yield "map", " x ".join(scale.say(side) for side in library.arena.size_m)
    yield "channels used", ", ".join(dict.fromkeys(name for run in runs for name in run.manifest.channels))


def _facts_of_runs(runs: Sequence[SavedRun], scale: Scale) -> Iterator[tuple[str, ...]]:
    """Yield name and value for each run of what makes it repeatable."""
    columns = [list(_run_facts(run, scale)) for run in runs]
    for row in zip(*columns, strict=True):
        yield row[0][0], *(value for _, value in row)


def _run_facts(run: SavedRun, scale: Scale) -> Facts:
    manifest = run.manifest
    state = {"writing": "interrupted", "complete": "complete"}.get(manifest.state, manifest.state)
    start = "unknown" if manifest.start is None else scale.say_pose(np.array(manifest.start))
    if manifest.recorded:
        yield "state", state
    else:
        yield from (("seed", str(manifest.seed)), ("initial pose", start), ("state", state))
        yield "channels", ", ".join(manifest.channels)
        yield "SHA-256 of the library content used", _digest(manifest.library_content)
        yield "SHA-256 of the configuration", _digest(manifest.configuration_sha256)
    for name in versions_now():
        yield name, str(manifest.versions.get(name, "-"))


def _place(source: Source) -> str:
    """Return a file's name with its folder; where that is on somebody's disk matters to nobody else."""
    return "/".join(PurePath(source.path).parts[-2:])


def _digest(digest: str) -> Markup:
    return DIGEST.format(digest, digest[:SHORT_HASH])


def _differing(runs: Sequence[SavedRun]) -> list[tuple[str, ...]]:
    """Return the keys whose values differ between runs, each with the value of each run."""
    settings = [read_toml(run.folder / CONFIGURATION, "the settings of a run") for run in runs]
    seeds = [{"seed": str(run.manifest.seed)} for run in runs]
    flat = [_flat(table) | seed for table, seed in zip(settings, seeds, strict=True)]
    keys = dict.fromkeys(key for table in flat for key in table)
    rows = [(key, *(table.get(key, "-") for table in flat)) for key in keys]
    return [row for row in rows if len(set(row[1:])) > 1]


def _flat(table: Mapping[str, Any], above: str = "") -> dict[str, str]:
    flat: dict[str, str] = {}
    for key, value in table.items():
        flat |= _flat(value, f"{above}{key}.") if isinstance(value, dict) else {f"{above}{key}": str(value)}
    return flat
