"""The first screen of the demo: what is seen where each run is, and what each step teaches."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rerun.chunk import RrdReader

import maurice_viz as mv
from helpers import viz_fakes as fakes
from helpers import viz_recordings as recordings
from maurice_datasets.demos import kidnapping_paths
from maurice_mcl.values.geometry import INCH_M
from maurice_viz.drawing.contact_sheet import cell_height, no_picture, reference_jpeg
from maurice_viz.entities import LIMITS, TOUR, Phase, RunPaths, phase_number
from maurice_viz.layouts.registry import runs_blueprint
from maurice_viz.panels.camera import LETTERS, NO_LIBRARY, HerePanel, name_of
from maurice_viz.panels.panel import StepUpdate
from maurice_viz.panels.registry import panels_of
from maurice_viz.running.saved import Opened, open_saved
from maurice_viz.scene import RunView

LABELS = ("thesis", "robust")


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Opened]:
    """Return the demo's recording, with little detail, and its runs."""
    folder = tmp_path_factory.mktemp("demo")
    recording, saved = folder / "demo.rrd", folder / "runs"
    session = kidnapping_paths().session
    mv.compare(session, filters=LABELS, output=mv.Output(detail="light", to=recording, save_run=saved))
    return recording, open_saved(saved)


def texts_of(recording: Path) -> str:
    """Return all texts of a recording: labels, documents, names of views."""
    found: list[object] = []
    for chunk in RrdReader(recording).stream():
        batch = chunk.to_record_batch()
        for name in batch.schema.names:
            if "label" in name or "TextDocument:text" in name or name.endswith(":name"):
                found += batch.column(name).to_pylist()
    return str(found)


def test_the_reference_shown_is_the_nearest_to_the_estimate_at_every_step(demo):
    recording, opened = demo
    library, height = opened.scene.library, cell_height(opened.scene.library.pictures)
    shown = {label: {} for label in LABELS}
    for label in LABELS:
        for row in recordings.rows(recording, RunPaths(label).here):
            if row.step is not None:
                shown[label][row.step] = bytes(row.values["EncodedImage:blob"][0])
    picture, steps = dict.fromkeys(LABELS, b""), 0
    for moment, records in opened.updates():
        steps += 1
        for label, record in records.items():
            x, y, heading = record.estimate.pose
            away = np.hypot(library.poses[:, 0] - x, library.poses[:, 1] - y)
            turned = np.abs((library.poses[:, 2] - heading + np.pi) % (2 * np.pi) - np.pi)
            place = np.flatnonzero(away <= away.min() + 0.03)  # a cell of the raster is 2 in wide
            nearest = place[turned[place] <= turned[place].min() + np.radians(0.5)]
            picture[label] = shown[label].get(moment.frame.step, picture[label])
            expected = {reference_jpeg(library.pictures[entry], height) for entry in nearest.tolist()}
            assert picture[label] in expected, (label, moment.frame.step)
    assert steps == 80


def test_the_lessons_numbers_are_those_of_the_step(demo):
    """Computed here from the library's poses and the clouds alone."""
    recording, opened = demo
    library, known = opened.scene.library, 0
    pages = {row.step: row.values["TextDocument:text"][0] for row in recordings.rows(recording, TOUR)}
    assert sorted(pages) == list(range(1, 81))
    for moment, records in opened.updates():
        step, truth = moment.frame.step, moment.truth
        page = pages[step]
        assert f"tep {step}" in page.split(".")[0]
        for label, record in records.items():
            cloud = record.weighted.world_poses
            away = np.hypot(*(cloud[:, :2] - truth[:2]).T)
            none = re.search(rf"no dot of [^;.]*`{label}`[^;.]* is within (\d+) in", page, re.IGNORECASE)
            assert (none is not None) == (away.min() > 24 * INCH_M), (label, step)
            if none:
                assert float(none[1]) <= away.min() / INCH_M
                nearest = min(
                    np.hypot(*(r.weighted.world_poses[:, :2] - truth[:2]).T).min()
                    for name, r in records.items()
                    if f"`{name}`" in none[0]
                )
                assert math.floor(nearest / INCH_M) == int(none[1])
        ranks = []
        for record in records.values():
            likely = record.sighting.comparison.log_likelihood
            at_place = np.hypot(*(library.poses[:, :2] - truth[:2]).T)
            turned = np.abs((library.poses[:, 2] - truth[2] + np.pi) % (2 * np.pi) - np.pi)
            entry = np.lexsort((turned, at_place.round(6)))[0]
            ranks.append(1 + int((likely > likely[entry]).sum()))
        named = re.search(r"knows the place \(rank (\d+)(?: to (\d+))? of 624\)", page)
        if named:
            assert [int(rank) for rank in named.groups() if rank] == sorted(set(ranks)), step
            known += 1
        else:
            assert max(ranks) > 6, step
    assert known > 20


def test_no_text_of_a_recording_says_that_a_run_takes_the_best_match_for_the_place(demo):
    texts = texts_of(demo[0])
    assert "where thesis is, it would see this" in texts
    assert "takes this for it" not in texts


def test_the_words_name_the_recording_also_of_a_saved_run_that_is_drawn_again(demo, tmp_path, monkeypatch):
    recording, opened = demo
    assert f"maurice-replay open {recording} --step" in texts_of(recording)
    assert "open FILE" not in texts_of(recording)
    monkeypatch.chdir(tmp_path)  # a short name has room on every page
    again = Path("again.rrd")
    mv.replay(opened.folder / "thesis", output=mv.Output(detail="light", to=again))
    assert f"maurice-replay open {again} --step 60" in texts_of(again)


@pytest.mark.parametrize(
    ("label", "name"),
    [
        ("thesis", "where thesis is, it would see this"),
        ("thesis-exact", "thesis-exact would see this"),
        ("sensor.sharpness=2.5 and more", "sensor.sharpness=2... would see this"),
    ],
)
def test_a_name_fits_beside_a_wide_map(label, name):
    assert name_of(label) == name
    assert len(name) <= LETTERS


def test_words_stand_where_no_reference_is_near_and_without_a_library(tmp_path):
    library = fakes.make_library(tmp_path)
    session = fakes.make_session(library, 1)
    ((moment, record),) = fakes.play(session, "color", 60)
    run, scene = recordings.run_of(session), recordings.scene_with(library)

    def drawn(x: float, y: float, heading: float, panel: HerePanel) -> bytes:
        estimate = replace(record.estimate, pose=np.array([x, y, heading]))
        return panel._picture(StepUpdate(moment, replace(record, estimate=estimate)))

    panel, height = HerePanel(run, scene), cell_height(library.pictures)
    x, y, heading = library.poses[8].tolist()
    assert drawn(x + 0.02, y, heading, panel) == reference_jpeg(library.pictures[8], height)
    within = f"{scene.scale.say(record.estimate.radii.right_m)} and 45 deg"
    words = f"no reference within\n{within}\nof where color is"
    assert drawn(x - 60.0, y, heading, panel) == no_picture(height, words)
    gone = recordings.scene_of(library.arena)
    empty = no_picture(cell_height(gone.library.pictures), NO_LIBRARY)
    assert drawn(x, y, heading, HerePanel(replace(run, sensor=None), gone)) == empty


def test_a_run_without_pictures_has_no_such_panel(tmp_path):
    session = fakes.make_session(fakes.make_library(tmp_path), 1)
    run = replace(recordings.run_of(session), channels=())
    scene = replace(recordings.scene_with(session.library), has_pictures=False)
    assert not any(isinstance(panel, HerePanel) for panel in panels_of(run, scene))
    with_pictures = recordings.scene_with(session.library)
    assert any(isinstance(panel, HerePanel) for panel in panels_of(run, with_pictures))


def test_the_plot_of_errors_begins_where_the_lanes_do_on_every_timeline(tmp_path):
    """The viewer's plot begins with its first value; in the last phase its cursor stood 9 pixels off."""
    library = fakes.make_library(tmp_path)
    for has_truth in (True, False):
        path = tmp_path / f"{has_truth}.rrd"
        recordings.draw(path, fakes.make_session(library, 3, has_truth=has_truth), ["color"])
        first = recordings.rows(path, LIMITS)[0]
        assert (first.step, first.phase) == (1, phase_number(1, Phase.PREDICT))


def test_no_moment_is_shaded_in_the_time_panel():
    """A blueprint has one time selection for all timelines: step 41 would be step 7 on `phase`."""
    shown = runs_blueprint([RunView("a", ("color",))], recordings.scene_of(fakes.arena(2, 2)))
    assert shown.time_panel.time_selection is None
