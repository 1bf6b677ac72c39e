"""What is named by mistake: each answer is one line that says what it is, and what to do, which works."""

from __future__ import annotations

import os
import shlex
import shutil
from pathlib import Path

import pytest

from helpers.commands import failure, maurice, run
from helpers.small_session import write_small_session, write_small_survey
from maurice_loaders import InputError, open_run

OF_RUNS = ("explain", "report", "what-if", "verify", "export", "snapshot", "diagnose")
NEEDED = {"report": "-o r.html", "export": "-o e.csv", "snapshot": "-o s.png"}
SAVE = "-o none --save-run my-run"


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with one of each kind."""
    folder: Path = tmp_path_factory.mktemp("kinds")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        drive = folder / "my-demo"
        (drive / "survey").mkdir(parents=True)
        write_small_survey(drive / "survey")
        log = write_small_session(drive)
        log.write_text(log.read_text().replace("survey.log", "survey/survey.log", 1))
        maurice(drive, "--particles", "20", "-o", "drawn.rrd", "--save-run", "lost")
        maurice("compare", drive, "--particles", "20", "-o", "none", "--save-run", "both")
        maurice("library", "build", drive / "survey" / "survey.log", "-o", "library")
        (folder / "empty").mkdir()
        (folder / "jpgs").mkdir()
        for number in range(3):
            (folder / "jpgs" / f"{number}.jpg").write_bytes(b"\xff\xd8\xff\xe0")
        shutil.make_archive("packed", "zip", drive)
        (folder / "note.txt").write_text("hello\n")
    return folder


@pytest.fixture(autouse=True)
def _there(made: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(made)


def refusal(command: str, path: str) -> str:
    return failure(*command.split(), path, *NEEDED.get(command, "").split())


@pytest.mark.parametrize("command", OF_RUNS[:5])
@pytest.mark.parametrize(
    ("path", "found", "advice"),
    [
        ("drawn.rrd", "a Rerun recording", "maurice-replay drawn.rrd"),
        ("my-demo", "a recording (session-log)", f"maurice-replay my-demo {SAVE}"),
        ("jpgs", "a recording (pictures)", f"maurice-replay jpgs --library LIBRARY {SAVE}"),
        ("packed.zip", "a ZIP archive (unpack it: `unzip packed.zip`)", "then name what was in it"),
        ("empty", "an empty folder", SAVE),
        ("note.txt", "a file that begins with b'hello\\n'", SAVE),
        ("library", "a library", "maurice-replay SESSION --library library"),
        ("my-dmo", "no such file or folder", "did you mean my-demo?"),
        ("nothing-like-it", "no such file or folder", SAVE),
    ],
)
def test_instead_of_a_saved_run(command, path, found, advice):
    line = refusal(command, path)
    assert f"{path}: found {found}, expected a saved run's folder; " in line
    assert advice in line


def test_the_advice_for_a_recording_works(tmp_path):
    words = shlex.split(refusal("explain", "my-demo").split("maurice-replay ")[1])
    run(*words[:-1], tmp_path / words[-1], "--particles", "20")
    maurice("explain", tmp_path / words[-1])


def test_drawings_are_diagnosed_by_nobody():
    assert "expected a saved run's folder; it holds drawings" in failure("diagnose", "drawn.rrd")


@pytest.mark.parametrize("command", ["library check", "library show"])
@pytest.mark.parametrize(
    ("path", "found", "advice"),
    [
        ("my-demo", "a recording (session-log)", "did you mean my-demo/survey/survey.log?"),
        ("lost", "a saved run", "library build DRIVE -o LIBRARY"),
        ("note.txt", "a file that begins with", "library build DRIVE -o LIBRARY"),
        ("jpgs", "a recording (pictures)", "library build DRIVE -o LIBRARY"),
        ("packed.zip", "a ZIP archive", "then name what was in it"),
        ("libary", "no such file or folder", "did you mean library?"),
    ],
)
def test_instead_of_a_library(command, path, found, advice):
    line = refusal(command, path)
    assert f"{path}: found {found}" in line
    assert advice in line
    run("library", "show", "my-demo/survey/survey.log")  # what is named for my-demo


@pytest.mark.parametrize(
    ("path", "found", "advice"),
    [
        ("lost", "a saved run", "its session is "),
        ("library", "a library", "--library library"),
        ("empty", "an empty folder", "was anything written to it?"),
        ("packed.zip", "a ZIP archive", "then name what was in it"),
        ("jpgs/0.jpg", "a single picture", "put the pictures of a drive into a folder, and name that"),
        ("drawn.rrd", "a Rerun recording", "maurice-replay drawn.rrd"),
        ("my-dmo/session.log", "no such file or folder", "did you mean my-demo/session.log?"),
    ],
)
def test_instead_of_a_recording(path, found, advice):
    line = refusal("doctor", path)
    assert f"{path}: found {found}" in line
    assert "expected a robot's recording; " in line
    assert advice in line


def test_instead_of_trials_and_of_one_run():
    assert "found a recording (session-log), expected a folder that" in failure("trials", "table", "my-demo")
    with pytest.raises(InputError, match="a comparison of saved runs"):
        open_run("both")


def test_a_mistyped_session_or_command():
    assert "did you mean my-demo?" in failure("my-dmo")
    assert "did you mean the command explain?" in failure("exlain")
    assert "did you mean drawn.rrd?" in failure("drwn.rrd")
    assert "did you mean my-demo/survey/survey.log?" in failure(
        "my-demo", "-o", "none", "--library", "my-demo/survy/survey.log"
    )


@pytest.mark.parametrize(
    ("words", "meant"),
    [
        ("my-demo --preset robst", "robust"),
        ("my-demo --feature colr", "color"),
        ("my-demo --layout ovrview", "overview"),
        ("my-demo --set resampling.scheme=residul", "residual"),
        ("my-demo --set sensor.sharpnes=2", "sensor.sharpness"),
        ("my-demo --reading turn_scal=2", "turn_scale"),
        ("simulate trackin -o x", "tracking"),
        ("simulate tracking -o x --world two-room", "two-rooms"),
        ("trials run kidnaped -o x", "kidnapped"),
    ],
)
def test_a_mistyped_word(words, meant):
    assert f"did you mean {meant}?" in " ".join(run(*words.split(), expect=None).stderr.split())


PIPED = ["diagnose", "export", "library check", "trials table"]


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="has no named pipes")
@pytest.mark.parametrize("command", [*PIPED, "my-demo --map"])
def test_a_pipe_is_refused_and_not_waited_for(command, tmp_path):
    """Nobody ever writes to it: reading would not end."""
    os.mkfifo(tmp_path / "pipe")
    words = [*command.split(), tmp_path / "pipe", *NEEDED.get(command, "").split()]
    assert "pipe: found no regular file, expected a" in failure(*words)


def test_a_recording_that_is_none_is_told_of_before_a_display(tmp_path):
    (tmp_path / "cut.rrd").write_bytes(Path("drawn.rrd").read_bytes()[:-100])
    assert "found a recording that was cut off; `rerun rrd" in failure(tmp_path / "cut.rrd")
    assert "found no such file" in failure("open", tmp_path / "gone.rrd", "--step", "3")
