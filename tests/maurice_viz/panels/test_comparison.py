"""What runs share in a recording, read back; and the layout that shows it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rerun.blueprint as rrb
from rerun.chunk import RrdReader

from helpers import viz_fakes as fakes
from helpers import viz_recordings as read
from maurice_mcl.config.build import build_localizer
from maurice_mcl.config.parameters import of_feature
from maurice_mcl.scoring.comparison import Step, StepComparison
from maurice_mcl.values.geometry import INCH_M
from maurice_viz import entities
from maurice_viz import entities as paths
from maurice_viz.drawing.keys import belief_key, key_extent, runs_key
from maurice_viz.layouts import several_runs
from maurice_viz.panels.comparison import DOTS_A_CLOUD, ComparisonDrawing, by_weight
from maurice_viz.playback import FilterRun, ResultCollector, aligned, run_together, shared
from maurice_viz.scene import RunView, Scene, numbered
from maurice_viz.style import RUN_COLORS, scale_for
from maurice_viz.viewer import sinks

LABELS = ["seed 0", "größe", "c"]
Seen = list[tuple[Mapping[str, Step], Mapping[str, StepComparison]]]


def drawn(path: Path, others: set[str] | None = None, has_truth: bool = True, steps: int = 3) -> Seen:
    """Draw three runs of one drive; of them some may be said to replay drives of their own."""
    library = fakes.make_library()
    session = fakes.make_session(library, steps, has_truth)
    scale = scale_for("in", library.arena)
    runs = []
    for number, label in enumerate(LABELS):
        localizer = build_localizer(library, session, of_feature("color", 300), seed=number)
        runs.append(FilterRun(label, localizer, None))
    collector = ResultCollector(LABELS, library.arena.size_m, scale.say, others or set())
    seen = []
    with sinks.to_file(path, "compared", rrb.Blueprint()) as rec:
        views = [RunView(label, ("color",), own_drive=label in (others or ())) for label in LABELS]
        scene = read.scene_with(library, has_truth=has_truth)
        drawing = ComparisonDrawing(rec, numbered(views), scene)
        for steps_of in aligned([shared(run_together([run], session.moments())) for run in runs]):
            pairs = collector.add_steps(steps_of)
            drawing.see(steps_of, pairs)
            seen.append((steps_of, pairs))
        drawing.end(collector.results())
    return seen


@pytest.fixture(scope="module")
def usual(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Seen]:
    """Draw the usual three runs once; nobody changes the file."""
    path = tmp_path_factory.mktemp("compared") / "c.rrd"
    return path, drawn(path, steps=12)


def values(row: read.Row) -> list[float]:
    return [float(value) for value in row.values["Scalars:scalars"]]


def test_difference_traces_are_the_pairs_in_display_units(usual):
    path, seen = usual
    for entity, unit, field in (
        (paths.POSITION_DIFFERENCE, 1 / INCH_M, "position_m"),
        (paths.HEADING_DIFFERENCE, np.rad2deg(1), "heading_rad"),
        (paths.APART, 1 / INCH_M, "apart_m"),
    ):
        rows = read.rows(path, entity)
        assert [row.step for row in rows] == list(range(1, 13))
        expected = [[getattr(pair, field) * unit for pair in pairs.values()] for _, pairs in seen]
        assert [values(row) for row in rows] == [pytest.approx(one) for one in expected]


def test_lines_are_named_and_colored_as_their_runs(usual):
    path, _ = usual
    style = read.static(path, paths.APART)
    assert style["SeriesLines:names"] == [f"{label}: distance against seed 0" for label in LABELS[1:]]
    clouds = [read.static(path, paths.cloud_of(label)) for label in LABELS]
    assert [cloud["Points2D:colors"][0] for cloud in clouds[1:]] == style["SeriesLines:colors"]


def test_the_dots_are_few_and_as_dense_as_the_weight(usual):
    path, seen = usual
    scale = scale_for("in", fakes.arena(5, 4))
    for label in LABELS:
        rows = read.having(read.rows(path, paths.cloud_of(label)), "Points2D:positions")
        assert len(rows) == len(seen)
        for row, (steps, _) in zip(rows, seen, strict=True):
            cloud = steps[label][1].weighted
            whole = {tuple(xy) for xy in scale.screen(cloud.world_poses[:, :2]).tolist()}
            dots = {tuple(xy) for xy in read.positions(row).astype(np.float32).tolist()}
            assert len(dots) <= DOTS_A_CLOUD
            assert len(dots - whole) <= 0.02 * DOTS_A_CLOUD  # rounding of float32 may fall to the other side
    weights = np.repeat([0.0, 1.0, 3.0, 0.0], 400)
    chosen = by_weight(weights / weights.sum(), 200)
    assert np.bincount(chosen // 400, minlength=4).tolist() == [0, 50, 150, 0]
    assert by_weight(np.array([1.0]), 200).tolist() == [0]
    assert np.array_equal(by_weight(np.ones(7) / 7, 200), np.arange(7))


def test_where_runs_part_is_marked_once_and_said(usual):
    path, seen = usual
    events = {label: pair.event for _, pairs in seen for label, pair in pairs.items() if pair.event}
    assert events, "runs of different seeds that start anywhere part"
    texts = read.rows(path, paths.TEXT)
    for label, event in events.items():
        (mark,) = read.having(read.rows(path, paths.parted_of(label)), "Scalars:scalars")
        assert mark.step == event.step
        said = [row.values["TextDocument:text"][0] for row in texts if row.step == event.step]
        assert event.text.split(" apart")[0] in said[0].replace("\\", "")
    for label in set(LABELS[1:]) - set(events):
        assert not read.having(read.rows(path, paths.parted_of(label)), "Scalars:scalars")


def test_words_have_a_row_a_run_and_the_end_says_how_they_compare(usual):
    path, _ = usual
    text = read.rows(path, paths.TEXT)[-1].values["TextDocument:text"][0]
    for label, color in zip(LABELS, ("orange", "sky blue", "violet"), strict=True):
        assert f"| {label} ({color}) |" in text
    batches = [chunk.to_record_batch() for chunk in RrdReader(path).stream().filter(content=paths.RESULT)]
    columns = [one.column("TextDocument:text") for one in batches if "TextDocument:text" in one.schema.names]
    said = [text[0] for column in columns for text in column.to_pylist() if text]
    result = max(said, key=len)  # over what stood there before the end
    heads, _, row, *_ = result.splitlines()
    assert "größe" in heads
    assert row.startswith("| error against seed 0, 95 %")
    assert "one drive" in result


def test_own_drives_have_their_own_truth(tmp_path):
    drawn(tmp_path / "c.rrd", others={"c"})
    there = read.entities_of(tmp_path / "c.rrd")
    assert {paths.truth_of("c"), paths.camera_of("c")} <= there
    assert not {paths.truth_of("größe"), paths.camera_of("größe")} & there
    for row in read.rows(tmp_path / "c.rrd", paths.APART):
        assert np.isnan(values(row)[1])
    runs = numbered([RunView("a", ("color",)), RunView("b", ("color",), own_drive=True)])
    found = list(views(several_runs.compare(runs, shown())))
    assert {"a: camera (px)", "b: camera (px)"} <= {str(view.name) for view in found}
    assert not any("Apart" in str(view.name) for view in found)
    belief = {str(view.name)[0]: list(view.contents) for view in found if "belief" in str(view.name)}
    assert f"{entities.TRUTH}/**" in belief["a"]
    assert f"{paths.truth_of('b')}/**" in belief["b"]
    assert f"{entities.TRUTH}/**" not in belief["b"]


def test_without_truth_nothing_is_said_of_errors(tmp_path):
    drawn(tmp_path / "c.rrd", has_truth=False)
    assert not read.rows(tmp_path / "c.rrd", paths.POSITION_DIFFERENCE)
    assert "error" not in read.rows(tmp_path / "c.rrd", paths.TEXT)[-1].values["TextDocument:text"][0]


def views(part: Any) -> Iterator[rrb.View]:
    if isinstance(part, rrb.View):
        yield part
    else:
        for inner in part.contents:
            yield from views(inner)


def shown(has_truth: bool = True) -> Scene:
    arena = fakes.arena(5, 4)
    return read.scene_of(arena, "in", has_truth)


@pytest.mark.parametrize("has_truth", [True, False])
@pytest.mark.parametrize("count", [2, 3, 4])
def test_the_layout_has_one_shared_map_a_map_a_run_and_the_events(count, has_truth):
    runs = numbered(RunView(f"seed {k}", ("color", "edges")) for k in range(count))
    titles = [str(view.name) for view in views(several_runs.compare(runs, shown(has_truth)))]
    assert titles.count("All runs on one map (in)") == 1
    colors = ("orange", "sky blue", "violet", "green")
    maps = [title for title in titles if "belief" in title]
    assert maps == [f"seed {k}, {colors[k]}: belief (in)" for k in range(count)]
    assert any("Distance to seed 0" in title for title in titles)
    assert any("minus" in title for title in titles) == has_truth
    assert titles[-1] == "What happened"


def test_titles_and_labels_are_short():
    """At 1600 pixels a small map has room for 28 letters beside the view's buttons."""
    runs = numbered(RunView(label, ("color",)) for label in ("color", "edges", "blended", "best"))
    narrow = [str(view.name) for view in views(several_runs.compare(runs, shown()))]
    assert all(len(title) <= 28 for title in narrow)
    runs = [RunView("robust, tuned on the whole of olin", ("color",)), RunView("b", ("color",))]
    wide = [str(view.name) for view in views(several_runs.compare(runs, shown()))]
    assert "Error minus the first's (in)" in wide
    assert np.array_equal(runs_key(["ひと", "b"], False), runs_key(["orange", "b"], False))
    assert np.array_equal(runs_key(["é", "b"], False), runs_key(["e", "b"], False))


@pytest.mark.parametrize("labels", [["a", "b"], ["a long label", "another one", "größe", "ひと"]])
def test_keys_stand_above_the_map_and_hold_every_label(labels):
    where = shown()
    for key in (runs_key(labels, True), belief_key(True, RUN_COLORS[1], len(labels))):
        extent = key_extent(key, where.arena, where.scale)
        assert extent.bottom <= 0 - where.scale.length(where.arena.bounds[3]) + 1e-6  # y points down
        assert (key.max(axis=2) > 100).any()
    long = [f"{label}, with many words" for label in labels]
    assert runs_key(long * 2, True).shape[0] > runs_key(["a"], True).shape[0]
