"""What a user is told of planted drives, to the word: the texts beside this file.

`make golden` writes them anew; the diff shows what changed, and the commit says why. Of numbers with a
decimal point the last digit may be one off, as on another machine.
"""

from __future__ import annotations

import html
import json
import re
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from rerun.chunk import RrdReader

import maurice_viz as mv
from helpers.commands import run
from helpers.planted_drives import CAMERA, LASER, Drive, write_camera, write_laser, write_survey
from helpers.session_breaking import BREAKS, broken

TEXTS = Path(__file__).parent / "texts"
NUMBER = re.compile(r"-?\d+\.\d+(?:e[+-]\d+)?")
VARYING = ("took_s", "best_entries")  # times; of equals any
CHAOTIC = ("view covered",)  # the second opinion has nothing to hold on to: what it knows hangs on a last bit
DRIVES = [("camera", name) for name in CAMERA] + [("laser", name) for name in LASER]


def expect_golden(name: str, text: str, remake: bool) -> None:
    file = TEXTS / f"{name.replace(' ', '-')}.txt"
    if remake:
        file.write_text(text, encoding="utf-8")
    kept = file.read_text(encoding="utf-8")
    if NUMBER.sub("#", kept) != NUMBER.sub("#", text):
        assert text == kept
    pairs = zip(NUMBER.findall(text), NUMBER.findall(kept), strict=True)
    assert [pair for pair in pairs if not _alike(*pair)] == []


def _alike(one: str, other: str) -> bool:
    """Return whether two numbers as printed differ by one in the last place at most."""
    places = [
        len(text.partition("e")[0].partition(".")[2]) - int(text.partition("e")[2] or 0)
        for text in (one, other)
    ]
    return abs(float(one) - float(other)) <= max(1.01 * 10.0 ** -min(places), 1e-9)


@pytest.fixture
def remake(request: pytest.FixtureRequest) -> bool:
    return bool(request.config.getoption("--remake"))


def rounded(value: Any) -> Any:
    """Round numbers to three digits, and to four places."""
    if isinstance(value, float):
        return round(float(f"{value:.3g}"), 4)
    if isinstance(value, dict):
        return {key: rounded(inner) for key, inner in value.items()}
    return [rounded(inner) for inner in value] if isinstance(value, (list, tuple)) else value


def lines(value: Any, key: str = "") -> Iterator[str]:
    """Write JSON with a line for each value, or object of values, after where it stands."""
    inner = list(
        value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    )
    if any(isinstance(one, (dict, list)) for _, one in inner) or (inner and not key):
        for name, one in sorted(inner):
            yield from lines(one, f"{key}.{name}".removeprefix("."))
    else:
        yield f"{key}: {json.dumps(rounded(value), sort_keys=True, ensure_ascii=False)}"


@dataclass(frozen=True, eq=False)
class Made:
    """A drive that was replayed and saved."""

    folder: Path
    scores: mv.RunScores

    @property
    def run(self) -> Path:
        return self.folder / "run"

    @property
    def figures(self) -> dict[str, Any]:
        """The JSON of its run, without its speed, and without what `diagnose` says."""
        (run,) = self.scores.to_json()["runs"]
        for failure in run["verdict"]["failures"]:
            del failure["episode"], failure["text"]
        return {key: value for key, value in run.items() if key != "steps_per_s"}

    def plain(self, text: str) -> str:
        return text.replace(str(self.folder), "HERE")


def asked(sensor: str, drive: Drive) -> mv.Filter:
    return mv.Filter("thesis" if sensor == "camera" else "amcl", **drive.filter)


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the library of the room, measured once for all drives with nothing else in their pictures."""
    folder = tmp_path_factory.mktemp("library")
    mv.build_library(write_survey(folder, Drive()), folder / "library")
    return folder / "library"


@pytest.fixture(scope="module")
def driven(tmp_path_factory: pytest.TempPathFactory, library: Path) -> Any:
    """Return a function that writes a drive of a sensor, with or without truth: its log and its library."""

    def write(sensor: str, name: str, *, truth: bool = True) -> tuple[Drive, Path, Path]:
        folder = tmp_path_factory.mktemp("golden")
        drive = (CAMERA if sensor == "camera" else LASER)[name]
        if sensor == "laser":
            return drive, *write_laser(folder, drive, truth=truth)
        own = None if drive.has_usual_library else write_survey(folder, drive)
        return drive, write_camera(folder, drive, own or library, truth=truth), own or library

    return write


@pytest.fixture(scope="module")
def made(driven: Any) -> Any:
    """Return a function from a sensor and the name of a drive to its saved run: each is made once."""

    @lru_cache(None)
    def make(sensor: str, name: str) -> Made:
        drive, log, places = driven(sensor, name)
        scores = mv.replay(log, places, asked(sensor, drive), save_run=log.parent / "run")
        return Made(log.parent, scores)

    return make


@lru_cache(None)
def page_of(made: Made, *sections: str) -> str:
    """Return what sections of a report say; of a lane's bars also where they lie, and their color."""
    page = mv.report(made.run, made.folder / "report.html", force=True).read_text(encoding="utf-8")
    found = (re.search(f'<section id="{name}".*?</section>', page, re.DOTALL) for name in sections)
    text = "".join(section[0] for section in found if section)
    text = re.sub(
        r'</title><rect x="([\d.]+)".*?width="([\d.]+)".*?fill="(.*?)"[^>]*>', r" at \1, \2 wide, \3", text
    )
    text = re.sub(r"\s*</t[dh]>\s*<t[dh]\b[^>]*>\s*", " | ", re.sub(r"</?a\b[^>]*>", "", text))
    text = re.sub(r"(?:\s*<[^>]*>\s*)+", "\n", text)
    return re.sub(r"(filter steps per second \|).*", r"\1", html.unescape(text)).strip()


@pytest.mark.parametrize(("sensor", "name"), DRIVES)
def test_a_drive_with_truth_and_without(sensor, name, made, driven, remake):
    one = made(sensor, name)
    figures = {key: value for key, value in one.figures.items() if name not in CHAOTIC or "knows" not in key}
    step = one.scores.runs[0].verdict.decisive
    events = mv.events(one.run).to_json()["runs"][0]["events"]
    drive, log, places = driven(sensor, name, truth=False)
    blind = mv.diagnose(log, places, asked(sensor, drive))
    parts = {
        "diagnose": mv.diagnose(one.run).text,
        "scores": "\n".join(lines(figures)),
        "events": "\n".join(f"{e['step']}-{e['last']} {e['kind']}: {e['text']}" for e in events),
        "explain": mv.explain(one.run, step).text,
        "report": page_of(one, "summary").partition("\nAll scores")[0],
        "without truth": f"{blind.text}\n{blind.runs[0].to_json()['verdict']}",
    }
    text = "\n".join(f"== {title}\n\n{part}\n" for title, part in parts.items())
    expect_golden(f"{sensor}-{name}", one.plain(text), remake)


def _of(key: str, how: str, times: float = 1.0) -> Callable[[dict[str, Any]], str]:
    """Return how a figure of the JSON, by its path, is written; a dash for one that does not apply."""

    def written(figures: dict[str, Any]) -> str:
        value: Any = figures
        for part in key.split("."):
            value = None if value is None else value[part]
        return "-" if value is None else f"{value * times:{how}}"

    return written


DEGREES = 180 / np.pi
ROWS = {  # of a report's tables, and what they say of the JSON
    "error, mean (m)": _of("error_mean_m", ".2f"),
    "heading error, mean (deg)": _of("heading_error_mean_rad", ".1f", DEGREES),
    "steps": _of("updates", "d", 1),
    "distance (m)": _of("distance_m", ".2f"),
    "position error, mean (m)": _of("error_mean_m", ".2f"),
    "position error, median (m)": _of("error_median_m", ".2f"),
    "position error, final (m)": _of("error_final_m", ".2f"),
    "without the camera, mean (m)": _of("odometry_alone.error_mean_m", ".2f"),
    "localized share": _of("localized_share", ".0%"),
    "wrong and confident": _of("wrong_confident_share", ".0%"),
    "knows where it is, without truth": _of("knows_where_it_is.share", ".0%"),
}


@pytest.mark.parametrize(("sensor", "name"), DRIVES)
def test_every_figure_that_is_told_twice_is_one(sensor, name, made):
    one, (run,) = made(sensor, name), made(sensor, name).scores.to_json()["runs"]
    rows = re.findall(r"^([^|\n]+) \| ([^|\n]+)$", page_of(one, "summary"), re.MULTILINE)
    assert {row for row, _ in rows} >= ROWS.keys() - {"without the camera, mean (m)"}
    assert [(row, cell) for row, cell in rows if row in ROWS and cell != ROWS[row](run)] == []
    saved, steps = mv.results(one.run).row(0, named=True), mv.traces(one.run)
    same = [key for key, value in run.items() if isinstance(value, (int, float)) and key != "steps_per_s"]
    assert {key: saved[key] for key in same} == {key: run[key] for key in same}
    assert steps["error_m"][3:].mean() == pytest.approx(run["error_mean_m"])
    assert steps["heading_error_rad"][3:].mean() == pytest.approx(run["heading_error_mean_rad"])
    assert steps["error_m"][-1] == pytest.approx(run["verdict"]["error_end_m"])
    told = {kind: [] for kind in ("lost", "failure", "localized")}
    for event in mv.events(one.run).to_json()["runs"][0]["events"]:
        told.get(event["kind"], []).append(event["step"])
    assert told["lost"][:1] == ([] if run["lost_at_step"] is None else [run["lost_at_step"]])
    assert told["failure"] == [failure["first"] for failure in run["verdict"]["failures"]]
    lanes = re.findall(r"steps? (\d+)(?: to \d+)?: lost", page_of(one, "summary"))
    lost = [
        e["lost"] for e in run["verdict"]["episodes"] if e["lost"] is not None and e["kind"] != "searching"
    ]
    assert [int(step) for step in lanes[: len(lost)]] == lost


EXAMINED = ("checks", "findings", "not_asked", "odometry_advice", "options", "said")


def test_broken_recordings_are_examined(driven, tmp_path, remake):
    _, log, places = driven("camera", "healthy")
    parts = []
    for name, (_, how) in {"healthy": ("", None), **BREAKS}.items():
        path = broken(log, tmp_path / "broken.log", how)
        found = json.loads(run("doctor", path, "--library", places, "--json", expect=None).stdout)
        parts.append(f"== {name}\n\n" + "\n".join(lines({key: found[key] for key in EXAMINED})) + "\n")
    expect_golden("doctor", "\n".join(parts).replace(str(tmp_path), "HERE"), remake)


# The saved table, and recordings.


def table_of(run: Path) -> str:
    """Return what each column of the tables of a saved run holds."""
    texts = []
    for name in ("steps", "particles", "renewed"):
        frame = pl.read_parquet(run / name / "*.parquet")
        texts.append(f"{name}: {frame.height} rows")
        texts += [
            f"  {column.name} {column.dtype}: {digest(column)}"
            for column in frame
            if column.name not in VARYING
        ]
    return "\n".join(texts)


def digest(column: pl.Series) -> str:
    """Return what a column holds in a few numbers: its nulls, its mean and the mean of its values' sizes."""
    nulls = f"{column.null_count()} null, " if column.null_count() else ""
    while isinstance(column.dtype, (pl.List, pl.Array)):
        column = column.explode()
    if not (column.dtype.is_numeric() or column.dtype == pl.Boolean):
        words = Counter(column.drop_nulls().to_list())
        return nulls + (str(dict(sorted(words.items()))) if len(words) < 5 else f"{len(words)} different")
    return nulls + means(column.drop_nulls().cast(pl.Float64).to_numpy())


def means(values: np.ndarray[Any, np.dtype[np.float64]]) -> str:
    """Return the mean of the finite ones of some numbers, as exact as three digits of their mean size."""
    finite = values[np.isfinite(values)]
    if not len(finite):
        return f"{len(values)} values, none finite"
    size = float(np.abs(finite).mean())
    places = 2 - int(np.floor(np.log10(size))) if size > 0 else 2
    count = f"{len(values)} values" if len(values) < 1000 else "values"  # of many some hang on a last bit
    return f"{count}, mean {finite.mean():z.{max(places, 1)}f}, of sizes {size:.3g}"


NOT_TOLD = ("radii", "draw_order", "show_labels", "media_type", "widths", "marker_sizes", "opacity", "blob")


def recording_of(file: Path) -> str:
    """Return what each entity of a recording holds: rows by timeline, colors, states, means of numbers."""
    rows: dict[str, Counter[str]] = defaultdict(Counter)
    held: dict[str, dict[str, list[Any]]] = defaultdict(lambda: defaultdict(list))
    for chunk in RrdReader(file).stream():
        batch, entity = chunk.to_record_batch(), str(chunk.entity_path)
        timelines = [name for name in ("phase", "session", "step") if name in batch.schema.names]
        rows[entity][" ".join(timelines) or "static"] += batch.num_rows
        for name in batch.schema.names:
            kind, _, part = name.partition(":")
            if part and part not in NOT_TOLD and kind != "RecordingInfo" and "/inside/" not in entity:
                values = batch.column(name).to_pylist()
                if part == "state":  # with the step from which on it is so
                    steps = batch.column("step").to_pylist() if "step" in batch.schema.names else values
                    values = [[f"{step}: {row[0]}"] for step, row in zip(steps, values, strict=True) if row]
                held[entity][part] += [value for row in values for value in row or ()]
    drawn = (entity for entity in sorted(rows) if "separators" not in entity)
    return "\n".join("; ".join([entity, *_counted(rows[entity]), *_told(held[entity])]) for entity in drawn)


def _counted(rows: Counter[str]) -> Iterator[str]:
    yield from (f"{timelines} {count}" for timelines, count in sorted(rows.items()))


def _told(parts: dict[str, list[Any]]) -> Iterator[str]:
    for part, values in sorted(parts.items()):
        if part == "state":
            yield f"state {', '.join(sorted(values, key=_step))}"
        elif part in ("colors", "labels", "names"):
            words = {f"{value:08x}" if part == "colors" else str(value) for value in values}
            yield f"{part} {', '.join(sorted(words)) if len(words) <= 6 else f'{len(words)} different'}"
        elif values and isinstance(values[0], str):
            yield f"{part} {len(set(values))} different"
        else:
            yield f"{part} {means(np.array(_flat(values), float))}"


def _step(state: str) -> int:
    number = state.partition(":")[0]
    return int(number) if number.isdecimal() else 0


def _flat(values: list[Any]) -> list[float]:
    return [
        one for value in values for one in (_flat(value) if isinstance(value, (list, tuple)) else [value])
    ]


def test_what_is_saved_of_a_run(made, remake):
    camera, laser = made("camera", "kidnapped"), made("laser", "carried")
    text = "\n\n".join(
        f"== {title}\n\n{table_of(one.run)}" for title, one in (("camera", camera), ("laser", laser))
    )
    expect_golden("saved", text, remake)


RECORDED = {
    "recording light": lambda file: {"output": mv.Output(file, detail="light")},
    "recording live": lambda file: {"to": file, "live": mv.LiveOptions(follow=True, patience_s=0.1)},
}


@pytest.mark.filterwarnings("ignore:RRD file has no footer")  # of a live one
@pytest.mark.parametrize("name", RECORDED)
def test_what_is_drawn_of_a_run(name, driven, tmp_path, remake):
    """Light is what a camera's drive leaves of it, live what is drawn of a laser's that still grows."""
    sensor = "laser" if "live" in name else "camera"
    drive, log, places = driven(sensor, "carried")
    file = tmp_path / "drawn.rrd"
    scores = mv.replay(log, places, asked(sensor, drive), **RECORDED[name](file))
    figures = "\n".join(
        lines({key: value for key, value in scores.to_json()["runs"][0].items() if key != "steps_per_s"})
    )
    expect_golden(name, f"{recording_of(file)}\n\n{figures}\n", remake)


def test_what_is_told_and_drawn_of_runs_side_by_side(driven, tmp_path, remake):
    _, log, places = driven("camera", "kidnapped")
    file, both = tmp_path / "drawn.rrd", ["thesis", "robust"]
    scores = mv.compare(
        log,
        places,
        filters=[mv.Filter(value, particles=300) for value in both],
        to=file,
        save_run=tmp_path / "run",
    )
    made = Made(tmp_path, scores)
    parts = {
        "against the first": "\n".join(lines(scores.to_json()["runs"][1]["against_first"])),
        "report": page_of(made, "summary", "events", "pictures"),
        "drawn": recording_of(file),
        "texts": "\n\n".join(texts_at(file, scores.runs[0].verdict.decisive)),
    }
    text = "\n".join(f"== {title}\n\n{part}\n" for title, part in parts.items())
    expect_golden("compared", made.plain(text), remake)


def texts_at(file: Path, step: int) -> Iterator[str]:
    """Yield what the text views show at a step."""
    for chunk in RrdReader(file).stream():
        batch = chunk.to_record_batch()
        is_told = str(chunk.entity_path).endswith(("tour", "verdict", "/text", "explain/words"))
        if is_told and {"TextDocument:text", "step"} <= set(batch.schema.names):
            rows = zip(
                batch.column("step").to_pylist(), batch.column("TextDocument:text").to_pylist(), strict=True
            )
            yield from (f"{chunk.entity_path}\n{text[0]}" for at, text in rows if at == step and text)
