"""What is drawn is what the records say: read back from the file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import rerun.blueprint as rrb
from rerun.chunk import RrdReader

from helpers import viz_fakes as fakes
from helpers import viz_recordings as recordings
from maurice_mcl.config.build import build_localizer
from maurice_mcl.config.parameters import Layer, configure
from maurice_mcl.filter.localizer import run
from maurice_mcl.reasons.explanation import offset
from maurice_mcl.values.library import Library
from maurice_viz import entities
from maurice_viz.drawing.keys import MATCHES, WEIGHTS
from maurice_viz.entities import PHASES_PER_STEP, Phase, RunPaths
from maurice_viz.layouts.registry import runs_blueprint
from maurice_viz.panels.belief import PoseMarker
from maurice_viz.panels.story import VerdictDrawing
from maurice_viz.running.observer import RerunObserver
from maurice_viz.scene import Detail
from maurice_viz.style import RUN_COLORS, faint, packed, scale_for, weight_colors, weight_shades
from maurice_viz.text import phases as narrate
from maurice_viz.viewer import sinks
from maurice_viz.viewer.sinks import recording

STEPS = 4
RUN = RunPaths("blended")


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    return fakes.make_library(tmp_path_factory.mktemp("pictures"))


@pytest.fixture(scope="module")
def drawn(library: Library, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, recordings.Played]:
    path = tmp_path_factory.mktemp("drawn") / "out.rrd"
    (played,) = recordings.draw(path, fakes.make_session(library, STEPS, name="Büro 東京"), ["blended"])
    return path, played


def test_every_entity_is_on_three_timelines(drawn):
    found = recordings.entities_of(drawn[0])
    traces = ("position_error", "heading_error", "spread", "confidence", "effective_sample")
    world = {entities.FLOORS, entities.WALLS, entities.NODES, RUN.key(WEIGHTS), RUN.key(MATCHES)}
    expected = {entities.CAMERA, entities.TRUTH, RUN.particles, RUN.estimate, RUN.text}
    expected |= {RUN.circles, RUN.best, RUN.match(1)} | world | {RUN.trace(t) for t in traces}
    assert expected <= found
    names = {n for chunk in RrdReader(drawn[0]).stream() for n in chunk.to_record_batch().schema.names}
    assert {"step", "session", "phase"} <= names
    assert not {"log_time", "log_tick"} & names
    assert recordings.static(drawn[0], "/__properties")["RecordingInfo:name"] == ["Büro 東京"]


OF_A_RUN = ("estimate", "answer", "ellipses", "name", "rose", "marks")  # last parts of paths


def test_a_runs_color_is_of_its_estimate_path_ellipse_and_curves_alone(drawn):
    for entity in recordings.entities_of(drawn[0]):
        values = recordings.static(drawn[0], entity)
        colors = [
            color for name, some in values.items() if name.endswith((":colors", ":color")) for color in some
        ]
        if packed(RUN_COLORS[0]) in colors:
            assert entity.rpartition("/")[2] in OF_A_RUN or "/trace/" in entity, entity


def test_particles_walk_through_the_phases(drawn, library):
    path, played = drawn
    found = recordings.rows(path, RUN.particles)
    slots = (Phase.PREDICT, Phase.WEIGHT)
    steps = [m.frame.step for m, _ in played]
    assert [row.phase for row in found] == [entities.phase_number(s, slot) for s in steps for slot in slots]
    scale = scale_for("in", library.arena)
    for k, (moment, record) in enumerate(played):
        predict, weight = found[2 * k : 2 * k + 2]
        order = np.argsort(weight_shades(record.weighted.log_weights), kind="stable")  # heavy ones are on top
        expected = (record.predicted.world_poses[order, :2] / 0.0254) * (1, -1)
        np.testing.assert_allclose(recordings.positions(predict), expected, atol=scale.units.fine)
        assert weight.values["Points2D:colors"] == weight_colors(record.weighted.log_weights[order]).tolist()
        carried = weight_colors(record.predicted.log_weights[order]).tolist()
        assert predict.values["Points2D:colors"] in (carried, carried[:1])
        for row in (predict, weight):
            assert row.step == moment.frame.step
            assert row.session_s == pytest.approx(moment.frame.time_s)


def test_phases_log_what_changes(drawn):
    for row in recordings.rows(drawn[0], RUN.particles)[1::2]:
        assert set(row.values) == {"Points2D:colors"}
    found = [row for row in recordings.rows(drawn[0], RUN.estimate) if row.step is not None]
    so_far = [row.values["Points2D:positions"][0] for row in found]
    assert [place for strip in found[-1].values["LineStrips2D:strips"] for place in strip] == so_far
    first_caption = f"{RUN.match(1)}/caption"
    for entity, begin in (
        (entities.CAMERA, b"\xff\xd8"),
        (first_caption, b"\x89P"),
    ):
        rows = recordings.rows(drawn[0], entity)
        assert [row.step for row in rows] == [None, *range(1, STEPS + 1)]  # first: nothing taken yet
        assert rows[0].phase == entities.phase_number(1, Phase.PREDICT)
        assert all(bytes(row.values["EncodedImage:blob"][0][:2]) == begin for row in rows)


def test_a_best_matchs_picture_is_logged_when_it_changes(drawn):
    path, played = drawn
    best = [int(record.sighting.comparison.best(1)[0]) for _, record in played]
    changes = [k for k, entry in enumerate(best) if k == 0 or entry != best[k - 1]]
    rows = recordings.rows(path, RUN.match(1))
    assert [row.step for row in rows] == [None, *(played[k][0].frame.step for k in changes)]


def test_truth_and_estimate_are_drawn_with_y_down(drawn):
    path, played = drawn
    poses = {entities.TRUTH: [m.truth for m, _ in played], RUN.estimate: [r.estimate.pose for _, r in played]}
    for entity, expected in poses.items():
        found = [row for row in recordings.rows(path, entity) if row.step is not None]
        assert len(found) == STEPS
        for row, pose in zip(found, expected, strict=True):
            assert recordings.positions(row)[0] == pytest.approx(pose[:2] / 0.0254 * (1, -1), abs=0.02)
            x, y = row.values["Arrows2D:vectors"][0]
            assert np.arctan2(-y, x) == pytest.approx(pose[2], abs=1e-5)


def test_before_the_cloud_is_weighted_there_is_no_estimate(drawn):
    rows = recordings.rows(drawn[0], RUN.estimate)
    before = [row for row in rows if row.phase % PHASES_PER_STEP == Phase.PREDICT]
    assert len(before) == STEPS
    assert all(row.values["Points2D:positions"] == [] and row.step is None for row in before)


def test_headings_are_those_of_the_cloud_in_each_phase(drawn):
    rows = recordings.rows(drawn[0], RUN.headings)
    arrows = {row.phase % PHASES_PER_STEP: len(row.values["Arrows2D:vectors"]) for row in rows}
    assert arrows == {Phase.PREDICT: 1, Phase.WEIGHT: 2}, "the truth, then estimate and truth"


def test_a_trail_breaks_where_a_pose_jumps(tmp_path):
    marker = PoseMarker("/pose", (1, 2, 3), 1.0, 1.0, scale_for("m", fakes.make_library().arena), 1.0)
    path = tmp_path / "trail.rrd"
    rec = recording("trail")
    rec.save(path)
    for step, (x, jumped) in enumerate(((0.0, False), (1.0, False), (5.0, True), (6.0, False))):
        rec.set_time("phase", sequence=step)
        marker.draw(rec, np.array([x, 0, 0]), jumped)
    rec.disconnect()
    strips = recordings.rows(path, "/pose")[-1].values["LineStrips2D:strips"]
    assert [[point[0] for point in strip] for strip in strips] == [[0, 1], [5, 6]]


def test_traces_are_those_of_the_records(drawn):
    path, played = drawn
    expected: dict[str, list[float]] = {
        "position_error": [],
        "heading_error": [],
        "confidence": [],
        "effective_sample": [],
    }
    for moment, record in played:
        assert moment.truth is not None
        off = offset(record.estimate.pose, moment.truth)
        expected["position_error"].append(off.apart_m / 0.0254)
        expected["heading_error"].append(float(np.degrees(off.turned_rad)))
        expected["confidence"].append(record.estimate.confidence)
        expected["effective_sample"].append(record.effective_sample_size / record.weighted.size)
    for quantity, values in expected.items():
        rows = recordings.rows(path, RUN.trace(quantity))
        assert [row.values["Scalars:scalars"][0] for row in rows] == pytest.approx(values)
        assert [row.phase for row in rows] == [
            entities.phase_number(k, Phase.ESTIMATE) for k in range(1, STEPS + 1)
        ]


def test_circles_grow_with_likelihood(drawn):
    path, played = drawn
    for row, (_, record) in zip(recordings.rows(path, RUN.circles), played, strict=True):
        radii = np.array(row.values["Points2D:radii"])
        assert len(radii) == len(record.sighting.comparison.quality)
        assert radii.argmax() == record.sighting.comparison.ranking()[0]
        order = record.sighting.comparison.log_likelihood.argsort(kind="stable")
        assert (np.diff(radii[order]) >= 0).all()


def test_the_words_on_a_step_are_the_summary(drawn, library):
    path, played = drawn
    words = recordings.rows(path, RUN.text)
    assert len(words) == STEPS
    scale = scale_for("in", library.arena)
    for k, (moment, record) in enumerate(played):
        assert words[k].values["TextDocument:text"] == [narrate.summary(moment, record, scale)]


def test_two_runs_share_world_camera_and_truth(library, tmp_path):
    path = tmp_path / "two.rrd"
    recordings.draw(path, fakes.make_session(library, 3), ["color", "blended"])
    assert [row.step for row in recordings.rows(path, entities.CAMERA)] == [None, 1, 2, 3]
    assert [row.step for row in recordings.rows(path, entities.TRUTH)] == [1, 2, 3]
    for label in ("color", "blended"):
        assert len(recordings.rows(path, RunPaths(label).trace("position_error"))) == 3
    assert len(RrdReader(path).blueprints()) == 1


def test_without_truth_there_are_no_errors_and_no_marker(library, tmp_path):
    path = tmp_path / "blind.rrd"
    recordings.draw(path, fakes.make_session(library, 2, has_truth=False), ["blended"])
    found = recordings.entities_of(path)
    assert RUN.trace("spread") in found
    assert len(recordings.rows(path, entities.TRUTH)) == 0
    assert len(recordings.rows(path, RUN.trace("position_error"))) == 0
    assert len(recordings.rows(path, RUN.trace("heading_error"))) == 0


def test_one_frame_and_one_entry_in_metres_without_a_picture(tmp_path):
    library = fakes.make_library(columns=1, rows=1, headings=1, units="m")
    path = tmp_path / "small.rrd"
    ((pair,),) = recordings.draw(path, fakes.make_session(library, 1), ["color"])
    (row,) = recordings.rows(path, RunPaths("color").circles)
    assert len(row.values["Points2D:radii"]) == 1
    (predict, *_) = recordings.rows(path, RunPaths("color").particles)
    order = np.argsort(weight_shades(pair[1].weighted.log_weights), kind="stable")
    expected = pair[1].predicted.world_poses[order, :2] * (1, -1)
    np.testing.assert_allclose(recordings.positions(predict), expected, atol=1e-3)


def test_a_step_that_was_not_resampled_leaves_the_cloud(library, tmp_path):
    session = fakes.make_session(library, 1)
    ((moment, record),) = fakes.play(session, "color", 20)
    kept = fakes.changed(record, parents=None, belief=record.weighted, events=())
    rec = recording("kept")
    rec.save(tmp_path / "kept.rrd")
    observer = RerunObserver(rec, recordings.run_of(session), recordings.scene_with(library))
    recordings.observe(observer, [(moment, kept)])
    rec.disconnect()
    slots = [row.phase - 6 for row in recordings.rows(tmp_path / "kept.rrd", RunPaths("color").particles)]
    assert slots == [Phase.PREDICT, Phase.WEIGHT]
    words = recordings.rows(tmp_path / "kept.rrd", RunPaths("color").inside("words"))
    words = [row for row in words if row.step is None]
    assert "not resampled" in words[Phase.RESAMPLE].values["TextDocument:text"][0]


SHARE = 0.25


def _records(session: fakes.FakeSession) -> recordings.Played:
    always = {
        "particles": 40,
        "sensor.weights": {"color": 1.0},
        "recovery.strategy": "always",
        "recovery.share": SHARE,
    }
    parameters = configure([Layer("test", always)]).parameters
    return list(run(build_localizer(session.library, session, parameters), session, None))


def test_an_estimate_has_its_runs_color_everywhere(tmp_path, library):
    path = tmp_path / "colors.rrd"
    recordings.draw(path, fakes.make_session(library, 2), ["color", "blended"])
    for label, color in zip(("color", "blended"), RUN_COLORS, strict=False):
        paths, shade = RunPaths(label), [packed(color)]
        marker = recordings.static(path, paths.estimate)
        for kind in ("Points2D", "Arrows2D"):
            assert marker[f"{kind}:colors"] == shade
        assert marker["LineStrips2D:colors"] == [packed(faint(color))]
        assert recordings.static(path, paths.ellipses)["LineStrips2D:colors"] == shade
        arrows = recordings.having(recordings.rows(path, paths.headings), "Arrows2D:colors")
        assert arrows[-1].values["Arrows2D:colors"][:1] == shade


def test_with_little_detail_the_best_match_is_drawn(tmp_path, library):
    session, path, run_paths = fakes.make_session(library, 3), tmp_path / "light.rrd", RunPaths("color")
    played = _records(session)
    view, scene = recordings.run_of(session), recordings.scene_with(library)
    with sinks.to_file(path, "x", runs_blueprint([view], scene)) as rec:
        recordings.observe(RerunObserver(rec, view, scene, Detail.LIGHT), played)
    drawn = {rank: recordings.rows(path, f"{run_paths.match(rank)}/**") for rank in (1, 2)}
    assert len(drawn[1]) > len(drawn[2])


@pytest.mark.parametrize(("live", "expected"), [(False, "when it ends"), (True, "No step yet")])
def test_before_there_is_a_verdict_the_headline_says_what_it_waits_for(live, expected, tmp_path):
    scene = replace(recordings.scene_of(fakes.arena(2, 2)), live=live)
    with sinks.to_file(tmp_path / "a.rrd", "x", rrb.Blueprint()) as rec:
        VerdictDrawing(rec, [], scene)
    assert expected in str(recordings.static(tmp_path / "a.rrd", entities.VERDICT))
