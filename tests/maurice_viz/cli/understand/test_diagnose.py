"""`diagnose` as a person types it: a healthy run, and one whose truth jumps, saved or filtered for it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import maurice_viz as mv
from helpers.commands import run
from helpers.small_session import write_small_session, write_small_survey


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
    mv.replay(carried(log, 6), particles=200, run=folder / "kept")
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
    assert found["text"].startswith(f"Lost from {found['lost']}")
    assert found["evidence"]["moved_m"] == pytest.approx(1.2, abs=0.3)


def test_the_words_name_step_numbers_and_the_commands_that_show_it(made: Path) -> None:
    text = run("diagnose", made / "kept").stdout
    (found,) = mv.diagnose(made / "kept").runs[0].failures
    assert "unseen by its odometry" in text
    assert f"maurice-replay explain {made / 'kept'} --step {found.first}" in text


def test_replay_says_the_same_as_diagnose(made: Path) -> None:
    scores = mv.replay(made / "kept")
    assert scores.runs[0].verdict.failures == mv.diagnose(made / "kept").runs[0].failures
    facts = scores.to_json()["runs"][0]["verdict"]
    assert [one["kind"] for one in facts["failures"]] == ["kidnapped"]


def test_options_of_the_filter_do_not_apply_to_a_saved_run(made: Path) -> None:
    assert (
        "a saved run is replayed as it was"
        in run("diagnose", made / "kept", "--particles", 9, expect=2).stderr
    )


def test_pictures_need_a_saved_run(made: Path) -> None:
    log = made / "carried.log"
    done = run("diagnose", log, "--particles", 50, "-o", made / "pictures", expect=2)
    assert "replay the session with --save-run first" in done.stderr
