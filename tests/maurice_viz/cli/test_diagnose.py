"""`diagnose` as a person types it: a healthy run, and one whose truth jumps, saved or filtered for it."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest

import maurice_viz as mv
from helpers.commands import run
from helpers.small_session import write_small_session, write_small_survey
from maurice_datasets.sessions import write_simulation
from maurice_datasets.simulation import SimulationPlan
from maurice_datasets.tasks import TASKS
from maurice_datasets.trials.engine import run_plan
from maurice_datasets.trials.plan import read_plan
from maurice_datasets.trials.table import load_trials
from maurice_loaders import open_library, open_session
from maurice_loaders.runs.store import open_run
from maurice_mcl.reasons import diagnosis
from maurice_mcl.reasons.diagnosis import DiagnosisBuilder
from maurice_mcl.scoring.episodes import Episode
from maurice_viz.app.diagnose import diagnose
from maurice_viz.running.saved import open_saved
from maurice_viz.style import Scale, units_named
from maurice_viz.text.causes import failure_event, say_cause


def carried(log: Path, since: int) -> Path:
    """Write the log again with the truth half a meter elsewhere from a picture on."""
    lines, seen = [], 0
    for line in log.read_text().splitlines():
        record = json.loads(line)
        seen += "image" in record
        if "truth" in record and seen >= since:
            record["truth"] = [record["truth"][0] + 1.2, *record["truth"][1:]]
        lines.append(json.dumps(record))
    out = log.with_name("carried.log")
    out.write_text("\n".join(lines) + "\n")
    return out


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Give a folder with a session, one whose truth jumps, and a saved run of that."""
    folder = tmp_path_factory.mktemp("diagnosed")
    write_small_survey(folder)
    log = write_small_session(folder)
    mv.replay(carried(log, 6), filter=mv.Filter(particles=200), save_run=folder / "kept")
    return folder


def test_a_healthy_session_has_no_failure(small_session: Path) -> None:
    done = run("diagnose", small_session, "--particles", 200)
    assert "No failure" in done.stdout


def test_a_saved_run_and_its_session_have_the_same_cause(made: Path) -> None:
    saved = json.loads(run("diagnose", made / "kept", "--json").stdout)
    anew = json.loads(run("diagnose", made / "carried.log", "--particles", 200, "--json").stdout)
    assert saved["runs"][0]["failures"] == anew["runs"][0]["failures"]
    (found,) = saved["runs"][0]["failures"]
    assert (found["kind"], found["truth_known"]) == ("kidnapped", True)
    assert found["text"].startswith(f"Wrong from step {found['episode']['wrong']}")
    assert found["evidence"]["moved_m"] == pytest.approx(1.2, abs=0.3)


def test_the_words_name_step_numbers_and_the_commands_that_show_it(made: Path) -> None:
    text = run("diagnose", made / "kept").stdout
    (found,) = mv.diagnose(made / "kept").runs[0].failures
    assert "unseen by its odometry" in text
    assert f"maurice-replay explain {made / 'kept'} --step {found.first}" in text


def test_options_of_the_filter_do_not_apply_to_a_saved_run(made: Path) -> None:
    assert (
        "a saved run is replayed as it was"
        in run("diagnose", made / "kept", "--particles", 9, expect=2).stderr
    )


def test_every_place_tells_the_same_failures(made: Path) -> None:
    kept = made / "kept"
    (found,) = mv.diagnose(kept).runs[0].failures
    (event,) = mv.events(kept, kinds=["failure"]).runs[0].events
    scale = Scale(units_named(mv.diagnose(kept).runs[0].display_units))
    assert (event.step, event.text) == (found.first, failure_event(found, event.time_s, scale).text)
    assert event.text.startswith("kidnapped: the robot was carried")
    (saved,) = open_run(kept).manifest.failures or ()
    assert saved == found == mv.replay(kept).runs[0].verdict.failures[0]
    rows = json.loads(run("inspect", kept, "--json").stdout)["runs"][0]["events"]
    (row,) = (row for row in rows if row["kind"] == "failure")
    assert row["text"] == event.text
    assert say_cause(found, scale).split(" at ")[0] in mv.diagnose(kept).text


def test_a_run_without_failure_has_none_anywhere(small_session: Path, tmp_path: Path) -> None:
    scores = mv.replay(small_session, filter=mv.Filter(particles=200), save_run=tmp_path / "kept")
    assert open_run(tmp_path / "kept").manifest.failures == scores.runs[0].verdict.failures == ()
    assert not mv.events(tmp_path / "kept", kinds=["failure"]).runs[0].events
    assert mv.diagnose(tmp_path / "kept").runs[0].failures == ()


EPISODE = asdict(Episode("lost", 2, 4, 2))


@pytest.mark.parametrize(
    ("failures", "said"),
    [
        ([{"kind": "data", "first": 0, "episode": EPISODE}], "found a failure from step 0 to 4"),
        ([{"kind": "bad luck", "first": 1, "episode": EPISODE}], "found cause 'bad luck', expected one of"),
        ([{"kind": "data", "first": 99, "episode": EPISODE}], "expected 1 to 14"),
        ([{"kind": "data", "first": 1, "episode": {"kind": "bored"}}], "found episode 'bored', expected"),
        ([{"kind": "data", "first": 1, "episode": EPISODE | {"lost": "x"}}], "found failures.episode.lost"),
        ("none", "found failures 'none', expected a list"),
    ],
)
def test_damaged_failures_are_told_in_one_line(made: Path, failures: object, said: str) -> None:
    file = made / "kept" / "manifest.json"
    whole = file.read_text()
    try:
        file.write_text(json.dumps(json.loads(whole) | {"failures": failures}))
        done = run("inspect", made / "kept", expect=1)
    finally:
        file.write_text(whole)
    assert said in done.stderr
    assert done.stderr.count("\n") == 1


def test_light_which_costs_a_comparison_is_looked_for_only_where_a_run_was_lost(
    made: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pictures = []
    real = diagnosis.light_fit
    monkeypatch.setattr(diagnosis, "light_fit", lambda *a: pictures.append(a) or real(*a))
    mv.replay(made / "session.log", filter=mv.Filter(particles=200))
    assert pictures == []
    mv.diagnose(made / "kept")
    assert pictures


def test_a_diagnosis_asked_for_at_every_update_ends_as_one_asked_for_once(made: Path) -> None:
    opened = open_saved(made / "kept")
    often, once = (DiagnosisBuilder(opened.restored[0].localizer) for _ in range(2))
    for moment, records in opened.updates():
        (record,) = records.values()
        often.add(moment, record)
        often.result()
        once.add(moment, record)
    assert often.result() == once.result() != ()


def test_an_existing_folder_is_refused_before_anything_is_diagnosed(made: Path, tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("mine")
    done = run("diagnose", made / "kept", "-o", tmp_path, expect=1)
    assert done.stdout == ""
    assert "exists already" in done.stderr
    done = run("diagnose", made / "carried.log", "-o", tmp_path / "new", expect=2)
    assert done.stdout == ""
    assert "--save-run" in done.stderr


@pytest.mark.parametrize("words", [["check", "--max-error", "1m"], ["budget"], ["calibrate", "drive"]])
def test_a_saved_run_in_place_of_a_recording_is_answered_with_its_session(words, made: Path) -> None:
    done = run(*words, made / "kept", expect=1)
    assert f"its session is {made / 'carried.log'}" in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_belief_of_a_lost_run_says_that_it_was_left_out(made: Path) -> None:
    done = run("calibrate", "belief", made / "kept", expect=1)
    assert "the run was lost or kidnapped" in done.stderr
    assert "--lost" in done.stderr


def test_without_truth_and_without_failure_it_says_so(small_session: Path) -> None:
    log = small_session.with_name("blind.log")
    records = [json.loads(line) for line in small_session.read_text().splitlines()]
    kept = [{k: v for k, v in one.items() if k != "truth"} for one in records]
    log.write_text("".join(f"{json.dumps(one)}\n" for one in kept if set(one) != {"t"}))
    text = run("diagnose", log, "--particles", 100).stdout
    assert "There is no truth to judge by" in text
    assert ("no sign" in text) == ("Probably lost" not in text)


PLAN = """
seeds = 4
[[sessions]]
path = "session.log"
[[sessions]]
path = "session.log"
label = "anywhere"
start = "anywhere"
[settings]
particles = 4
"""


def test_rows_of_trials_name_the_same_cause(small_session, tmp_path):
    plan = small_session.with_name("few.toml")
    plan.write_text(PLAN)
    run_plan(read_plan(plan), tmp_path / "out")
    rows = load_trials(tmp_path / "out")
    assert rows["failure"].null_count() < len(rows)
    for row in rows.iter_rows(named=True):
        start = "global" if row["session"] == "anywhere" else None
        failures = (
            diagnose(small_session, filter=mv.Filter(particles=4, seed=row["seed"], start=start))
            .runs[0]
            .failures
        )
        failed = row["right_at_end"] is False if start else row["lost"]
        kinds = [failure.kind for failure in failures] or ["unknown"]
        assert row["failure"] == (kinds[-1] if start else kinds[0]) if failed else row["failure"] is None


def test_a_laser_begun_at_a_wrong_place_with_rvizs_spread_had_a_wrong_start(tmp_path):
    plan = SimulationPlan(TASKS["tracking"], world="office", arena_seed=2, seed=3, updates=10, laser=True)
    written = write_simulation(tmp_path / "s", plan)
    truth = next(moment.truth for moment in open_session(written.session).moments())
    places = open_library(written.survey).poses
    away = np.hypot(*(places - truth)[:, :2].T)
    wrong = places[np.argmin(np.abs(away - 3))]
    settings = {
        "start.sd_m": 0.5,
        "start.heading_sd_rad": 0.26,
        "sensor.laser.model": "likelihood_field_prob",
    }
    began = mv.Filter("amcl", start=wrong, settings=settings)
    mv.replay(written.session, filter=began, save_run=tmp_path / "run")
    assert "the filter began" in diagnose(tmp_path / "run").text
