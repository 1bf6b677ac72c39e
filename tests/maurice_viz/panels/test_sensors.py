"""What pose sensors show reaches the recording: words, pictures, marks; emptied when they are gone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

import maurice_mcl as mcl
from helpers import expect_facts
from helpers import viz_recordings as recordings
from maurice_loaders.files.pictures import decode_picture
from maurice_mcl.values.map import Arena, Region
from maurice_mcl.values.pose_sensor import BESIDE_GAP_PX, EXACT, Beside, MovedThing, Shown, ShownMarks
from maurice_viz.layouts.registry import runs_blueprint
from maurice_viz.panels.sensors import MARK_WORDS
from maurice_viz.running.observer import RerunObserver
from maurice_viz.scene import RunView
from maurice_viz.style import AGREES, DISAGREES, RUN_COLORS, TRUTH, packed, scale_for
from maurice_viz.text.explanation_table import say_moved, thing_at
from maurice_viz.viewer import sinks


@dataclass(frozen=True)
class Beacon:
    """A sensor that shows its picture at every second frame."""

    name: str = "beacon"
    pictures: tuple[str, ...] = ("What the beacon sees", "Beside a reference")
    in_space: bool = True

    def read(self, frame):
        return frame.image if frame.step % 2 else None

    def log_likelihood(self, reading, poses, origin, spread=EXACT):
        return np.zeros(len(poses), np.float32)

    def propose(self, reading):
        return None

    def shown(self, reading, poses):
        here = np.asarray(poses["estimate"][:2], np.float32)
        lines = np.array([[[1.0, 2.0], [5.0, 6.0]]] * 2, np.float32)
        point = np.array([[[1.0, 2.0, 0.5]]], np.float32)
        return Shown(
            "Two lines, one of them agrees; {} away.",
            {self.pictures[0]: reading, self.pictures[1]: Beside(reading, 3)},
            (
                ShownMarks("lines", self.pictures[0], lines, np.array([True, False])),
                ShownMarks("true", self.pictures[0], lines[:, :1], of="truth"),
                ShownMarks("beacon", "map", np.stack([here])[None]),
                ShownMarks("beacon", "space", point, of="estimate"),
            ),
            (0.254,),
            (MovedThing(np.array([[0.5, 0.5]] * 7), np.array([0.3, 0.4])),),
        )


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    """A drive of six steps: the recording, and its run as it is shown."""
    library, session = mcl.tiny_library(), mcl.tiny_session()
    localizer = mcl.make_localizer(library, particles=60, sensors=[Beacon()]).of_session(session)
    view = RunView.of("run", localizer)
    scene = recordings.scene_with(library, "m")
    path = tmp_path_factory.mktemp("sensors") / "run.rrd"
    with sinks.to_file(path, "tiny", runs_blueprint([view], scene)) as rec:
        recordings.observe(RerunObserver(rec, view, scene), mcl.run(localizer, session))
    return path, view


def test_it_has_a_layout_of_its_own(drawn):
    plain = RunView.of("run", mcl.make_localizer(mcl.tiny_library(), particles=60))
    scene = recordings.scene_of(mcl.tiny_library().arena, "m", True)
    assert runs_blueprint([drawn[1]], scene, "sensors") is not None
    with pytest.raises(ValueError, match="sensors"):
        runs_blueprint([plain], scene, "sensors")


def test_words_say_when_a_frame_holds_nothing(drawn):
    rows = recordings.rows(drawn[0], "/run/sensors/beacon/words")
    said = [row.values["TextDocument:text"][0] for row in rows]
    assert len(said) == 6
    moved = "7 others agree with each other, 0.50 m from where the library has them."
    assert said[0::2] == [f"Two lines, one of them agrees; 0.25 m away. {moved}\n\n{MARK_WORDS}"] * 3
    assert said[1::2] == ["Beacon: nothing in this frame."] * 3


def test_marks_are_colored_by_agreement_and_emptied_when_gone(drawn):
    path = "/run/sensors/beacon/what_the_beacon_sees"
    strips = recordings.rows(drawn[0], f"{path}/lines")
    counts = [len(row.values["LineStrips2D:strips"]) for row in strips]
    assert counts == [2, 0, 2, 0, 2, 0]
    agrees, differs = strips[0].values["LineStrips2D:colors"]
    assert agrees == packed(AGREES)
    assert differs == packed(DISAGREES)
    assert recordings.rows(drawn[0], path)[0].values["EncodedImage:blob"]


def test_marks_on_the_map_are_drawn_in_display_units(drawn):
    points = recordings.rows(drawn[0], "/run/sensors/beacon/map/beacon")
    estimate = recordings.rows(drawn[0], "/run/belief/estimate")
    first = next(row for row in estimate if row.values.get("Points2D:positions"))
    assert points[0].values["Points2D:positions"] == first.values["Points2D:positions"]


def test_a_picture_stands_beside_the_reference_even_if_that_is_gone(drawn):
    alone, beside = (
        recordings.rows(drawn[0], f"/run/sensors/beacon/{name}")[0].values["EncodedImage:blob"]
        for name in ("what_the_beacon_sees", "beside_a_reference")
    )
    one, both = (decode_picture(bytes(np.asarray(blob[0], np.uint8))) for blob in (alone, beside))
    assert both.shape[1] == 2 * one.shape[1] + BESIDE_GAP_PX


def test_marks_of_a_pose_have_its_color(drawn):
    path = "/run/sensors/beacon"
    true = recordings.rows(drawn[0], f"{path}/what_the_beacon_sees/true")[0]
    assert true.values["Points2D:colors"][0] == packed(TRUTH)
    own = recordings.rows(drawn[0], f"{path}/space/beacon")[0]
    assert own.values["Points3D:colors"][0] == packed(RUN_COLORS[0])
    assert own.values["Points3D:positions"][0] == pytest.approx([1.0, 2.0, 0.5])


def test_a_thing_that_moved_has_the_name_of_the_obstacle_that_it_is():
    sofa = Region("sofa", np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]))
    arena = Arena((0.0, 0.0, 4.0, 4.0), np.zeros((0, 4)), (sofa,))
    there = MovedThing(np.array([[1.1, 0.5], [0.9, 0.4], [3.0, 3.0]]), np.array([0.0, 0.254]))
    said = say_moved(there, arena, scale_for("in", arena))
    expect_facts(said, "3 others", "the sofa", "10.0 in")
    assert thing_at(np.array([[3.0, 3.0], [3.1, 3.0]]), arena) is None
