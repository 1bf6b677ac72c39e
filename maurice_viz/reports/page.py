"""The page of a report, section by section."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version

import numpy as np

from maurice_loaders.runs.store import SavedRun
from maurice_mcl.analysis.events import KINDS
from maurice_mcl.arrays import F64
from maurice_mcl.filter.estimate import CONFIDENCE_M
from maurice_mcl.library import Library
from maurice_mcl.session import SessionInfo

from ..app.tracks import Collected
from ..playback import RunResult
from ..style import ESTIMATE, TRUTH, Scale
from ..text.summary import to_table
from .charts import DASHES, Chart, Line, Mark, draw_chart
from .choosing import OFTEN, RULE, Happening, Scene, counted, listed, reason, said_steps
from .facts import configuration, library_facts, run_facts, session_facts
from .map import Plan, draw_plan
from .markup import Markup, data_url, joined, table, tag
from .shots import Shot
from .style import css

# What a page is made of.


@dataclass(frozen=True, slots=True, eq=False)
class Report:
    """All that a page is made of."""

    runs: Sequence[SavedRun]
    info: SessionInfo
    library: Library
    scale: Scale
    collected: Collected
    happened: Sequence[Happening]
    scenes: Sequence[Scene]
    shots: Mapping[int, Shot]  # by step

    @property
    def labels(self) -> list[str]:
        """The runs' names, in order."""
        return [track.label for track in self.collected.tracks]


# The section of what happened: how often each kind, and step by step.


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


# The section of pictures: what the camera saw and where the particles were, at the steps chosen.


def pictures(report: Report) -> Markup:
    """Give an article for each step that has a picture, and the key before them."""
    truth = _disk(TRUTH, "truth") if report.runs[0].manifest.has_truth else ""
    weights = tag("span", "particles by weight: 1/8", tag("span", class_="ramp"), "8 times the average")
    key = joined([tag("p", RULE), tag("p", "On the maps: ", truth, _disk(ESTIMATE, "estimate"), weights)])
    return joined([key, *(_scene(report, scene) for scene in report.scenes)])


def _disk(color: tuple[int, int, int], text: str) -> Markup:
    disk = tag("span", class_="disk", style=f"background:rgb{color}")
    return tag("span", disk, text, class_="key")


def _scene(report: Report, scene: Scene) -> Markup:
    shot, track = report.shots.get(scene.step), report.collected.tracks[0]
    row = int(np.flatnonzero(track.column("step") == scene.step)[0])
    time_s = float(track.column("time_s")[row])
    heading = tag("h3", f"{scene.number}. Step {scene.step}, {time_s:.1f} s")
    reasons = tag("ul", (tag("li", text) for text in scene.reasons))
    figures = _figures(report, scene, shot, row) if shot is not None else ()
    return tag("article", heading, reasons, tag("div", figures, class_="shots"), class_="scene",
               id=f"picture-{scene.number}")  # fmt: skip


def _figures(report: Report, scene: Scene, shot: Shot, row: int) -> Iterable[Markup]:
    if shot.camera is None:
        camera = tag("div", "the picture is not at hand", class_="none")
    else:
        alt = f"What the camera saw at step {scene.step}"
        camera = tag("img", src=data_url(shot.camera, "image/jpeg"), alt=alt)
    yield tag("figure", camera, tag("figcaption", "camera"), class_="camera")
    yield tag("div", _maps(report, scene, shot, row), class_="maps")


def _maps(report: Report, scene: Scene, shot: Shot, row: int) -> Iterator[Markup]:
    for track in report.collected.tracks:
        error = track.column("position_error_m")[row]
        pose = report.scale.say_pose(track.path("estimate")[row])
        off = f", error {report.scale.say(float(error))}" if np.isfinite(error) else ""
        said = f"{track.label}: estimate {pose}{off}, confidence {track.column('confidence')[row]:.0%}"
        alt = f"Map of step {scene.step} with the particles. {said}"
        image = tag("img", src=data_url(shot.maps[track.label], "image/jpeg"), alt=alt)
        yield tag("figure", image, tag("figcaption", said))


# The section of charts over the steps: errors, spread, confidence, evidence.


def _charts(scale: Scale) -> Iterator[tuple[Chart, str, float]]:
    """Give each chart, the column of a track that it draws, and the factor to its unit."""
    unit, per_m, per_rad = scale.units.name, scale.units.per_m, 180 / np.pi
    near = f"Weight within {scale.say(CONFIDENCE_M)} of the estimate."
    explained = "How well the cloud explained each picture; higher is better."
    yield Chart("Position error", unit, "From estimate to truth."), "position_error_m", per_m
    yield Chart("Heading error", "deg", "Between estimate and truth."), "heading_error_rad", per_rad
    yield Chart("Spread", unit, "Standard deviation of the whole cloud."), "spread_m", per_m
    yield Chart("Confidence", "share", near, top=1.0), "confidence", 1.0
    yield Chart("Effective sample size", "share", "Of all particles.", top=1.0), "effective_share", 1.0
    yield Chart("Evidence", "nats", explained, from_zero=False), "calibrated_evidence", 1.0


def traces(report: Report) -> Markup:
    """Give a chart for each trace that is known, with a line for each run."""
    marks, tracks = _chart_marks(report), report.collected.tracks
    drawn, empty = list[Markup](), list[str]()
    for chart, column, factor in _charts(report.scale):
        lines = [
            Line(track.label, run, track.column("step"), finite(track.column(column) * factor))
            for run, track in enumerate(tracks)
        ]
        if any(np.isfinite(line.y).any() for line in lines):
            drawn.append(draw_chart(chart, lines, marks))
        else:
            empty.append(chart.title.lower())
    without = [tag("p", f"Not drawn, as it is not known: {', '.join(empty)}.")] if empty else []
    return joined([_legend(report), tag("div", drawn, class_="charts"), *without])


def finite(values: F64) -> F64:
    """Make what cannot be drawn a gap."""
    return np.asarray(np.where(np.isfinite(values), values, np.nan))


def _legend(report: Report) -> Markup:
    keys: list[str] = []
    if len(report.runs) > 1:
        for run, label in enumerate(report.labels):
            line = tag("line", x1=0, x2=26, y1=6, y2=6, class_="line", stroke_dasharray=DASHES[run])
            sample = tag("svg", line, viewBox="0 0 26 12", width=26, height=12, aria_hidden="true",
                         class_=f"run{run}")  # fmt: skip
            keys.append(tag("span", sample, f" {label}", class_="key"))
    words = "Numbered lines are the steps with a picture below; short ticks at the bottom are other events."
    return joined([tag("p", keys) if keys else "", tag("p", words)])


def _chart_marks(report: Report) -> list[Mark]:
    numbered = {scene.step: scene.number for scene in report.scenes}
    runs = len(report.runs)
    marks = [Mark(scene.step, "; ".join(scene.reasons), scene.number) for scene in report.scenes]
    others = [one for one in listed(report.happened) if one.event.step not in numbered]
    return marks + [Mark(one.event.step, reason(one, runs)) for one in others]


# The whole page, section by section.

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
