"""The lanes of a recording: read back, they say what the detector said, by name, in the order of the runs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
import rerun.blueprint as rrb

from helpers import viz_fakes as fakes
from helpers import viz_recordings as recordings
from maurice_mcl.filter.localizer import RESAMPLED
from maurice_mcl.reasons.causes import CAUSES, LIGHTING, UNKNOWN, Failure
from maurice_mcl.scoring.episodes import Episode
from maurice_mcl.scoring.events import FAILURE, KINDS, RunEvent
from maurice_mcl.scoring.table import STATES
from maurice_viz.entities import Phase, RunPaths, phase_number
from maurice_viz.panels import events as draw_events
from maurice_viz.panels.events import MOST_NAMES, NAMES, NOTHING, SHARED, LanesDrawing, own_path
from maurice_viz.panels.panel import StepUpdate
from maurice_viz.scene import RunView, Scene, numbered
from maurice_viz.style import CARRIED, GROUND, PALE, font_safe, packed
from maurice_viz.style import STATES as STATE_COLORS
from maurice_viz.viewer import sinks

LABELS = ("blended", "color")
OWN = own_path(RunPaths(LABELS[0]))
LOG, STATUS, NOTICED = range(3)  # the lanes of one run
Step = tuple[str, list[tuple[str, str]]]  # state, kinds and texts


def drawn(
    path: Path,
    *runs: Sequence[Step],
    failures: Sequence[Failure] = (),
    finished: bool = True,
    labels: Sequence[str] = LABELS,
) -> Path:
    """Draw steps 1, 2, ... of some runs into a recording; the failures are the first one's."""
    library = fakes.make_library()
    session = fakes.make_session(library, len(runs[0]))
    views = numbered(RunView(label, ()) for label in labels[: len(runs)])
    with sinks.to_file(path, "x", rrb.Blueprint()) as rec:
        lanes = LanesDrawing(rec, views, Scene(session.info, library, True))
        for row, (moment, record) in enumerate(fakes.play(session, "color", 5)):
            updates = []
            for state, events in (steps[row] for steps in runs):
                told = tuple(RunEvent(moment.frame.step, 0.0, kind, text) for kind, text in events)
                updates.append(StepUpdate(moment, record, told, state))
            lanes.see(updates)
        if finished:
            lanes.end({"blended": failures})
    return path


def heads_of(path: Path) -> list[str]:
    """Return the names that stand left of the lanes of all runs, from top to bottom."""
    style = recordings.static(path, NAMES)
    words = dict(zip(style["StateConfiguration:values"], style["StateConfiguration:labels"], strict=True))
    (row,) = recordings.having(recordings.rows(path, NAMES), "StateChange:state")
    return [words[name] for name in row.values["StateChange:state"]]


def lane_of(path: Path, lane: int, entity: str = OWN) -> list[tuple[int | None, str]]:
    """Return the words of a lane, from the step on at which each begins; " ": there is no room for one."""
    style = recordings.static(path, entity)
    words = dict(zip(style["StateConfiguration:values"], style["StateConfiguration:labels"], strict=True))
    rows = recordings.having(recordings.rows(path, entity), "StateChange:state")
    names = [(row.step, row.values["StateChange:state"][lane]) for row in rows]
    begins = [k for k, (_, name) in enumerate(names) if k == 0 or name != names[k - 1][1]]
    return [(names[k][0], words.get(names[k][1], "")) for k in begins]


def test_lanes_stand_in_the_order_of_the_runs_under_their_names(tmp_path):
    lost, found = [("lost", [])] * 4, [("searching", []), *[("localized", [])] * 3]
    path = drawn(tmp_path / "a.rrd", lost, found)
    assert heads_of(path) == ["log", "blended", "color"]
    assert lane_of(path, 1, SHARED) == [(1, "lost")]
    assert lane_of(path, 2, SHARED) == [(1, "searching"), (2, "localized")]
    assert lane_of(path, STATUS, own_path(RunPaths("color"))) == lane_of(path, 2, SHARED)
    runs = numbered([RunView("blended", ()), RunView("color", ())])
    colors = recordings.static(path, NAMES)["StateConfiguration:colors"]
    assert list(colors[1:]) == [packed(run.color) for run in runs]


def test_a_run_may_have_any_name(tmp_path):
    """One like a lane's own, or one that the viewer has no letters for, which would end it."""
    lost, localized = [("lost", [])] * 3, [("localized", [])] * 3
    path = drawn(tmp_path / "a.rrd", lost, localized, labels=("log", "走"))
    assert heads_of(path) == ["log", "log", font_safe("走")]
    assert (lane_of(path, 1, SHARED), lane_of(path, 2, SHARED)) == ([(1, "lost")], [(1, "localized")])
    values = recordings.static(path, SHARED)["StateConfiguration:values"]
    assert all(value == font_safe(value) for value in values)


def test_a_state_too_short_for_its_word_loses_it_when_the_length_is_known(tmp_path):
    states = ["localized"] * 30 + ["lost"] + ["searching"] * 5 + ["localized"] * 30
    steps: list[Step] = [(state, []) for state in states]
    path = drawn(tmp_path / "a.rrd", steps)
    assert lane_of(path, STATUS) == [(1, "localized"), (31, " "), (32, "searching"), (37, "localized")]
    so_far = drawn(tmp_path / "b.rrd", steps, finished=False)
    assert [word for _, word in lane_of(so_far, STATUS)] == ["localized", "lost", "searching", "localized"]


def test_an_event_lasts_as_long_as_it_is_told_and_its_word_follows_where_it_is_too_narrow(tmp_path):
    steps: list[Step] = [("localized", []) for _ in range(60)]
    steps[1] = ("localized", [("ess-dip", "a")])
    for row in range(10, 20):
        steps[row] = ("localized", [("reseeded", "a")])
    path = drawn(tmp_path / "a.rrd", steps)
    expected = [(1, ""), (2, " "), (3, "few heavy"), (11, "reseeded"), (21, " ")]
    assert lane_of(path, NOTICED) == expected


def test_on_the_timeline_of_phases_all_begins_with_its_step(tmp_path):
    steps: list[Step] = [("localized", []), ("lost", [("kidnapped", "a"), ("lost", "a")])]
    path = drawn(tmp_path / "a.rrd", steps)
    for entity in (SHARED, OWN):
        assert recordings.rows(path, entity)[-1].phase == phase_number(2, Phase.PREDICT)


def test_of_several_events_the_gravest_is_shown_and_routine_ones_are_not(tmp_path):
    several = [("lost", "a"), ("beyond-three-sigma", "a"), ("ess-dip", "a"), ("reseeded", "a")]
    path = drawn(tmp_path / "a.rrd", [("lost", several)])
    assert lane_of(path, NOTICED) == [(1, "lost")]
    path = drawn(tmp_path / "b.rrd", [("localized", [(RESAMPLED, "a"), ("session", "floor wood")])] * 3)
    assert [lane_of(path, lane) for lane in (LOG, NOTICED)] == [[(1, "")]] * 2


def test_where_a_run_was_lost_its_lane_says_why(tmp_path):
    steps: list[Step] = [("localized", []), ("localized", []), ("searching", [])]
    steps += [("lost", [])] * 9 + [("localized", [])] * 3
    failures = [Failure(LIGHTING, 2, Episode("lost", 3, 12, 3, lost=4))]
    path = drawn(tmp_path / "a.rrd", steps, steps, failures=failures)
    why = [(1, "localized"), (3, "searching"), (4, "lost: the light changed"), (13, "localized")]
    assert lane_of(path, STATUS) == why
    assert lane_of(path, 1, SHARED) == lane_of(path, STATUS)
    assert dict(lane_of(path, 2, SHARED))[4] == "lost"  # the other run has no known cause


@pytest.mark.parametrize("last", [30, 60])
def test_a_run_that_is_doubted_only_at_the_end_is_lost_in_its_lane_from_that_step_on(tmp_path, last):
    steps: list[Step] = [("converged", []) for _ in range(60)]
    doubt = Failure(LIGHTING, 20, Episode("probably-lost", 20, last, 20, noticed=20), truth_known=False)
    path = drawn(tmp_path / "a.rrd", steps, failures=[doubt])
    after = [] if last == 60 else [(31, "dots together")]
    why = [(1, "dots together"), (20, "probably lost: the light changed"), *after]
    assert lane_of(path, STATUS) == lane_of(path, 1, SHARED) == why


def test_a_lane_that_another_parts_has_its_word_where_most_room_is(tmp_path):
    steps: list[Step] = [("converged", []) for _ in range(60)]
    steps[24] = ("converged", [("reseeded", "a")])
    doubt = Failure(LIGHTING, 20, Episode("probably-lost", 20, 60, 20, noticed=20), truth_known=False)
    path = drawn(tmp_path / "a.rrd", steps, failures=[doubt])
    latest = dict(lane_of(path, STATUS))
    why = {1: "dots together", 20: " ", 25: " ", 26: "probably lost: the light changed"}
    assert latest == why
    style = recordings.static(path, OWN)
    colors = dict(zip(style["StateConfiguration:labels"], style["StateConfiguration:colors"], strict=True))
    assert colors[why[26]] == packed(STATE_COLORS["lost"])


def test_the_log_says_how_far_a_robot_was_carried(tmp_path):
    steps: list[Step] = [("localized", []), ("localized", [("kidnapped", "the robot was carried away")])]
    steps += [("localized", [])] + [("localized", [("session", "bump")])] * 3
    path = drawn(tmp_path / "a.rrd", steps)
    words = [word for _, word in lane_of(path, LOG)]
    assert words[1].startswith("kidnapped: carried ")
    assert words[-1] == "bump"
    assert lane_of(path, 0, SHARED) == lane_of(path, LOG)


def colors_of(path: Path, lane: int) -> dict[int | None, int]:
    """Return the colors of a lane of the first run, by the step at which each begins."""
    style = recordings.static(path, OWN)
    colors = dict(zip(style["StateConfiguration:values"], style["StateConfiguration:colors"], strict=True))
    rows = recordings.having(recordings.rows(path, OWN), "StateChange:state")
    return {row.step: colors.get(row.values["StateChange:state"][lane], 0) for row in rows}


def test_a_kidnapping_is_seen_among_other_events_and_its_word_begins_right_after_it(tmp_path):
    """As in a drive by hand: the robot bumps, is carried away, and is driven on at once."""
    steps: list[Step] = [("localized", []) for _ in range(40)]
    for row, text in enumerate(["slip", "bump"], start=9):
        steps[row] = ("localized", [("session", text)])
    steps[11] = ("lost", [("kidnapped", "the robot was carried away")])
    for row, text in enumerate(["teleoperation", "slip"], start=12):
        steps[row] = ("lost" if row > 12 else "searching", [("session", text)])
    path = drawn(tmp_path / "a.rrd", steps)
    words = {step: word for step, word in lane_of(path, LOG) if word.strip()}
    assert [*words] == [13]  # the events of steps 13 and 14 have no marks
    assert words[13].startswith("kidnapped: carried ")
    colors = colors_of(path, LOG)
    assert colors[12] == packed(CARRIED)
    assert colors[10] == colors[11] == packed(PALE)
    assert colors[13] == packed(GROUND)
    assert lane_of(path, 0, SHARED) == lane_of(path, LOG)


def test_where_not_all_words_have_room_the_gravest_stays(tmp_path):
    steps: list[Step] = [("localized", []) for _ in range(100)]
    steps[49] = ("localized", [("session", "branch with preset robust")])
    steps[50] = ("localized", [("kidnapped", "the robot was carried away")])
    steps[60] = ("localized", [("session", "slip")])
    path = drawn(tmp_path / "a.rrd", steps)
    assert (52, "kidnapped") in lane_of(path, LOG)


def test_where_the_whole_word_has_no_room_its_first_part_may_have(tmp_path):
    steps: list[Step] = [("localized", []) for _ in range(100)]
    steps[50:60] = [("lost", [])] * 10
    failures = [Failure(LIGHTING, 51, Episode("lost", 51, 60, 51, lost=51))]
    path = drawn(tmp_path / "a.rrd", steps, failures=failures)
    assert lane_of(path, STATUS)[1] == (51, "lost")


def test_a_drive_with_very_many_changes_keeps_its_colors_and_few_names(tmp_path):
    states = ["localized", "lost"] * (2 * MOST_NAMES)
    path = drawn(tmp_path / "a.rrd", [(state, []) for state in states])
    style = recordings.static(path, OWN)
    assert len(style["StateConfiguration:values"]) <= MOST_NAMES + 4
    colors = dict(zip(style["StateConfiguration:values"], style["StateConfiguration:colors"], strict=True))
    rows = recordings.having(recordings.rows(path, OWN), "StateChange:state")
    shown = [colors[row.values["StateChange:state"][STATUS]] for row in rows]
    assert shown == [packed(STATE_COLORS[state]) for state in states]


@pytest.mark.parametrize("state", STATES)
def test_every_state_has_a_color_and_a_word(state):
    look = draw_events.look_of_state(state)
    assert look.word
    assert look != NOTHING


def test_every_cause_and_kind_of_event_has_a_word():
    words = {
        draw_events.look_of_state("lost", Failure(cause, 2, Episode("lost", 3, 12, 3))).word
        for cause in CAUSES
    }
    assert len(words) == len(CAUSES)
    assert draw_events.look_of_state("lost", Failure(UNKNOWN, 2, Episode("lost", 3, 12, 3))).word == "lost"
    lanes = {name for name, kind in KINDS.items() if kind.lanes}
    assert set(KINDS) - lanes == {
        RESAMPLED,
        FAILURE,
    }  # a failure is told in the lane of its run
    assert all(draw_events.word_of(name) for name in lanes)


def test_names_stand_left_of_the_lanes_at_any_time():
    names, lanes = draw_events.lanes_view(SHARED).contents
    assert (list(names.contents), list(lanes.contents)) == ([NAMES], [SHARED])
    assert np.isclose(sum(draw_events.lanes_view(SHARED).column_shares), 1)
