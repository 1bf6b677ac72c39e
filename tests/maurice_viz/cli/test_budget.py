"""`budget`: its table, its JSON and its sentence say the same."""

from __future__ import annotations

import json
from pathlib import Path

from helpers.commands import run
from helpers.small_session import write_small_session, write_small_survey


def test_the_table_and_json_say_the_same(small_session: Path) -> None:
    typed = ("budget", small_session, "--particles", "50", "--seeds", "2")
    found = json.loads(run(*typed, "--json").stdout)
    shown = run(*typed)
    assert found["parts"][0]["part"] == "as it is"
    for one in found["parts"]:
        assert f"{one['error']['value']:.2f}" in shown.stdout
    assert (found["costliest"] or "No cost") in shown.stdout


def test_without_truth_it_says_so(tmp_path: Path) -> None:
    write_small_survey(tmp_path)
    done = run("budget", write_small_session(tmp_path, truth=False), expect=1)
    assert "found no truth" in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1


def test_seeds_of_a_recorded_session_are_one_drive(small_session: Path, tmp_path: Path) -> None:
    plan = small_session.with_name("mine.toml")
    plan.write_text('seeds = 2\n[[sessions]]\npath = "session.log"\n[settings]\nparticles = 50\n')
    run("trials", "run", plan, "-o", tmp_path / "out", "--workers", "1")
    ours = json.loads(run("budget", tmp_path / "out", "--json").stdout)
    alone = json.loads(run("budget", small_session, "--particles", "50", "--seeds", "2", "--json").stdout)
    assert (ours["drives"], ours["display_units"]) == (1, alone["display_units"])
    assert ours["parts"] == alone["parts"]
