"""What runs share in a recording, read back; and the layout that shows it."""

from __future__ import annotations

import io
import re
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import replace
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
from maurice_mcl.scoring.comparison import ComparisonResult, ErrorDifference, Step
from maurice_mcl.scoring.lost_signal import LostSignal
from maurice_mcl.scoring.metrics import score_table
from maurice_mcl.scoring.modes import picture_gain
from maurice_mcl.scoring.table import LOST_RAD, TableRows
from maurice_mcl.values import INCH_M
from maurice_viz import entities
from maurice_viz import entities as paths
from maurice_viz.drawing.canvas import long_side
from maurice_viz.drawing.histogram_row import HIGH_PX, TITLE_PX, WIDE_PX, cells_of, draw_grid
from maurice_viz.entities import Phase, phase_number
from maurice_viz.layouts.compare import compare
from maurice_viz.panels.comparison.drawing import DOTS_A_CLOUD, ComparisonDrawing, by_weight, side_views
from maurice_viz.panels.inside import AFTER, BEFORE
from maurice_viz.playback import FilterRun, ResultCollector, RunResult, aligned, run_together, shared
from maurice_viz.running.observer import SceneObserver
from maurice_viz.scene import RunView, Scene, numbered
from maurice_viz.style import DEAD, FRESH, RUN_COLORS, packed, scale_for, shortened
from maurice_viz.text.comparison import closest, drive_words, errors_m
from maurice_viz.text.explanation import ordinal
from maurice_viz.text.side_by_side import step_words
from maurice_viz.viewer import sinks

LABELS = ["seed 0", "größe", "c"]
FEATURES = dict(zip(LABELS, ["color", "blended", "color"], strict=True))
Seen = list[Mapping[str, Step]]


def drawn(path: Path, others: set[str] | None = None, has_truth: bool = True, steps: int = 3) -> Seen:
    """Draw three runs of one drive; of them some may be said to replay drives of their own."""
    library = fakes.make_library()
    session = fakes.make_session(library, steps, has_truth)
    scale = scale_for("in", library.arena)
    runs = []
    for number, label in enumerate(LABELS):
        localizer = build_localizer(library, session, of_feature(FEATURES[label], 300), seed=number)
        runs.append(FilterRun(label, localizer, None))
    collector = ResultCollector(LABELS, library.arena, scale.say, others or set())
    seen = []
    views = [
        replace(RunView.of(run.label, run.localizer), own_drive=run.label in (others or ())) for run in runs
    ]
    views, scene = numbered(views), read.scene_with(library, has_truth=has_truth)
    with sinks.to_file(path, "compared", rrb.Blueprint()) as rec:
        observer = SceneObserver(rec, views, scene)
        for steps_of in aligned([shared(run_together([run], session.moments())) for run in runs]):
            collector.add_steps(steps_of)
            observer.see(steps_of, collector)
            seen.append(steps_of)
        observer.end(collector.results())
    return seen


@pytest.fixture(scope="module")
def usual(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Seen]:
    """Draw the usual three runs once; nobody changes the file."""
    path = tmp_path_factory.mktemp("compared") / "c.rrd"
    return path, drawn(path, steps=12)


def test_each_run_is_followed_once_for_scores_and_drawing(tmp_path, monkeypatch):
    followed, add = Counter[str](), {kind: kind.add for kind in (TableRows, LostSignal)}
    for kind in add:

        def counted(self, *values, kind=kind, **named):
            followed[kind.__name__] += 1
            return add[kind](self, *values, **named)

        monkeypatch.setattr(kind, "add", counted)
    drawn(tmp_path / "c.rrd", steps=2)
    assert followed == dict.fromkeys(("TableRows", "LostSignal"), 2 * len(LABELS))


def texts_of(path: Path, entity: str, component: str = "TextDocument:text") -> dict[int, str]:
    """Return texts by phase number; of whole steps by minus the step."""
    rows = [*read.rows(path, entity), *read.rows(path, entity, "step")]
    return {
        -row.step if row.phase is None else row.phase: row.values[component][0]
        for row in read.having(rows, component)
    }


def test_the_words_of_a_step_have_its_errors_and_name_who_is_closer(usual):
    path, seen = usual
    scale, radii = scale_for("in", fakes.arena(5, 4)), RunView("a", ()).radii
    texts = texts_of(path, paths.TEXT)
    captions = {
        label: texts_of(path, f"{paths.frame_of(label)}/{AFTER}", "Points2D:labels") for label in LABELS
    }
    for steps in seen:
        step, errors = next(iter(steps.values()))[0].frame.step, errors_m(steps)
        assert list(errors.values()) == sorted(errors.values())
        text = texts[-step]
        for label in LABELS:
            number = scale.say(errors[label])
            assert captions[label][-step] == f"weighted\n{number} off"
            assert number.split()[0] in text  # the words agree with the labels
        first = closest(steps, radii)
        assert ("is closest" in text) == (first is not None)
        assert ("about equally close" in text) == (first is None)
        assert text.startswith(f"#### Step {step}: `{next(iter(errors)) if first is None else first}`")
        assert texts[phase_number(step, Phase.ESTIMATE)] == text.replace(":", ", 6 estimate:", 1)


def test_words_of_two_runs_agree_with_what_they_round():
    scale, radii = scale_for("in", fakes.arena(5, 4)), RunView("a", ()).radii
    ((moment, record),) = fakes.play(fakes.make_session(fakes.make_library(), 1), "color", 100)

    def off(error_in: float) -> Step:
        truth = record.estimate.pose - (error_in * INCH_M, 0.0, 0.0)
        return fakes.changed(moment, truth=truth), record

    text = step_words({"a": off(6.58), "b": off(3.94)}, scale, radii)
    assert text == "Step 1: `b` is **2.7 in closer** than `a`: 3.9 and 6.6 in off."
    text = step_words({"a": off(2.4), "b": off(3.3)}, scale, radii)
    assert text == "Step 1: `a` and `b` are about equally close, 2.4 and 3.3 in off."
    text = step_words({"a": off(2.4), "b": off(3.3), "c": off(9)}, scale, radii)
    assert text == "Step 1: `a` and `b` are about equally close, 2.4 and 3.3 in off; `c` 9.0 in."


@pytest.mark.parametrize("side", [BEFORE, AFTER])
def test_the_clouds_of_every_phase_are_those_of_the_record(usual, side):
    """Places, the dead, the copied and the new, as the compare screen shows them."""
    path, seen = usual
    scale = scale_for("in", fakes.arena(5, 4))
    frames, run_views = list(numbered(RunView(label, ("color",)) for label in LABELS)), {}
    for run in frames:
        run_views[run.label] = {str(view.name).lower(): view for view in side_views(run, shown())}
    for label in LABELS:
        view = run_views[label][side]
        cloud = entities.RunPaths(label).inside(side)
        assert str(view.origin) == paths.frame_of(label)
        assert any(str(part) in (cloud, f"{cloud}/**") for part in view.contents)
        drawn_at = Latest(path, cloud)
        for steps in seen:
            moment, record = steps[label]
            moved = scale.screen(record.predicted.world_poses[:, :2])
            order = np.argsort(record.weighted.weights, kind="stable")
            for phase in list(Phase)[side == BEFORE :]:
                number = phase_number(moment.frame.step, phase)
                done = Phase(phase - 1) if side == BEFORE else phase
                places, colors, radii = drawn_at(number)
                kept = colors != packed(FRESH)
                if done <= Phase.RESAMPLE:
                    assert np.asarray(places)[kept] == pytest.approx(moved[order], abs=1e-3)
                if done is Phase.RESAMPLE and record.parents is not None:
                    copies = np.bincount(record.parents[record.parents >= 0], minlength=300)[order]
                    assert np.array_equal(colors == packed(DEAD), copies == 0)
                    assert np.corrcoef(radii[copies > 0] ** 2, copies[copies > 0])[0, 1] > 0.9
                if done is Phase.RESEED:
                    fresh = 0 if record.injected is None else record.injected.sum()
                    assert (~kept).sum() == fresh


class Latest:
    """What a person sees of a cloud at a phase number: the latest values."""

    def __init__(self, path: Path, entity: str) -> None:
        self._rows = [row for row in read.rows(path, entity) if row.phase is not None]

    def __call__(self, number: int) -> tuple[Any, Any, Any]:
        values: dict[str, Any] = {}
        for row in self._rows:
            if row.phase <= number:
                values |= row.values
        return tuple(np.array(values[f"Points2D:{name}"]) for name in ("positions", "colors", "radii"))


def test_what_each_run_lost_is_counted_anew(usual):
    path, seen = usual
    texts, whys = texts_of(path, paths.TEXT), texts_of(path, paths.WHY)
    resampled = 0
    for steps in seen:
        step = next(iter(steps.values()))[0].frame.step
        text = texts[phase_number(step, Phase.RESAMPLE)]
        assert text.startswith(f"#### Step {step}, 4 resample: ")
        radius = re.search(r"within (\d+\.\d) in", text)
        for label, (moment, record) in steps.items():
            if record.parents is None:
                assert f"`{label}` is not resampled" in text
                continue
            resampled += 1
            alive = sorted({int(parent) for parent in record.parents if parent >= 0})
            kept = re.search(rf"`{label}` (?:keeps )?(\d+)", text)
            assert kept is not None
            assert int(kept[1]) == len(alive)
            most = max(np.count_nonzero(record.parents == parent) for parent in alive)
            assert f"{most} with `{label}`" in whys[phase_number(step, Phase.RESAMPLE)]
            assert radius is not None
            away = np.hypot(*(record.weighted.world_poses[:, :2] - moment.truth[:2]).T)
            confidence_m = record.estimate.radii.confidence_m
            near_m = min((confidence_m / 3, confidence_m), key=lambda r: abs(r / INCH_M - float(radius[1])))
            assert near_m / INCH_M == pytest.approx(float(radius[1]), abs=0.051)
            near = away <= near_m
            counted = f"{near[alive].sum()} of {near.sum()}" if near.any() else "(none"
            assert counted in text[kept.start() : kept.start() + 90]
    assert resampled


def test_every_phase_names_its_step_and_itself(usual):
    path, seen = usual
    texts = texts_of(path, paths.TEXT)
    for steps in seen:
        moment, record = steps[LABELS[0]]
        step = moment.frame.step
        assert texts[-step].startswith(f"#### Step {step}: ")
        for phase in Phase:
            text = texts[phase_number(step, phase)]
            assert text.startswith(f"#### Step {step}, {phase + 1} {phase.name.lower()}: ")
        half = np.sort(record.weighted.weights)[::-1].cumsum()
        assert (
            f"{np.searchsorted(half, 0.5 - 1e-9) + 1} of 300 dots with `{LABELS[0]}`"
            in texts[phase_number(step, Phase.WEIGHT)]
        )


def test_a_match_is_where_it_was_taken_with_its_ranks(usual):
    path, seen = usual
    library, scale = fakes.make_library(), scale_for("in", fakes.arena(5, 4))
    texts = texts_of(path, paths.TEXT)
    for steps in seen:
        text = texts[phase_number(next(iter(steps.values()))[0].frame.step, Phase.MEASURE)]
        for label, (moment, record) in steps.items():
            best = int(np.argmax(record.sighting.comparison.quality))
            away = np.hypot(*(library.poses[best, :2] - moment.truth[:2]))
            assert scale.say(float(away)) in text
            rows = [row for row in read.rows(path, paths.taken_of(label)) if row.step == moment.frame.step]
            assert read.positions(rows[0])[0] == pytest.approx(
                scale.screen(library.poses[best, :2]), abs=1e-3
            )
        if "(" in text:  # ranks, of two matches
            color = steps[LABELS[0]][1].sighting.comparison
            edges = next(
                record.sighting.comparison
                for _, record in steps.values()
                if "edges" in record.sighting.comparison.channels
            )
            best = int(color.quality.argmax())
            row = edges.distances[edges.channels.index("edges")]
            rank = 1 + sum(float(distance) < float(row[best]) for distance in row)
            unused = "" if best == int(edges.quality.argmax()) else ", unused"  # by none that has this match
            assert f"{ordinal(rank)} by edges{unused}" in text


def test_a_gain_is_the_weight_after_over_the_weight_before():
    ((moment, record),) = fakes.play(fakes.make_session(fakes.make_library(), 1), "color", 300)
    truth = np.append(record.weighted.world_poses[0, :2], 0.0)
    gain = picture_gain(record, truth, 100.0)
    turned = np.cos(record.weighted.poses[:, 2]) >= np.cos(LOST_RAD)
    expected = record.weighted.weights[turned].sum() / record.predicted.weights[turned].sum()
    assert gain == pytest.approx(expected)
    assert picture_gain(record, truth + 1000, 1.0) is None
    unweighted = fakes.changed(record, weighted=record.predicted)
    assert picture_gain(unweighted, truth, 100.0) == pytest.approx(1)
    assert moment.truth is not None


def test_each_run_has_its_histograms_and_its_color(usual):
    path, seen = usual
    assert len({read.static(path, paths.cloud_of(label))["Points2D:colors"][0] for label in LABELS}) == 3
    titles = [cell.title for cell in cells_of({"color": 84, "edges": 84, "chromaticity": 256})]
    assert titles == ["R", "G", "B", "edges"]
    titles = [cell.title for cell in cells_of({"chromaticity": 256, "color": 84, "blurred": 84})]
    assert titles == ["chromaticity", "color R", "color G", "color B"]
    sample = {"color": np.full(84, 0.5, np.float32), "edges": np.full(84, 0.01, np.float32)}
    reference = {"color": np.full(84, 0.25, np.float32), "edges": np.full(84, 0.04, np.float32)}
    png = draw_grid(cells_of({"color": 84, "edges": 84}), sample, reference, 1)
    image = np.array(Image.open(io.BytesIO(png)).convert("RGB")).astype(int)
    assert image.shape == (2 * HIGH_PX, 2 * WIDE_PX, 3)
    lines = (image == RUN_COLORS[1]).all(axis=2)
    charts = [lines[:HIGH_PX, :WIDE_PX], lines[HIGH_PX:, WIDE_PX:]]  # red, and edges by square root
    for line, share in zip(charts, (0.5 / 1.05, 1 / 1.05), strict=True):
        height = HIGH_PX - TITLE_PX
        middle = np.flatnonzero(line.any(axis=1)).mean() - TITLE_PX
        assert abs(middle / height - (1 - share)) < 0.05
    bars = [image[HIGH_PX - 5, 40], image[HIGH_PX - 5, WIDE_PX + 40], image[2 * HIGH_PX - 5, 40]]
    assert [int(np.argmax(color)) for color in bars] == [0, 1, 2]  # each in its own color
    gray = image[2 * HIGH_PX - 5, WIDE_PX + 40]
    assert np.ptp(gray) < 10
    # of an edge histogram half as high as the reference's the root is .5
    column = (np.abs(image[HIGH_PX + TITLE_PX : 2 * HIGH_PX - 1, WIDE_PX + 40] - gray).sum(axis=1) < 3).mean()
    assert column == pytest.approx(0.5 / 1.05, abs=0.05)
    labels = read.static(path, paths.bars_of(LABELS[0], "titles"))["Points2D:labels"]
    assert "no edges" in labels  # by color alone, beside runs with edges
    assert seen


def test_the_dots_are_few_and_as_dense_as_the_weight(usual):
    path, seen = usual
    scale = scale_for("in", fakes.arena(5, 4))
    for label in LABELS:
        rows = [row for row in read.rows(path, paths.cloud_of(label)) if row.step is not None]
        assert len(rows) == len(seen)
        for row, steps in zip(rows, seen, strict=True):
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
    assert "`größe` is **" in result
    assert "`c` is closer at " in result
    assert "No averages, as `c` was not localized from step 1" in result  # a cloud that knows nothing
    apart = ErrorDifference(-0.1, (-0.2, 0.01), 3, 40, 30, 10)
    many = RunResult(
        "b",
        score_table(TableRows().table()),
        None,
        against="a",
        paired=ComparisonResult(apart, None, 0.1, 0.2, None),
    )
    text = drive_words([many, many], scale_for("in", fakes.arena(5, 4)))
    assert "against `b`" in text
    assert (
        "`b` is **3.9 in closer** on average (95 %: 0.4 in farther to 7.9 in closer): **may be chance**"
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
    clouds = [view for view in found if str(view.name) == "After"]
    truths = [entities.TRUTH, paths.truth_of("b")]
    for view, truth in zip(clouds, truths, strict=True):
        assert truth in {str(path) for path in view.contents}


def test_without_truth_nothing_is_said_of_errors(tmp_path):
    drawn(tmp_path / "c.rrd", has_truth=False)
    text = texts_of(tmp_path / "c.rrd", paths.TEXT)[-3]
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
def test_the_layout_has_a_column_a_run(count, has_truth):
    runs = numbered(RunView(f"seed {k}", ("color", "edges")) for k in range(count))
    found = list(views(compare(runs, shown(has_truth))))
    titles = [str(view.name) for view in found]
    for once in ("This step", "Why", "Whole drive", "The robot sees", "Where matches were taken"):
        assert titles.count(once) == 1
    for each in ("Before", "After", "Best match"):
        assert titles.count(each) == count
    assert [title for title in titles if "Histograms" in title] == [
        f"Histograms of seed {k}" for k in range(count)
    ]
    assert all(len(title) <= 25 for title in titles)
    assert not any(view.titlebar for view in found)


@pytest.mark.parametrize("count", [2, 4])
def test_recorded_localizers_have_their_cloud_alone(count):
    runs = numbered(RunView(f"amcl {k}", ()) for k in range(count))
    titles = [str(view.name) for view in views(compare(runs, shown()))]
    assert titles.count("After") == titles.count("Headings (deg)") == count
    assert not any("Histograms" in title or "Best" in title or title == "Before" for title in titles)


def test_names_on_the_small_map_keep_away_from_each_other(usual):
    path, seen = usual
    arena = fakes.arena(5, 4)
    side = long_side(arena, scale_for("in", arena))
    for steps in seen:
        step = next(iter(steps.values()))[0].frame.step
        names = [
            read.positions(row)[0]
            for label in LABELS
            for row in read.rows(path, f"{paths.taken_of(label)}/name")
            if row.step == step
        ]
        assert len(names) == 3
        for number, name in enumerate(names):
            assert all(np.hypot(*(name - other)) > 0.1 * side for other in names[:number])


def test_close_ups_are_alike_unless_a_run_would_be_a_speck(tmp_path):
    ((moment, record),) = fakes.play(fakes.make_session(fakes.make_library(), 1), "color", 300)
    spread = record.weighted
    truth = np.append(spread.origin + spread.poses[0, :2], 0.0)
    dense = fakes.changed(spread, poses=np.tile(spread.poses[:1], (300, 1)))
    seen = fakes.changed(moment, truth=truth)
    scene = read.scene_with(fakes.make_library())
    sides = []
    for number, cloud in enumerate((spread, dense)):
        path = tmp_path / f"{number}.rrd"
        steps = {"a": (seen, record), "b": (seen, fakes.changed(record, weighted=cloud))}
        with sinks.to_file(path, "two", rrb.Blueprint()) as rec:
            ComparisonDrawing(rec, numbered(RunView(label, ()) for label in steps), scene).see(steps)
        frames = [read.rows(path, paths.frame_of(label))[0].values for label in steps]
        sides.append([frame["Transform3D:scale"][0][0] for frame in frames])
    assert sides[0][0] == sides[0][1] == sides[1][0]
    assert sides[1][1] < sides[1][0] / 4


@pytest.mark.parametrize(("text", "room", "expected"), [("abc", 3, "abc"), ("seed-0-run", 7, "see\u2026run")])
def test_long_names_lose_their_middle(text, room, expected):
    assert shortened(text, room) == expected
