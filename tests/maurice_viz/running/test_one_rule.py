"""Headline, table, lanes, events, report and JSON of runs side by side say the same of each run."""

from __future__ import annotations

import html
import json
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import pytest

import maurice_viz as mv
from helpers import viz_recordings as recordings
from helpers.small_room import write_small_room
from maurice_datasets import simulate, simulation_plan
from maurice_mcl.scoring.events import FAILURE
from maurice_mcl.scoring.table import LOCALIZED, LOST, PROBABLY_LOST, SEARCHING, WRONG
from maurice_viz.errors import SILENT
from maurice_viz.panels.events import SHARED
from maurice_viz.playback import RunResult
from maurice_viz.running.run import RunScores
from maurice_viz.running.saved import open_saved
from maurice_viz.running.saved_steps import Collected, Pictures, collect
from maurice_viz.style import STATES, Scale, packed, units_named
from maurice_viz.text.summary import short_rows
from maurice_viz.text.verdict import headline

UPDATES = 30


def without_truth(session: Path) -> Path:
    """Take away what the log says of the truth and of what happened."""
    lines = session.read_text(encoding="utf-8").splitlines(keepends=True)
    kept = [line for line in lines if not {"truth", "event"} & json.loads(line).keys()]
    session.write_text("".join(kept), encoding="utf-8")
    return session


def with_two_references(session: Path) -> Path:
    """Leave two pictures of the survey."""
    survey = session.parent / "survey" / "survey.log"
    head, *records = survey.read_text(encoding="utf-8").splitlines(keepends=True)
    pictures = [record for record in records if "image" in json.loads(record)]
    survey.write_text("".join([head, pictures[0], pictures[-1]]), encoding="utf-8")
    return session


def as_it_is(session: Path) -> Path:
    return session


Change = Callable[[Path], Path]
CASES: dict[str, tuple[str, bool, Change]] = {  # task, whether it has a laser, what is changed
    "tracking": ("tracking", False, as_it_is),
    "global": ("global", False, as_it_is),
    "kidnapped": ("kidnapped", False, as_it_is),
    "two references": ("tracking", False, with_two_references),
    "without truth": ("kidnapped", False, without_truth),
    "laser": ("kidnapped", True, as_it_is),
    "laser without truth": ("kidnapped", True, without_truth),
}


@dataclass
class Shown:
    """Two runs over a drive, in all the places that tell of them."""

    scores: RunScores
    recording: Path
    saved: Path
    page: str

    @cached_property
    def scale(self) -> Scale:
        return Scale(units_named(self.scores.display_units))

    @cached_property
    def collected(self) -> Collected:
        opened = open_saved(self.saved)
        arena = opened.scene.library.arena
        return collect(opened.restored, Pictures(opened.session), self.scale, arena, SILENT)

    @cached_property
    def text(self) -> str:
        return headline({run.label: run.verdict for run in self.scores.runs}, self.scale)

    def lane(self, number: int) -> list[tuple[int, int, str]]:
        """Return color, step and word of every step of a run's lane."""
        style = recordings.static(self.recording, SHARED)
        names, labels = style["StateConfiguration:values"], style["StateConfiguration:labels"]
        looks = dict(zip(names, zip(style["StateConfiguration:colors"], labels, strict=True), strict=True))
        rows = recordings.having(recordings.rows(self.recording, SHARED), "StateChange:state")
        begins = {row.step: looks[row.values["StateChange:state"][1 + number]] for row in rows}
        shown, now = [], (0, "")
        for step in range(1, self.scores.runs[0].score.updates + 1):
            now = begins.get(step, now)
            shown.append((int(now[0]), step, str(now[1]).strip()))
        return shown


@pytest.fixture(scope="module", params=CASES)
def shown(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Shown:
    task, laser, change = CASES[request.param]
    folder = tmp_path_factory.mktemp("drive")
    room = write_small_room(folder)
    room.write_text(room.read_text().replace("rect = [0, 0, 200, 160]", "rect = [0, 0, 340, 200]"))
    drive = simulate(
        simulation_plan(task, world="office" if laser else room, updates=UPDATES, laser=laser),
        folder / "drive",
    )
    session, recording, saved = change(drive.session), folder / "shown.rrd", folder / "saved"
    presets = ["amcl", "laser"] if laser else ["thesis", "robust"]
    scores = mv.compare(
        session, filters=[mv.Filter(value, particles=300) for value in presets], to=recording, save_run=saved
    )
    page = mv.report(saved, to=folder / "page.html").read_text(encoding="utf-8")
    return Shown(scores, recording, saved, html.unescape(page))


def written(run: RunResult, shown: Shown) -> dict[str, str]:
    """Return the cells of a run in the table, by the names of their rows."""
    number = [other.label for other in shown.scores.runs].index(run.label)
    return {name: cells[number] for name, cells in short_rows(shown.scores.runs, shown.scale.units)}


def of_json(run: RunResult, shown: Shown) -> dict[str, Any]:
    facts: dict[str, Any] = json.loads(json.dumps(shown.scores.to_json()))
    return next(facts for facts in facts["runs"] if facts["label"] == run.label)


def test_the_lane_shows_the_states_that_are_counted_and_the_episodes(shown: Shown) -> None:
    for number, run in enumerate(shown.scores.runs):
        lane, verdict, states = shown.lane(number), run.verdict, shown.collected.tracks[number].table.states
        failed = {s for f in verdict.failures for s in range(f.episode.first, f.episode.last + 1)}
        for (color, step, word), state in zip(lane, states, strict=True):
            red = state in (LOST, PROBABLY_LOST) or (not verdict.has_truth and step in failed)
            if not red:
                assert color == packed(STATES[state]), (run.label, step, word)
        localized = sum(state == LOCALIZED for state in states)
        facts, cells = of_json(run, shown), written(run, shown)
        if verdict.has_truth:
            assert verdict.sure == localized
            assert cells["localized"] == f"{localized / len(states):.0%}"
            assert facts["localized_share"] == pytest.approx(localized / len(states))
        else:
            doubted = {s for first, last in verdict.doubts for s in range(first, last + 1)}
            assert doubted == {step for color, step, _ in lane if color == packed(STATES[LOST])}
            spans = facts["knows_where_it_is"]["probably_lost"]
            assert [(span["from_step"], span["to_step"]) for span in spans] == list(verdict.doubts)
            assert (cells["probably lost"] == "no") == (not doubted)


def test_lost_or_not_and_from_which_step_is_one_fact(shown: Shown) -> None:
    for number, run in enumerate(shown.scores.runs):
        verdict, facts, cells = run.verdict, of_json(run, shown), written(run, shown)
        states, events = shown.collected.tracks[number].table.states, shown.collected.tracks[number].events
        declared = [episode.lost for episode in verdict.episodes if episode.lost is not None]
        assert facts["lost_at_step"] == (declared[0] if declared else None)
        assert [event.step for event in events if event.kind == LOST] == declared
        lost = [episode for episode in verdict.episodes if episode.kind != SEARCHING and episode.lost]
        assert (LOST in states) == bool(lost)
        if lost:
            assert states.index(LOST) + 1 == lost[0].lost
            assert cells["lost"].startswith(f"at step {lost[0].lost}")
        elif verdict.has_truth:
            assert cells["lost"].startswith("no") or cells["lost"] == "never localized"
        never = verdict.has_truth and verdict.localized is None
        assert facts["localized_at_step"] == verdict.localized
        assert cells.get("lost") != "never localized" or never


def test_the_cause_is_one_in_all_places(shown: Shown) -> None:
    assert not shown.text.replace("`", "") or shown.text.replace("`", "") in shown.page
    for number, run in enumerate(shown.scores.runs):
        verdict, facts, cells = run.verdict, of_json(run, shown), written(run, shown)
        titles = list(dict.fromkeys(failure.title for failure in verdict.failures))
        assert cells["why"] == (", ".join(titles) or "-")
        assert [f["kind"] for f in facts["verdict"]["failures"]] == [f.kind for f in verdict.failures]
        events = shown.collected.tracks[number].events
        causes = [(event.step, event.text.split(":")[0]) for event in events if event.kind == FAILURE]
        assert sorted(causes) == sorted((f.first, f.kind) for f in verdict.failures)
        words = {word for _, _, word in shown.lane(number)}
        named = {
            word.split(": ")[1]
            for word in words
            if word.startswith((LOST, "probably lost:")) and ": " in word
        }
        assert named <= set(titles)
        again = shown.collected.results[number].verdict
        assert [(f.kind, f.first) for f in again.failures] == [(f.kind, f.first) for f in verdict.failures]


def test_words_of_the_headline_hold_of_the_lane(shown: Shown) -> None:
    sentences = {
        label: sentence
        for sentence in re.split(r"(?<=[.)])\s(?=`)", shown.text)
        for label in re.findall(r"`(\w+)`", sentence.split("(")[0])
    }
    for number, run in enumerate(shown.scores.runs):
        said, verdict, states = sentences[run.label], run.verdict, shown.collected.tracks[number].table.states
        share = states.count(LOCALIZED) / len(states)
        if "never lost" in said or ("right at every step" in said and "sure of it" not in said):
            assert share >= 0.5
            assert LOST not in states
        if "stayed lost" in said:
            assert states[-1] != LOCALIZED
            assert verdict.end is not None
            assert verdict.end.lost
        if "sure of a wrong place" in said:
            words = " ".join(word for _, _, word in shown.lane(number))
            assert WRONG in states or "sure of a wrong place" in words
        if "never localized" in said:
            assert verdict.localized is None
        if "probably lost" in said:
            assert str(verdict.doubts[0][0]) in re.findall(r"\d+", said)
        if match := re.search(r"at only (\d+)", said):
            assert int(match[1]) == states.count(LOCALIZED)
