from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rich.console import Console

import maurice_mcl as mcl
import maurice_viz as mv
from helpers import expect_facts
from helpers import viz_fakes as fakes
from maurice_mcl.filter.estimate import weighted_mean
from maurice_mcl.filter.recovery import DRAWS_EVENLY, DRAWS_NEVER
from maurice_mcl.reasons.causes import Incident
from maurice_mcl.reasons.verdict import RunVerdict
from maurice_mcl.scoring.episodes import Episode
from maurice_mcl.scoring.metrics import Success, score_table
from maurice_mcl.scoring.table import TableRows
from maurice_mcl.sensor.landmarks.camera import PinholeCamera
from maurice_mcl.sensor.landmarks.sensor import Landmarks
from maurice_mcl.values.records import PICTURE, Belief, Estimate, RecoveryTest, uniform_log_weights
from maurice_mcl.values.session import Frame
from maurice_viz.cli.replay import to_table
from maurice_viz.entities import Phase
from maurice_viz.playback import RunResult
from maurice_viz.running import run
from maurice_viz.style import UNITS, Scale, units_named
from maurice_viz.text import phases as narrate
from maurice_viz.text import summary
from maurice_viz.text.explanation_table import say_other_shape
from maurice_viz.text.summary import to_json

INCHES = Scale(UNITS["in"])
INCH = 0.0254


def estimate(x_in: float, y_in: float, heading_deg: float) -> Estimate:
    pose = np.array([x_in * INCH, y_in * INCH, np.radians(heading_deg)])
    return Estimate(pose, (0.1, 0.1), 0.1, 1.0, 0.25, 0.5)


@pytest.mark.parametrize(
    ("motions", "said"),
    [
        (np.zeros((0, 3)), "no movement"),
        ([[18 * INCH, 0, 0]], "18.0 in forward"),
        ([[-18 * INCH, 0, 0]], "18.0 in backward"),
        ([[0, 0, np.pi / 4]], "a turn of 45 deg left"),
        ([[0, 0, -np.pi / 4], [INCH, 0, 0]], "1.0 in forward and a turn of 45 deg right (2 movements)"),
        ([[0, -INCH, 0]], "1.0 in to the right"),
        ([[INCH, 0.04 * INCH, np.radians(0.4)]], "1.0 in forward"),  # what would be written as 0
    ],
)
def test_motion(motions, said):
    assert narrate.motion(np.array(motions), INCHES) == said


def test_spread_errors_and_reseeding_by_hand():
    poses = np.array([[3, 0, 0], [-3, 0, 0], [0, 4, 0], [0, -4, 0]], np.float32)
    poses[:, :2] *= INCH
    cloud = weighted_mean(Belief(poses, uniform_log_weights(4), np.zeros(2)))
    assert narrate.spread(cloud, INCHES) == "3.5 in"  # the root of 12.5
    text = narrate.say_estimate(
        SimpleNamespace(estimate=estimate(3, 4, 179)), np.array([0, 0, np.radians(-179)]), INCHES
    )
    assert "error 5.0 in, 2 deg" in text
    ((_, record),) = fakes.play(fakes.make_session(fakes.make_library(), 1), "color", 6)
    fresh = np.array([0, 0, 0, 0, 1, 1], bool)
    said = narrate.reseeded(fakes.changed(record, injected=fresh), DRAWS_EVENLY)
    assert said.startswith("2 of 6 dots are new (pink), drawn anywhere on the map.")
    assert "never draws" in narrate.reseeded(record, DRAWS_NEVER)
    test = RecoveryTest(PICTURE, -9.14, -10.73)
    kept = fakes.changed(record, recovery_test=test)
    assert "no new dots" in narrate.reseeded(kept, DRAWS_EVENLY)
    moved = fakes.changed(kept, events=("expanded",))
    assert "every dot is moved at random" in narrate.reseeded(moved)


def test_summaries_have_units_and_no_unknown_error():
    ((moment, record),) = fakes.play(fakes.make_session(fakes.make_library(), 1), "color", 50)
    truth = np.array([10 * INCH, 20 * INCH, 0.0])
    moment = fakes.changed(moment, truth=truth, events=("kidnapped",))
    record = fakes.changed(record, estimate=estimate(13, 24, 10), effective_sample_size=25.0)
    said = narrate.summary(moment, record, INCHES)
    best = int(record.sighting.comparison.quality.argmax())
    assert said.startswith("**Step 1 · 2.5 s** · kidnapped\n\n")
    expect_facts(said, "(13.0, 24.0) in, 10 deg", "25%", "error 5.0 in, 10 deg")
    expect_facts(said, f"entry {best}", f"{record.sighting.comparison.quality[best]:.3f}")
    expect_facts(said, "25 of 50 (50%)", "Resampled")
    assert len(said) < 320
    said = narrate.say_estimate(fakes.play(fakes.make_session(fakes.make_library(), 1))[0][1], None, INCHES)
    assert "truth not known" in said
    assert "error" not in said


def test_events_and_phases_are_told():
    ((moment, record),) = fakes.play(fakes.make_session(fakes.make_library(), 1), "color", 6)
    copied = fakes.changed(record, parents=np.array([0, 0, 0, 4, 4, 5], np.int32))
    said = narrate.resampled(copied)
    assert said.startswith("3 of 6 dots survive, the heaviest with 3 copies; 3 die.")
    assert "none can be weighed" in narrate.weighted(fakes.changed(record, events=("all weights zero",)))
    heavy = Belief(record.weighted.poses, np.log([0.5, 0.3, 0.05, 0.05, 0.05, 0.05]), np.zeros(2))
    said = narrate.weighted(fakes.changed(record, weighted=heavy, effective_sample_size=2.9))
    assert said.startswith("1 of 6 dots now hold half of the weight; 4 weigh less than half the average.")
    assert "3.0 times the average" in said
    for slot in Phase:
        words = narrate.phase_words(moment, record, slot, INCHES)
        assert words.startswith(f"Step 1, {slot + 1} {slot.name.lower()}: ")
        assert len(words) < 260
    assert narrate.whole_step(moment, record, INCHES).startswith("Step 1, left: odometry says")


ROWS = ("localized (thesis, sd < 10 %)", "localized (thesis, one foot)")


def _result(*success):
    return RunResult("one", replace(score_table(TableRows().table()), success=success), None)


def _cells(result):
    console = Console(width=100)
    with console.capture() as capture:
        console.print(to_table([result], units_named("in"), "drive", console, all_rows=True))
    lines = [[c.strip() for c in line.strip("│").split("│")] for line in capture.get().splitlines()]
    found = {line[0]: line[1] for line in lines if len(line) == 2}
    return [found[row] for row in ROWS]


def test_four_runs_stay_readable_in_80_columns():
    console = Console(width=80)
    long = replace(_result(Success("tenth"), Success("circle", 24, 2.54, 215.2)), label="gain_color")
    with console.capture() as capture:
        console.print(to_table([long] * 4, units_named("in"), "drive", console, all_rows=True))
    lines = capture.get().splitlines()
    assert max(map(len, lines)) <= 80
    assert any(line.split() == ["gain_color"] * 4 for line in lines)
    assert any(line.count("100.0 in,") == 4 for line in lines)


SHOWN = {
    "step 24, 100.0 in, 215 s": Success("circle", 24, 2.54, 215.2),
    "left the truth at step 30": Success("circle", 24, 2.54, 215.2, "left", 30),
    "no, 5 min over": Success("circle", failed="time", failed_at_step=40),
    "no": Success("circle"),
}


@pytest.mark.parametrize("shown", SHOWN)
def test_the_row_says_when_or_how_it_failed(shown):
    assert _cells(_result(Success("tenth"), SHOWN[shown])) == ["no", shown]


def test_json_has_all_of_it():
    assert _cells(_result()) == ["-", "-"]
    assert to_json([_result()], INCHES)["runs"][0]["thesis_success"] == {}
    left = _result(Success("tenth"), SHOWN["left the truth at step 30"])
    found = to_json([left], INCHES)["runs"][0]["thesis_success"]
    nothing = dict.fromkeys(("at_step", "at_m", "at_s", "failed", "failed_at_step"))
    expected = {"at_step": 24, "at_m": 2.54, "at_s": 215.2, "failed": "left", "failed_at_step": 30}
    assert found == {"tenth": nothing, "circle": expected}


def test_json_tells_what_befell_the_robot():
    slip = Incident("slipped", 34, 37, 1.43, 0.27)
    (told,) = to_json([replace(_result(), verdict=RunVerdict(incidents=(slip,)))], INCHES)["runs"]
    (cause,) = told["verdict"]["causes"]
    assert cause == {"kind": "slipped", "step": 34, "last": 37, "expected": 1.43, "actual": 0.27} | {
        "words": "", "alike": False
    }  # fmt: skip


CAMERA = SimpleNamespace(fit=SimpleNamespace(camera=PinholeCamera(176, 144, 188.0)))


def frame(width: int, height: int) -> Frame:
    return Frame(1, 0.0, np.zeros((0, 3)), np.zeros((height, width, 3), np.uint8), "")


@pytest.mark.parametrize(("size", "told"), [((176, 144), False), ((352, 288), False), ((320, 180), True)])
def test_only_pictures_of_another_shape_are_told(size: tuple[int, int], told: bool) -> None:
    sensor: Any = Landmarks(CAMERA)  # type: ignore[arg-type]
    said = say_other_shape(frame(*size), [sensor])
    assert (said is not None) == told
    if said is not None:
        assert "pictures of 320 x 180" in said
        assert "of 176 x 144" in said
    assert say_other_shape(frame(*size), []) is None


def test_it_is_said_once_a_replay(small_session: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    said = list[str]()
    listener = SimpleNamespace(
        warning=said.append, remark=lambda text: None, progress=lambda done, total, what: None
    )
    monkeypatch.setattr(run, "say_other_shape", lambda frame, sensors: "of another shape")
    mv.replay(small_session, filter=mv.Filter(particles=50), listener=listener)
    assert said.count("of another shape") == 1


@pytest.fixture(scope="module")
def score():
    return mcl.score(mcl.run(mcl.make_localizer(mcl.tiny_library()), mcl.tiny_session()))


@pytest.mark.parametrize(
    ("episodes", "says"),
    [
        ([Episode("lost", 2, 9, 2, lost=5)], "at step 5"),
        ([Episode("searching", 1, 9, lost=5)], "never localized"),
        ([Episode("searching", 1, 9, lost=5, localized=10)], "no, localized from step 10"),
        ([Episode("searching", 1, 9, lost=5, localized=10), Episode("lost", 20, 30, lost=23)], "at step 23"),
        ([], "no"),
    ],
)
def test_a_run_that_was_lost_before_it_was_ever_localized_was_searching(score, episodes, says):
    verdict = RunVerdict(episodes=tuple(episodes))
    assert summary._lost(SimpleNamespace(score=score, verdict=verdict)) == says
