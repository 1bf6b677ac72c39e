"""`maurice-replay explain` as a person uses it."""

from __future__ import annotations

import json
import shlex
import shutil
from pathlib import Path

import pytest

from helpers.commands import maurice, one_line, run
from helpers.small_session import write_small_session, write_small_survey
from maurice_viz.viewer.snapshot import software_driver


def kept_in(folder: Path) -> Path:
    """Save a run to a folder with a name in another script."""
    write_small_survey(folder)
    words = ["--particles", 200, "--save-run", folder / "gefüllt 東", "-o", "none"]
    run(write_small_session(folder), *words)
    return folder / "gefüllt 東"


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return kept_in(tmp_path_factory.mktemp("explained"))


def ask(*words: object, expect: int = 0) -> tuple[str, str]:
    return maurice("explain", *words, expect=expect)


def test_it_says_why(saved):
    out, err = ask(saved, "--step", "4")
    assert out.startswith("blended, step 4\n")
    assert "matches the picture best" in out
    assert "nearest to the truth" in out
    assert not err
    assert ask(saved)[0].startswith("blended, step 14\n")
    assert not list(Path().glob("*.rrd"))


def test_it_begins_with_whether_dots_are_where_the_picture_fits(saved):
    lesson = ask(saved, "--step", "4")[0].split("\n\n")[1]
    assert " of 160" in lesson
    assert "there" in lesson or "no dot is within" in lesson


@pytest.mark.parametrize("has_truth", [True, False])
def test_it_says_which_other_run_of_the_comparison_looked_there(has_truth, tmp_path):
    write_small_survey(tmp_path)
    session = write_small_session(tmp_path)
    if not has_truth:
        lines = session.read_text(encoding="utf-8").splitlines()
        kept = [line for number, line in enumerate(lines) if number == 0 or '"truth"' not in line]
        session.write_text("\n".join(kept), encoding="utf-8")
    words = ["--particles", 300, "--start=0.3,0.3,0", "--seed", 1]
    run("compare", session, *words, "--seed", 2, "--save-run", "both", "-o", "none")
    labels = sorted(path.name for path in Path("both").iterdir() if path.is_dir())
    assert len(labels) == 2
    for label in labels:
        beginning = " ".join(ask(f"both/{label}", "--step", "8")[0].split("\n\n")[1].split())
        assert all(f"`{name}`" in beginning for name in labels)
        assert ("where the picture fits best" in beginning) != has_truth


def test_an_entry_a_pose_and_a_particle_can_be_asked_for(saved):
    def asked(*options: str) -> dict[str, object]:
        found = json.loads(ask(saved, "--step", "3", "--json", *options)[0])
        first: dict[str, object] = found["runs"][0]["explained"][0]
        assert first["who"] == "asked"
        return first

    assert asked("--entry", "5")["reference"]["entry"] == 5  # type: ignore[index]
    pose = asked("--at", "1.5,0.5,90")["pose"]
    assert pose == pytest.approx([1.5, 0.5, 1.5708], abs=1e-4)
    assert asked("--at=-1.5,0.5,90")["reference"] is None
    of_particle = asked("--particle", "0")["particle_log_likelihood"]
    assert isinstance(of_particle, float)
    assert of_particle < 0


@pytest.mark.parametrize(
    ("options", "status", "words"),
    [
        (("--step", "15"), 1, "has no step 15; it has 1 to 14"),
        (("--entry", "160"), 2, "there is no entry 160; they are 0 to 159"),
        (("--particle", "200"), 2, "there is no particle 200; they are 0 to 199"),
        (("--at", "1,2"), 2, "--at is X,Y,HEADING (m and degrees)"),
        (("--at", "1,2,nan"), 2, "--at is X,Y,HEADING"),
        (("--entry", "1", "--particle", "1"), 2, "exclude each other"),
        (("-o", "out.jpg"), 2, "'out.jpg' should end in .png"),
    ],
)
def test_what_cannot_be_is_said(saved, options, status, words):
    _, err = ask(saved, *options, expect=status)
    assert words in " ".join(err.replace("│", " ").split())


def test_what_cannot_be_explained(tmp_path, monkeypatch):
    saved = kept_in(tmp_path)
    (tmp_path / "empty").mkdir()
    assert "Traceback" not in one_line(ask("empty", expect=1)[1])
    monkeypatch.setattr("maurice_viz.viewer.snapshot.DRIVER_FOLDERS", ())
    assert "mesa-vulkan-drivers" in one_line(ask(saved, "-o", "warum.png", expect=1)[1])
    shutil.move(tmp_path / "survey.log", tmp_path / "elsewhere.log")
    _, err = ask(saved, expect=1)
    assert "cannot be explained without its session and library" in err.strip().splitlines()[-1]
    assert "Traceback" not in err


def test_of_a_comparison_one_run_is_chosen(small_session):
    run("compare", small_session, "--particles", 50, "--save-run", "both", "-o", "none")
    words = one_line(ask("both", expect=1)[1])
    assert "holds 2 runs; name one of them: both/color, both/blended" in words
    assert ask("both/color")[0].startswith("color, step 14")
    assert ask("both", "--run", "color", "--step", "2")[0].startswith("color, step 2\n")
    err = one_line(ask("both", "--run", "none", expect=1)[1])
    assert err.endswith("found no run 'none'; it has color, blended")


@pytest.mark.skipif(software_driver() is None, reason="pictures need Mesa's software Vulkan driver")
def test_a_picture_is_the_real_viewers(saved):
    import cv2

    _, err = ask(saved, "--step", "2", "-o", "warum.png")
    assert err.strip().splitlines()[-1] == "warum.png written"
    picture = cv2.imread("warum.png")
    assert picture.shape == (1000, 1600, 3)
    assert len(set(map(tuple, picture[::7, ::7].reshape(-1, 3)))) > 200
    assert not list(Path().glob("*.rrd"))
    assert "--force" in one_line(ask(saved, "-o", "warum.png", expect=1)[1])


def test_the_command_it_prints_opens_that_phase(saved, tmp_path):
    out = ask(saved, "--step", "4")[0]
    words = shlex.split(out.splitlines()[-1].removeprefix("Walk through it: "))
    assert words[:2] == ["maurice-replay", "open"]
    assert words[2:] == [str(saved), "--step", "4", "--phase", words[-1]]
    assert words[-1] in ("weight", "resample")
    _, err = maurice(*words[1:])  # without a display a file is written
    written = next(line for line in err.splitlines() if "open it with: " in line)
    assert shlex.split(written)[-5:] == ["open", f"{saved.name}.rrd", *words[3:]][-5:]
    assert "--phase goes with --step" in maurice("open", saved, "--phase", "resample", expect=2)[1]
