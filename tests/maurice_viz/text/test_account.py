"""The texts of one run, whatever happened in it: none contradicts another, and all name the same steps."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from helpers.step_records import at, made, moment
from maurice_mcl.reasons.tour import tour_of
from maurice_mcl.scoring.events import EventDetector
from maurice_mcl.scoring.table import KIDNAPPED, LOST, SEARCHING
from maurice_mcl.values.map import Arena
from maurice_mcl.values.records import Opinion
from maurice_viz.app.diagnose import RunDiagnosis
from maurice_viz.playback import ResultCollector, RunResult
from maurice_viz.style import Scale, units_named
from maurice_viz.text.causes import with_failures
from maurice_viz.text.summary import score_rows, to_json
from maurice_viz.text.tour import tour_pages
from maurice_viz.text.verdict import account, headline

ARENA = Arena((0.0, 0.0, 6.0, 6.0), np.zeros((0, 4)))

SCALE = Scale(units_named("in"))
TRUTH = (0.0, 0.0, 0.0)
CLOUDS = {
    "r": at(0, 0, 1),  # localized
    "b": at(0.7, 0, 1),  # between right and lost, sure
    "o": at(3, 0, 1),  # too far off, sure
    "s": [*at(2, 0, 0.4), *at(5, 0, 0.35), *at(8, 0, 0.25)],  # too far off, unsure
}
# what can happen for a while: a kidnapping, a loss, a search, a calm time; capital letters: doubted
TIMES = ["rrrrrr", "kooo", "kOOOOOOO", "kRrrrrr", "ooo", "oOOOOOO", "bB", "sssssssss", "rFrFrF"]


def played(letters: str) -> tuple[RunResult, list[str], dict[str, list[str]]]:
    """Follow a run of a letter a step; return its result, its states, and its texts by where they stand."""
    collector, detector = ResultCollector(["one"], ARENA), EventDetector(SCALE.say)
    events, states, times_s, carried = [], list[str](), dict[int, float](), ""
    step = 0
    for letter in letters:
        if letter == "k":
            carried = "kidnapped"
            continue
        step += 1
        fresh = letter == "F"
        record = made(
            CLOUDS["r" if fresh else letter.lower()],
            step=step,
            injected=[fresh] * 4 if fresh else None,
            events=("reseeded",) if fresh else (),
        )
        knows = 0.01 if letter.isupper() and not fresh else 0.9
        record = replace(record, opinion=Opinion(knows, 0.5))
        here = moment(record, TRUTH, *([carried] if carried else []))
        carried = ""
        collector.add(here, {"one": record})
        events += detector.see(here, record)
        states.append(detector.state)
        times_s[step] = record.frame.time_s
    (result,) = collector.results()
    verdict = result.verdict
    listed = with_failures(events, verdict.failures, times_s, SCALE)
    lessons = dict.fromkeys(times_s, "")
    texts = {
        "verdict": [headline({"one": verdict}, SCALE), *account({"one": verdict}, SCALE)],
        "table": [f"{name}: {cells[0]}" for name, cells in score_rows([result], SCALE.units)],
        "events": [f"{one.kind} at step {one.step}: {one.text}" for one in listed],
        "diagnose": [RunDiagnosis("one", verdict, Path("run"), "in").text],
        "tour": [page for _, page in tour_pages(tour_of({"one": verdict}), {"one": verdict}, SCALE, lessons)],
        "json": list(_strings(json.loads(json.dumps(to_json([result], SCALE))))),
    }
    return result, states, texts


def _strings(value: object, key: str = "") -> Iterator[str]:
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from _strings(inner, name)
    elif isinstance(value, list):
        for inner in value:
            yield from _strings(inner, key)
    elif isinstance(value, str) and key == "text":
        yield value


PHRASES = {
    "wrong": r"[Ww]rong from step (\d+)|lost or carried, wrong from: step (\d+)",
    "noticed": r"(?:noticed|doubted) without truth at step (\d+)",
    "lost": r"declared lost at step (\d+)|declared lost: at step (\d+)|^lost at step (\d+)",
    "localized": r"localized again from step (\d+)",
}


@settings(max_examples=60, deadline=None)
@given(st.lists(st.sampled_from(TIMES), min_size=1, max_size=7).map("".join), st.booleans())
def test_every_text_names_the_steps_of_the_episodes(letters, known_start):
    result, states, texts = played(("rrrrr" if known_start else "ssss") + letters)
    verdict, episodes = result.verdict, result.verdict.episodes
    for field, phrase in PHRASES.items():
        known = {getattr(one, field) for one in episodes}
        for text in (text for part in texts.values() for text in part):
            named = {int(step) for match in re.findall(phrase, text) for step in _flat(match)}
            assert named <= known, (field, text)
    numbers = {
        number
        for one in episodes
        for number in (one.first, one.last, one.wrong, one.noticed, one.lost, one.localized)
    }
    numbers |= {step for span in verdict.doubts for step in span} | {verdict.localized, verdict.most_at}
    numbers |= {one.first for one in verdict.failures} | {incident.step for incident in verdict.incidents}
    numbers |= {verdict.first, verdict.last} | _evidence(verdict)
    for part in ("verdict", "diagnose", "json"):
        for text in texts[part]:
            assert {int(step) for step in re.findall(r"steps? (\d+)", text)} <= numbers, text
            assert "update" not in text
    assert not any("update" in text for part in ("table", "events", "tour") for text in texts[part])
    _check_lanes(states, result)
    _check_end(texts["verdict"][0], result)


def _flat(match: str | tuple[str, ...]) -> list[str]:
    return [one for one in ((match,) if isinstance(match, str) else match) if one]


def _evidence(verdict) -> set[int]:
    evidence = [one.evidence for one in verdict.failures]
    keys = ("worst_step", "held_until", "died", "came", "last")
    numbers = {one[key] for one in evidence for key in keys if key in one}
    sure = verdict.sure_and_wrong
    return numbers | ({sure.step} if sure else set())


def _check_lanes(states: list[str], result: RunResult) -> None:
    """Check that the lane of states turns red where a run is declared lost, and nowhere else."""
    red = [step for step, state in enumerate(states, 1) if state == "lost"]
    declared = [one for one in result.verdict.episodes if one.lost is not None and one.kind != SEARCHING]
    for one in declared:
        assert states[one.lost - 1] == "lost"
    for step in red:
        assert any(one.lost <= step <= one.last for one in declared)
    assert result.score.lost_at_update == next(
        (one.lost for one in result.verdict.episodes if one.lost is not None), None
    )


def _check_end(text: str, result: RunResult) -> None:
    """Check that the words of the end agree with the radii that the table prints."""
    end = result.verdict.end
    said = re.search(r"(still lost|neither right nor lost|right|too far off) at the end", text)
    if said is None:
        return
    expected = "right" if end.correct else "lost" if end.lost else "neither right nor lost"
    word = {"still lost": "lost", "too far off": "lost"}.get(said[1], said[1])
    assert word == expected, text


@pytest.mark.parametrize(
    ("letters", "says"),
    [
        (
            "r" * 9 + "k" + "o" * 2 + "O" * 6,
            "noticed without truth at step 12, declared lost at step 13, not localized again",
        ),
        ("r" * 9 + "koF" + "r" * 6, "Kidnapped at step 10: the filter found itself again (at step 11"),
        ("s" * 8 + "r" * 7, "the filter found itself (at step 9"),
        ("r" * 12, "right at every step"),
    ],
)
def test_the_account_of_simple_runs(letters, says):
    result, _, texts = played(letters)
    assert any(says in text for text in texts["verdict"])
    kinds = [one.kind for one in result.verdict.episodes]
    assert set(kinds) <= {KIDNAPPED, LOST, SEARCHING}
