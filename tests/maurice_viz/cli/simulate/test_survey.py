"""`maurice-replay survey`: a log one can build a library from, a sheet, and refusals in one line."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from maurice_loaders.session_log.reader import SessionLog
from maurice_viz.cli.app import app
from maurice_viz.cli.simulate import read_length

SMALL = """
format = 1
units = "m"
library = { anchor = [0.5, 0.5], spacing = 0.5 }
style.plain = { ambient = 0.4 }
[[room]]
name = "a"
rect = [0, 0, 2, 2]
style = "plain"
[[floor]]
name = "wood"
"""


@pytest.fixture
def world(tmp_path: Path) -> Path:
    file = tmp_path / "mine.toml"
    file.write_text(SMALL, encoding="utf-8")
    return file


def run(*args: str | Path, status: int = 0) -> str:
    done = CliRunner().invoke(app, ["survey", *map(str, args)])
    assert done.exit_code == status, done.output
    return done.output


def test_a_survey_and_a_sheet_of_one_s_own_world(world: Path, tmp_path: Path) -> None:
    out, sheet = tmp_path / "out", tmp_path / "sheet.png"
    args = ["--world", world, "--spacing", "100cm", "--headings", "2", "-o", out, "--contact-sheet", sheet]
    told = json.loads(run(*args, "--json"))
    assert told["references"] == 8
    pictures = list(SessionLog(Path(told["survey"])).survey_pictures())
    assert sum(p.covered for p in pictures) == 10
    poses = np.array([p.pose for p in pictures if p.pose is not None])
    assert len(poses) == 8
    assert np.unique(poses[:, 0]) == pytest.approx([0.5, 1.5])
    drawn = cv2.imread(str(sheet))
    assert drawn is not None
    assert drawn.shape[0] > 6 * 144
    assert "--force" in run(*args, status=1)
    run(*args, "--force")


@pytest.mark.parametrize(
    ("text", "metres"), [("18in", 0.4572), ("0.6m", 0.6), ("45 cm", 0.45), ("2ft", 0.6096)]
)
def test_lengths_have_units(text: str, metres: float) -> None:
    assert read_length(text) == pytest.approx(metres)


@pytest.mark.parametrize("text", ["18", "in", "-3in", "nanm", "0in", "3 miles", ""])
def test_words_that_are_no_lengths_are_refused(text: str) -> None:
    with pytest.raises(ValueError, match="spacing"):
        read_length(text)


def test_refusals(world: Path, tmp_path: Path) -> None:
    run(status=2)
    run("--contact-sheet", "sheet.bmp", status=2)
    assert "no node of the grid is free" in run(
        "--world", write_tight(world), "-o", tmp_path / "x", status=1
    ).replace("\n", " ")
    assert "there are office, two-rooms" in run("--world", "nowhere", "-o", tmp_path / "x", status=1)
    assert not (tmp_path / "x").exists()


def write_tight(world: Path) -> Path:
    """The same world, so that nothing in it is free."""
    world.write_text(SMALL.replace("spacing = 0.5", "spacing = 0.5, clearance = 1.5"), encoding="utf-8")
    return world
