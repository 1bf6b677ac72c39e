"""`maurice-replay survey`: a log one can build a library from, a sheet, and refusals in one line."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from helpers.commands import failure, run
from maurice_loaders.session_log.reader import SurveyLog
from maurice_viz.cli.shared.values import read_length
from maurice_viz.errors import OptionError

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


def test_a_survey_and_a_sheet_of_one_s_own_world(world, tmp_path):
    out, sheet = tmp_path / "out", tmp_path / "sheet.png"
    args = ["--world", world, "--spacing", "100cm", "--headings", "2", "-o", out, "-o", sheet]
    told = json.loads(run("survey", *args, "--json").stdout)
    assert told["references"] == 8
    pictures = list(SurveyLog(Path(told["survey"])).survey_pictures())
    assert sum(p.covered for p in pictures) == 10
    poses = np.array([p.pose for p in pictures if p.pose is not None])
    assert len(poses) == 8
    assert np.unique(poses[:, 0]) == pytest.approx([0.5, 1.5])
    drawn = cv2.imread(str(sheet))
    assert drawn.shape[0] > 6 * 144
    assert "--force" in failure("survey", *args)
    run("survey", *args, "--force")


@pytest.mark.parametrize(
    ("text", "metres"), [("18in", 0.4572), ("0.6m", 0.6), ("45 cm", 0.45), ("2ft", 0.6096), ("60mm", 0.06)]
)
def test_lengths_have_units(text, metres):
    assert read_length(text, "--spacing") == pytest.approx(metres)


@pytest.mark.parametrize("text", ["18", "in", "-3in", "nanm", "0in", "3 miles", ""])
def test_words_that_are_no_lengths_are_refused(text):
    with pytest.raises(OptionError, match="spacing"):
        read_length(text, "--spacing")


def test_refusals(world, tmp_path):
    run("survey", expect=2)
    run("survey", "-o", "sheet.bmp", expect=2)
    out = ("-o", tmp_path / "x")
    assert "expected one of office, twins, two-rooms" in failure("survey", "--world", "nowhere", *out)
    world.write_text(SMALL.replace("spacing = 0.5", "spacing = 0.5, clearance = 1.5"), encoding="utf-8")
    assert "no node of the grid is free" in failure("survey", "--world", world, *out)
    assert not (tmp_path / "x").exists()
