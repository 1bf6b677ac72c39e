"""What a shell gets when Tab is pressed, and `help` and `open`: asked as a shell and a person ask."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from helpers.commands import failure, maurice, run
from maurice_datasets.trials.plan import shipped_plans
from maurice_mcl.config.parameters import PRESETS, RULES
from maurice_viz.cli.app import COMMANDS, load
from maurice_viz.cli.shared.values import KEYS
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
        ("inspect a.log --reading odometry_are=", ["poses", "steps", "jumping"]),
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
    assert "did you mean `help reading`" in failure("help", "readng")


def test_the_first_page_fits_a_screen_and_leads_to_every_command():
    first = maurice("--help")[0]
    assert len(first.splitlines()) <= 30
    assert (
        first.index("  replay ") < first.index("  demo ") < first.index("Groups") < first.index("help more")
    )
    groups = {name.split()[0] for name in COMMANDS if " " in name}
    pages = [first, maurice("help", "more")[0], *(maurice("help", group)[0] for group in groups)]
    text = " ".join(" ".join(pages).split())
    assert all(one.what in text for one in COMMANDS.values())
    alone = {name: run(name, expect=2) for name in groups}  # without a word more: what it holds
    assert all("Commands:" in done.stdout + done.stderr for done in alone.values())


@pytest.mark.parametrize("name", COMMANDS)
def test_no_help_names_types_of_python(name):
    shown = maurice(*name.split(), "--help")[0]
    assert not re.findall(r"<[a-z\[\]A-Z ]+>|\{|x[<>]=|\b(?:str|int|float|list|Path)\b", shown)
    assert shown.splitlines()[0].split("[OPTIONS]")[1].split() == [
        (one.metavar or one.name.upper()) if one.required else f"[{one.metavar}]"
        for one in load(COMMANDS[name]).params
        if one.param_type_name == "argument"
    ]


def test_the_keys_of_reading_stand_on_one_page_of_the_help():
    page = maurice("help", "reading")[0]
    assert all(re.search(rf"^  {key}\b", page, re.MULTILINE) for key in KEYS)
    assert "odometry_from_truth" not in maurice("replay", "--help")[0]


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
