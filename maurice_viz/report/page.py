"""The whole page, section by section."""

from __future__ import annotations

from importlib.metadata import version

import numpy as np

from ..look import Scale
from ..replaying import RunResult
from ..summary import to_table
from .contents import Report
from .facts import configuration, library_facts, run_facts, session_facts
from .markup import Markup, joined, table, tag
from .plan import Plan, draw_plan
from .section_events import events
from .section_pictures import pictures
from .section_traces import traces
from .style import css

SECTIONS = {
    "summary": "Summary",
    "map": "Map",
    "traces": "Traces",
    "events": "Events",
    "pictures": "Pictures of events",
    "configuration": "Configuration in force",
    "facts": "Session, library and versions",
}


def page(report: Report) -> str:
    """Give the page as HTML: it needs no network, no script and nothing beside it."""
    name, labels = report.info.name, report.labels
    title = f"{name}: {', '.join(labels)}"
    head = tag(
        "head",
        tag("meta", charset="utf-8"),
        tag("meta", name="viewport", content="width=device-width, initial-scale=1"),
        tag("title", title),
        tag("link", rel="icon", href="data:,"),
        tag("style", css()),
    )
    bodies = {
        "summary": _summary(report),
        "map": draw_plan(
            Plan(report.library.arena, report.scale),
            report.collected.tracks,
            [(scene.step, scene.number) for scene in report.scenes],
        ),
        "traces": traces(report),
        "events": events(report),
        "pictures": pictures(report),
        "configuration": configuration(report.runs),
        "facts": _facts(report),
    }
    body = tag(
        "body",
        tag("header", tag("h1", name), tag("p", _subtitle(report)), _notes(report), _links()),
        tag("main", (_section(key, bodies[key]) for key in SECTIONS)),
        tag("footer", tag("p", _footer())),
    )
    return "<!DOCTYPE html>\n" + tag("html", head, body, lang="en") + "\n"


def _subtitle(report: Report) -> str:
    what = "A run" if len(report.runs) == 1 else f"{len(report.runs)} runs"
    return f"{what} of vision-based Monte Carlo localization, step by step: {', '.join(report.labels)}"


def _footer() -> str:
    units = "Lengths in the session's own units, headings counter-clockwise from +x."
    return f"{units} Written by maurice-replay {version('maurice-replay')}."


def _notes(report: Report) -> Markup | None:
    """Say first what a reader must know of the data, such as that odometry was made up."""
    notes = "; ".join(report.info.notes)
    return tag("p", tag("strong", "Of the session: "), notes) if notes else None


def _links() -> Markup:
    links = (tag("li", tag("a", name, href=f"#{key}")) for key, name in SECTIONS.items())
    return tag("nav", tag("ul", links), aria_label="Contents")


def _section(key: str, body: str) -> Markup:
    return tag("section", tag("h2", SECTIONS[key]), body, id=key)


def _summary(report: Report) -> Markup:
    results = report.collected.results
    said = (tag("p", tag("strong", f"{result.label}: "), _said(result, report.scale)) for result in results)
    made = to_table(results, report.scale.units, report.info.name)
    names, *columns = [[str(cell) for cell in column.cells] for column in made.columns]
    head = [str(column.header) for column in made.columns]
    rows = zip(names, *columns, strict=True)
    return joined([*said, table("Figures of the whole run", head, rows, "figures")])


def _said(result: RunResult, scale: Scale) -> str:
    """Sum a run up in a sentence or two."""
    score = result.score
    way = f"{score.updates} updates over {scale.say(score.distance_m)}"
    if score.position_error_mean_m is None or score.heading_error_mean_rad is None:
        return f"{way}. The truth is not known, so nothing can be said about errors."
    angle = f"{np.degrees(score.heading_error_mean_rad):.1f} deg"
    mean = f"mean error {scale.say(score.position_error_mean_m)} and {angle}"
    when = score.localized_at_update
    found = "never localized" if when is None else f"localized from update {when}"
    lost = f"lost at update {score.lost_at_update}" if score.lost else "never lost"
    return f"{way}, {mean}; {found}, {lost}."


def _facts(report: Report) -> Markup:
    runs, scale = report.runs, report.scale
    columns = [list(run_facts(run, scale)) for run in runs]
    rows = ((row[0][0], *(value for _, value in row)) for row in zip(*columns, strict=True))
    return joined(
        [
            table("Session", ("", ""), session_facts(report.info, runs[0], report.collected, scale), "facts"),
            table("Library", ("", ""), library_facts(report.library, runs, scale), "facts"),
            table("Runs", ("", *report.labels), rows, "facts"),
        ]
    )
