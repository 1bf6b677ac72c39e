"""What a shell gets when Tab is pressed, and `help` and `open`: asked as a shell and a person ask."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from helpers.commands import failure, maurice, run
from maurice_datasets.trials.plan import shipped_plans
from maurice_mcl.config.parameters import PRESETS, RULES
from maurice_viz.cli.app import COMMANDS, load
from maurice_viz.layouts import LAYOUT_NAMES

HEAVY = ("rerun", "matplotlib", "pandas", "jinja2", "av", "dask", "cv2.gapi")


def completed(words: str, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Return what completes the last word of a line."""
    monkeypatch.setenv("COMP_WORDS", f"maurice-replay {words}")
    monkeypatch.setenv("COMP_CWORD", str(len(words.split(" "))))
    monkeypatch.setenv("_MAURICE_REPLAY_COMPLETE", "complete_bash")
    return run(prog_name="maurice-replay").stdout.split()


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("compare a.log --preset ", list(PRESETS)),
        ("replay a.log --feature ble", ["blended"]),
        ("replay a.log --layout ", list(LAYOUT_NAMES)),
        ("replay a.log --set resampling.k", [f"{key}=" for key in RULES if key.startswith("resampling.k")]),
        ("inspect a.log --reading max", ["max_dt_s="]),
        ("trials table made --metric kidnapped", ["kidnapped_at_update"]),
        ("trials run t", [name for name in shipped_plans() if name.startswith("t")]),
        ("inspect a.log --reading odometry_are=", ["poses", "steps"]),
        ("inspect a.log --reading keep_going=t", ["true"]),
        ("replay a.log --set resampling.scheme=s", ["systematic", "stratified"]),
        ("replay a.log --set resampling.scheme = s", ["systematic", "stratified"]),  # as bash splits it
        ("replay a.log --set particles=", []),
        ("simulate kid", ["kidnapped"]),
        ("simulate kidnapped --world two", ["two-rooms"]),
        ("not-there.log --preset ro", ["robust"]),
        ("library ch", ["check"]),
        ("help library ch", ["check"]),
        ("hel", ["help"]),
        ("nothing-of-this-name x", []),
        ("library nothing x", []),
    ],
)
def test_values_are_completed(words, expected, monkeypatch):
    assert completed(words, monkeypatch) == expected


def test_completion_starts_without_what_draws():
    asked = {"COMP_WORDS": "maurice-replay replay a.log --preset ", "COMP_CWORD": "4"}
    asked |= {"_MAURICE_REPLAY_COMPLETE": "complete_bash", "PYTHONPROFILEIMPORTTIME": "1"}
    command = [Path(sys.executable).with_name("maurice-replay")]  # its name stands in the variable's
    done = subprocess.run(command, env=os.environ | asked, capture_output=True, text=True, check=True)
    assert done.stdout.split() == list(PRESETS)
    imported = {line.split("|")[-1].strip() for line in done.stderr.splitlines()}
    assert "maurice_mcl" in imported
    assert not imported & set(HEAVY)


def test_help_is_the_help_of_a_command():
    assert maurice("help") == maurice("--help")
    assert (
        maurice("help", "library", "check")[0].split("\n", 1)[1]
        == (maurice("library", "check", "--help")[0].split("\n", 1)[1])
    )
    assert "did you mean the command compare" in failure("help", "compair")
    shown = maurice("--help")[0]
    assert all(one.what in " ".join(shown.split()) for one in COMMANDS.values())


def test_open_is_replay_of_what_was_made(small_session, tmp_path):
    maurice(small_session, "--particles", "50", "-o", "none", "--save-run", "kept")
    maurice("open", "kept")
    assert "found no display" in failure("open", next(tmp_path.glob("*.rrd")))


def test_the_number_of_commands_and_options_stays_small():
    """Another one is worth taking one away."""
    options = {
        max(option.opts, key=len)
        for command in COMMANDS.values()
        for option in load(command).params
        if option.param_type_name == "option"
    }
    assert len(COMMANDS) <= 34
    assert len(options - {"--help"}) <= 90
