"""The lanes of events in a recording: read back, they say what the detector said."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import rerun.blueprint as rrb

from helpers import viz_fakes as fakes
from helpers import viz_recordings as recordings
from maurice_mcl.filter.localizer import RESAMPLED
from maurice_mcl.reasons.causes import CAUSES, LIGHTING, Failure
from maurice_mcl.scoring.episodes import Episode
from maurice_mcl.scoring.events import FAILURE, KINDS, PARTED, STATES, RunEvent
from maurice_viz.entities import Phase, RunPaths, phase_number
from maurice_viz.panels import events as draw_events
from maurice_viz.panels.events import BRIEF, WORD
from maurice_viz.panels.panel import StepUpdate
from maurice_viz.scene import RunView
from maurice_viz.viewer import sinks

PATHS = RunPaths("blended")
STATE = "StateChange:state"
Step = tuple[str, list[tuple[str, str]]]  # state, kinds and texts


def drawn(
    path: Path,
    steps: Sequence[Step],
    *,
    scene: bool = True,
    hold: int = 3,
    finished: bool = True,
    live: bool = False,
    failures: Sequence[Failure] = (),
) -> Path:
    """Draw steps 1, 2, ... into a recording."""
    library = fakes.make_library()
    session = fakes.make_session(library, len(steps))
    updates = 0 if live else hold * draw_events.MARKS_A_RUN
    view = RunView(PATHS.label, ("color",), number=0 if scene else 1)
    panel = draw_events.EventsPanel(view, recordings.scene_with(library, updates=updates))
    with sinks.to_file(path, "x", rrb.Blueprint()) as rec:
        panel.prepare(rec)
        for (status, found), (moment, record) in zip(steps, fakes.play(session, "color", 5), strict=True):
            step = moment.frame.step
            events = tuple(RunEvent(step, 0.0, kind, text) for kind, text in found)
            panel.draw(rec, StepUpdate(moment, record, events, status))
        panel.diagnosed(rec, failures)
        if finished:
            panel.finish(rec)
    return path


def lane_of(path: Path, entity: str) -> list[tuple[int | None, str | None]]:
    found = recordings.rows(path, entity)
    return [(row.step, (row.values.get(STATE) or [None])[0]) for row in found]


def test_the_state_is_logged_where_it_changes(tmp_path):
    states = ["searching", "searching", "localized", "localized", "lost"]
    path = drawn(tmp_path / "a.rrd", [(state, []) for state in states])
    assert lane_of(path, draw_events.status_path(PATHS)) == [(1, "searching"), (3, "localized"), (5, "lost")]
    assert lane_of(path, draw_events.noticed_path(PATHS)) == []


def test_a_state_too_short_for_its_word_loses_it_in_the_end(tmp_path):
    states = ["localized"] * 30 + ["lost"] + ["searching"] * 3 + ["localized"] * 30
    path = drawn(tmp_path / "a.rrd", [(state, []) for state in states], finished=True)
    lane = draw_events.status_path(PATHS)
    latest = dict(lane_of(path, lane))  # of two rows at one step the later one counts
    assert latest == {1: "localized", 31: f"lost{BRIEF}", 32: "searching", 35: "localized"}
    style = recordings.static(path, lane)
    looks = {
        name: (label, color)
        for name, label, color in zip(
            *(style[f"StateConfiguration:{part}"] for part in ("values", "labels", "colors")), strict=True
        )
    }
    assert looks["lost"][0].strip() == "lost"
    assert looks[f"lost{BRIEF}"][0].strip() == ""
    assert looks["lost"][1] == looks[f"lost{BRIEF}"][1]


def test_a_mark_lasts_as_long_as_its_event_and_its_word_follows(tmp_path):
    steps: list[Step] = [("localized", []) for _ in range(14)]
    steps[1] = ("localized", [("ess-dip", "a")])
    for k in (6, 7, 8):
        steps[k] = ("localized", [("reseeded", "a")])
    path = drawn(tmp_path / "a.rrd", steps, hold=4)
    assert lane_of(path, draw_events.noticed_path(PATHS)) == [
        (2, "ess-dip"),
        (3, f"ess-dip{WORD}"),
        (6, None),
        (7, "reseeded"),
        (10, f"reseeded{WORD}"),
        (11, None),
    ]


def test_the_word_of_a_grave_mark_outlives_a_lesser_one(tmp_path):
    steps: list[Step] = [("localized", []) for _ in range(9)]
    steps[1], steps[3] = ("lost", [("lost", "a")]), ("lost", [("ess-dip", "a")])
    path = drawn(tmp_path / "a.rrd", steps, hold=5)
    assert lane_of(path, draw_events.noticed_path(PATHS)) == [
        (2, "lost"),
        (3, f"lost{WORD}"),
        (4, "ess-dip"),
        (5, f"lost{WORD}"),
        (7, None),
    ]


def test_on_the_timeline_of_phases_marks_and_states_begin_with_their_step(tmp_path):
    steps: list[Step] = [("localized", []), ("lost", [("kidnapped", "a"), ("lost", "a")])]
    path = drawn(tmp_path / "a.rrd", steps)
    for lane in (draw_events.status_path(PATHS), draw_events.noticed_path(PATHS), draw_events.LOG_LANE):
        assert recordings.rows(path, lane)[-1].phase == phase_number(2, Phase.PREDICT)


def test_of_several_marks_the_gravest_is_shown(tmp_path):
    several = [("beyond-three-sigma", "a"), ("reseeded", "a"), ("lost", "a"), ("ess-dip", "a")]
    path = drawn(tmp_path / "a.rrd", [("lost", several)])
    assert lane_of(path, draw_events.noticed_path(PATHS)) == [(1, "lost")]
    path = drawn(tmp_path / "b.rrd", [("localized", [(RESAMPLED, "a"), ("session", "floor wood")])] * 3)
    assert lane_of(path, draw_events.noticed_path(PATHS)) == []
    assert lane_of(path, draw_events.LOG_LANE) == []


def test_causes_of_failures_are_marked_at_their_first_step_and_where_it_was_lost(tmp_path):
    steps: list[Step] = [("localized", []), ("localized", [("ess-dip", "a")]), ("searching", [])]
    steps += [("lost", [])] * 3 + [("localized", [("recovered", "a")])]
    failures = [Failure(LIGHTING, 2, Episode("lost", 3, 6, 3, lost=4))]
    path = drawn(tmp_path / "a.rrd", steps, hold=2, failures=failures)
    belief = dict(
        lane_of(path, draw_events.status_path(PATHS))
    )  # of two rows at one step the later one counts
    assert belief == {1: "localized", 3: "searching", 4: "cause: lighting", 7: "localized"}
    noticed = dict(lane_of(path, draw_events.noticed_path(PATHS)))
    assert noticed == {2: "cause: lighting", 3: f"cause: lighting{WORD}", 4: None, 7: "recovered"}


def test_a_live_run_shows_its_marks_at_once(tmp_path):
    steps: list[Step] = [("localized", []), ("localized", [("ess-dip", "a")])]
    path = drawn(tmp_path / "a.rrd", steps, live=True, finished=False)
    assert lane_of(path, draw_events.noticed_path(PATHS)) == [(2, "ess-dip")]


def test_the_log_has_a_lane_that_one_run_draws(tmp_path):
    said = [("kidnapped", "the robot was carried away"), ("session", "slip +18.3 deg")]
    steps: list[Step] = [
        ("localized", said),
        ("localized", [("session", "door 雨")]),
        ("localized", [("session", "floor wood")]),
    ]
    path = drawn(tmp_path / "a.rrd", steps)
    assert lane_of(path, draw_events.LOG_LANE) == [
        (1, "kidnapped"),
        (2, "session"),
        (3, f"kidnapped{WORD}"),
    ]
    other = drawn(tmp_path / "b.rrd", steps, scene=False)
    assert draw_events.LOG_LANE not in recordings.entities_of(other)


def test_every_state_and_kind_has_a_color_and_a_name(tmp_path):
    causes = {f"{draw_events.CAUSE}{kind}" for kind in CAUSES}
    assert set(draw_events.STATUS_COLORS) == set(STATES) | causes
    shown = set(draw_events.NOTICED_COLORS) | set(draw_events.LOG_COLORS)
    assert causes < shown
    assert set(KINDS) - shown == {RESAMPLED, FAILURE}  # a failure is shown by its cause
    assert PARTED in draw_events.NOTICED_COLORS
    path = drawn(tmp_path / "a.rrd", [("localized", [])])
    for lane in (draw_events.status_path(PATHS), draw_events.noticed_path(PATHS), draw_events.LOG_LANE):
        style = recordings.static(path, lane)
        values = style["StateConfiguration:values"]
        assert (
            len(values) == len(style["StateConfiguration:colors"]) == len(style["StateConfiguration:labels"])
        )
        assert len(values) == len(set(values)) > 0


def test_marks_have_room_and_views_tell_their_colors():
    assert draw_events.hold_for(1) == draw_events.hold_for(20) == 2
    assert draw_events.hold_for(120) == 15
    assert 12_000 / draw_events.hold_for(12_000) == 8
    view = draw_events.events_view([RunView("color", ()), RunView("best", ())])
    assert "red lost" in str(view.name)
    assert list(view.contents) == ["/color/events/**", "/best/events/**", draw_events.LOG_LANE]
