"""What runs share in a recording, read back; and the layout that shows it."""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rerun.blueprint as rrb
from PIL import Image
from rerun.chunk import RrdReader

from helpers import viz_fakes as fakes
from helpers import viz_recordings as read
from maurice_mcl.config.build import build_localizer
from maurice_mcl.config.parameters import of_feature
from maurice_mcl.scoring.comparison import ComparisonResult, ErrorDifference, Step, StepComparison
from maurice_mcl.scoring.metrics import LOST_RAD, Scorer
from maurice_mcl.scoring.modes import gains_by_channel, picture_gain
from maurice_viz import entities
from maurice_viz import entities as paths
from maurice_viz.drawing.histogram_row import CELLS_PX, HIGH_PX, cells_of, draw_row
from maurice_viz.layouts.compare import compare
from maurice_viz.panels.comparison import DOTS_A_CLOUD, ComparisonDrawing, by_weight
from maurice_viz.playback import FilterRun, ResultCollector, RunResult, aligned, run_together, shared
from maurice_viz.scene import RunView, Scene, numbered
from maurice_viz.style import REFERENCE, scale_for
from maurice_viz.text.comparison import closest, drive_words, errors_m, least_closer_m
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
    collector = ResultCollector(LABELS, library.arena, scale.say, others or set())
    seen = []
    with sinks.to_file(path, "compared", rrb.Blueprint()) as rec:
        views = [RunView(label, ("color",), own_drive=label in (others or ())) for label in LABELS]
        scene = read.scene_with(library, has_truth=has_truth)
        drawing = ComparisonDrawing(rec, numbered(views), scene)
        for steps_of in aligned([shared(run_together([run], session.moments())) for run in runs]):
            pairs = collector.add_steps(steps_of)
            drawing.see(steps_of)
            seen.append((steps_of, pairs))
        drawing.end(collector.results())
    return seen


@pytest.fixture(scope="module")
def usual(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Seen]:
    """Draw the usual three runs once; nobody changes the file."""
    path = tmp_path_factory.mktemp("compared") / "c.rrd"
    return path, drawn(path, steps=12)


def words(path: Path, entity: str) -> list[str]:
    """Return the texts of whole steps."""
    return [row.values["TextDocument:text"][0] for row in read.rows(path, entity) if row.step is not None]


def test_the_words_of_a_step_have_its_errors_and_name_who_is_closer(usual):
    path, seen = usual
    scale, radii = scale_for("in", fakes.arena(5, 4)), RunView("a", ()).radii
    names = [read.rows(path, f"{paths.COMPARE_CLOSEUP}/name/{number}") for number in range(len(LABELS))]
    whole = [[row for row in rows if row.step is not None] for rows in names]
    for text, named, (steps, _) in zip(words(path, paths.TEXT), zip(*whole, strict=True), seen, strict=True):
        errors = errors_m(steps)
        assert list(errors.values()) == sorted(errors.values())
        for row, label in zip(named, LABELS, strict=True):
            assert row.values["Points2D:labels"][0] == f"{label}: {scale.say(errors[label])} off"
        first, second, *_ = errors
        gap = errors[second] - errors[first]
        assert ("closer**" in text) == (gap >= least_closer_m(radii)) == (closest(steps, radii) == first)
        assert ("equally close" in text) == (closest(steps, radii) is None)


def test_a_gain_is_the_weight_after_over_the_weight_before():
    ((moment, record),) = fakes.play(fakes.make_session(fakes.make_library(), 1), "color", 300)
    truth = np.append(record.weighted.world_poses[0, :2], 0.0)
    gain = picture_gain(record, truth, 100.0)
    turned = np.cos(record.weighted.poses[:, 2]) >= np.cos(LOST_RAD)
    expected = record.weighted.weights[turned].sum() / record.predicted.weights[turned].sum()
    assert gain == pytest.approx(expected)
    assert picture_gain(record, truth + 1000, 1.0) is None
    library = fakes.make_library()
    sensor = build_localizer(library, fakes.make_session(library, 1), of_feature("color", 300)).sensor
    alone = gains_by_channel(sensor, record, truth, 100.0)
    assert alone == {"color": pytest.approx(expected, rel=1e-4)}  # the only channel did it all
    assert gains_by_channel(sensor, record, truth + 1000, 1.0) == {}
    unweighted = fakes.changed(record, weighted=record.predicted)
    assert picture_gain(unweighted, truth, 100.0) == pytest.approx(1)
    assert moment.truth is not None


def test_each_run_has_its_histograms_and_its_color(usual):
    path, seen = usual
    assert len({read.static(path, paths.cloud_of(label))["Points2D:colors"][0] for label in LABELS}) == 3
    sizes = {"color": 84, "edges": 84, "chromaticity": 256, "tiny": 192}
    titles = [cell.title for cell in cells_of(sizes)]
    assert titles == ["color R", "color G", "color B", "edges, square root", "chromaticity", "tiny"]
    sample = {"color": np.full(84, 0.5, np.float32)}
    reference = {"color": np.full(84, 0.25, np.float32)}
    png = draw_row(cells_of({"color": 84}), sample, reference)
    image = np.array(Image.open(io.BytesIO(png)).convert("RGB"))
    assert image.shape == (HIGH_PX, CELLS_PX, 3)
    line = (image == REFERENCE).all(axis=2)
    assert abs(np.flatnonzero(line.any(axis=1)).mean() / HIGH_PX - (1 - 0.5 / 1.05)) < 0.05
    assert seen


def test_the_dots_are_few_and_as_dense_as_the_weight(usual):
    path, seen = usual
    scale = scale_for("in", fakes.arena(5, 4))
    for label in LABELS:
        rows = [row for row in read.rows(path, paths.cloud_of(label)) if row.step is not None]
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


def test_the_end_says_how_runs_compare_and_how_sure_that_is(usual):
    path, _ = usual
    batches = [chunk.to_record_batch() for chunk in RrdReader(path).stream().filter(content=paths.RESULT)]
    columns = [one.column("TextDocument:text") for one in batches if "TextDocument:text" in one.schema.names]
    texts = [text[0] for column in columns for text in column.to_pylist() if text]
    result = max(texts, key=len)  # over what stood there before the end
    for label in LABELS[1:]:
        assert f"* `{label}` is closer at " in result
    assert "No average, as `größe` was not localized from step 1" in result  # clouds that know nothing
    apart = ErrorDifference(-0.1, (-0.2, 0.01), 3, 40, 30, 10)
    many = RunResult(
        "b", Scorer().result(), None, against="a", paired=ComparisonResult(apart, None, 0.1, 0.2, None)
    )
    text = drive_words([many, many], scale_for("in", fakes.arena(5, 4)))
    assert "against `b`" in text
    assert (
        "* `b` is **3.9 in closer** on average (95 %: 0.4 in farther to 7.9 in closer): **may be chance**"
        in text
    )
    assert "closer at 30 of 40 steps" in text


def test_own_drives_have_their_own_truth(tmp_path):
    drawn(tmp_path / "c.rrd", others={"c"})
    there = read.entities_of(tmp_path / "c.rrd")
    assert {paths.truth_of("c"), paths.camera_of("c")} <= there
    assert not {paths.truth_of("größe"), paths.camera_of("größe")} & there
    runs = numbered([RunView("a", ("color",)), RunView("b", ("color",), own_drive=True)])
    found = list(views(compare(runs, shown())))
    assert paths.camera_of("b") in {str(view.origin) for view in found}
    (clouds,) = (view for view in found if str(view.name) == "Clouds")
    assert {entities.TRUTH, paths.truth_of("b")} <= {str(path) for path in clouds.contents}


def test_without_truth_nothing_is_said_of_errors(tmp_path):
    drawn(tmp_path / "c.rrd", has_truth=False)
    text = words(tmp_path / "c.rrd", paths.TEXT)[-1]
    assert "apart" in text
    assert text.endswith("Who is closer is not known without truth.")
    assert "off" not in text


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
def test_the_layout_has_one_close_up_and_a_row_of_histograms_a_run(count, has_truth):
    runs = numbered(RunView(f"seed {k}", ("color", "edges")) for k in range(count))
    found = list(views(compare(runs, shown(has_truth))))
    titles = [str(view.name) for view in found]
    assert titles.count("Clouds") == titles.count("This step") == titles.count("Whole drive") == 1
    assert titles.count("Best match") == count
    assert [title for title in titles if "Histograms" in title] == [
        f"Histograms of seed {k}" for k in range(count)
    ]
    assert all(len(title) <= 25 for title in titles)
    assert not any(view.titlebar for view in found)


@pytest.mark.parametrize("count", [2, 4])
def test_recorded_localizers_have_the_map_instead_of_pictures(count):
    runs = numbered(RunView(f"amcl {k}", ()) for k in range(count))
    titles = [str(view.name) for view in views(compare(runs, shown()))]
    assert "Map" in titles
    assert not any("Histograms" in title or "Best" in title for title in titles)
