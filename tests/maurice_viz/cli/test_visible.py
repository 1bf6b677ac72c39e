"""No name, note, event or picture path steers the terminal, whichever command prints it."""

from __future__ import annotations

import json
import os
import pty
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from helpers.commands import COMMAND, one_line, run
from helpers.small_session import write_small_session, write_small_survey
from maurice_viz.cli.app import COMMANDS
from maurice_viz.cli.shared.visible import CONTROLS, visible, wrapped

HOSTILE = "a\x1b]0;owned\x07b\x9b31mc\u202ed\u2066e\x7ff\x08g"


@pytest.fixture(scope="module")
def hostile(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A drive and a survey in a folder of such a name; names, notes, events and pictures have it, too."""
    folder = tmp_path_factory.mktemp("hostile") / HOSTILE
    folder.mkdir()
    for path in (write_small_survey(folder), write_small_session(folder, updates=6)):
        lines = []
        for number, text in enumerate(path.read_text(encoding="utf-8").splitlines()):
            record = json.loads(text)
            if number == 0:
                record |= {"name": HOSTILE, "notes": [HOSTILE]}
                lines.append(record)
                continue
            picture = record.get("image")
            if isinstance(picture, str):
                renamed = Path(picture).with_name(f"{HOSTILE}{Path(picture).name}")
                shutil.copy(path.parent / picture, path.parent / renamed)
                record["image"] = str(renamed)
            lines.append(record)
            if number % 12 == 5 and path.name == "session.log":
                lines.append({"t": record["t"], "event": f"kidnapped: {HOSTILE}"})
        path.write_text("".join(json.dumps(line) + "\n" for line in lines), encoding="utf-8")
    run("replay", folder / "session.log", "-o", "none", "--save-run", folder / "kept")
    return folder


def printed_by(*words: object) -> str:
    """Run a command; bad input and bad options are as welcome as a result."""
    done = run(*words, expect=None)
    return done.stdout + done.stderr


def test_marks_stand_for_all_that_steers():
    assert visible(HOSTILE) == "a␛]0;owned␇b\ufffd31mc\ufffdd\ufffde␡f␈g"
    assert visible("\udcff é\t\n") == "\ufffd é\t\n"


BAR = """
from maurice_viz.cli.shared.console import TO_CONSOLE, note
from maurice_viz.cli.shared.visible import visible_output
with visible_output():
    TO_CONSOLE.progress(1, 2, "replay")
    note("a\\x1b]0;owned")
    TO_CONSOLE.end()
"""


def test_a_progress_bar_steers_the_terminal_and_a_remark_beside_it_does_not():
    ours, its = pty.openpty()
    subprocess.run([sys.executable, "-c", BAR], stdout=its, stderr=its, check=True)
    os.close(its)
    printed = os.read(ours, 65536).decode()
    assert "replay" in printed
    assert "␍" not in printed
    assert "␛[" not in printed
    assert "a␛]0;owned" in printed


def test_sentences_break_between_words_and_commands_do_not():
    command = "maurice-replay open " + "a-long-name/" * 8 + " --step 41"
    said = [
        "many words " * 12,
        "  said further in" * 8,
        f"walk through step 41: {command}",
        f"  see: {command}",
    ]
    text = "\n".join([*said, "", "end"])
    lines = list(wrapped(text, 80))
    assert max(len(line) for line in lines if command not in line) <= 80
    assert " ".join(" ".join(lines).split()) == " ".join(text.split())
    assert lines[-5:] == ["walk through step 41:", f"  {command}", f"  see: {command}", "", "end"]
    path = "/a/" * 40
    assert list(wrapped(f"{path} written", 80)) == [path, "written"]


@pytest.mark.parametrize(
    "words",
    [
        ("replay", "session.log", "-o", "none"),
        ("replay", "session.log", "-o", "none", "--json"),
        ("compare", "session.log", "--preset", "thesis", "--preset", "robust", "-o", "none"),
        ("inspect", "session.log"),
        ("inspect", "session.log", "--json"),
        ("inspect", "kept"),
        ("doctor", "session.log"),
        ("doctor", "session.log", "--json"),
        ("inspect", "kept", "--json"),
        ("explain", "kept", "--step", "3"),
        ("diagnose", "kept"),
        ("diagnose", "kept", "--json"),
        ("verify", "kept"),
        ("budget", "session.log", "--seeds", "1"),
        ("what-if", "kept", "--from", "2", "--particles", "300", "-o", "none"),
        ("library", "show", "survey.log"),
        ("library", "check", "survey.log"),
        ("library", "build", "session.log", "-o", "built"),
        ("convert", "session.log", "-o", "written"),
        ("export", "kept", "-o", "exported"),
        ("report", "kept", "-o", "report.html"),
        ("calibrate", "motion", "session.log"),
        ("calibrate", "drive", "session.log"),
        ("calibrate", "belief", "session.log"),
        ("calibrate", "noise", "session.log"),
        ("check", "session.log", "--max-error", "0.5m", "--seeds", "1"),
    ],
    ids=" ".join,
)
def test_what_a_drive_says_is_shown_with_marks(hostile, monkeypatch, words):
    monkeypatch.chdir(hostile)
    paths = [
        hostile / word if word.endswith((".log", ".html")) or word in ("kept", "built") else word
        for word in words
    ]
    printed = printed_by(*paths)
    assert not CONTROLS.search(printed), printed


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_an_error_that_names_a_file_is_shown_with_marks(tmp_path, name):
    assert not CONTROLS.search(printed_by(*name.split(), tmp_path / f"{HOSTILE}.log"))


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is always full")
@pytest.mark.parametrize("words", [["--help"], ["inspect"]])
def test_output_to_a_full_disk_is_one_line(words):
    with Path("/dev/full").open("w") as full:
        done = subprocess.run([*COMMAND, *words], stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert done.returncode == 1
    assert "No space left on device" in one_line(done.stderr)
