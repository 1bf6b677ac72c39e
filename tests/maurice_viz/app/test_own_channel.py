"""A user's own channel: the example of docs/sensors.md, installed and used by name."""

from __future__ import annotations

import json
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest

from helpers import expect_facts
from helpers.commands import process, runs_of
from maurice_mcl.sensor.descriptors.registry import CHANNELS, SCALES
from maurice_mcl.sensor.distances import DISTANCES

ROOT = Path(__file__).parents[3] / "docs"
DOCS = (ROOT / "sensors.md").read_text()
EXAMPLE = ROOT / "examples" / "mychannel"
SOURCE = (EXAMPLE / "mychannel.py").read_text()
PROJECT = tomllib.loads((EXAMPLE / "pyproject.toml").read_text())
RUN = ["-o", "none", "--json", "--particles", "200"]


def test_the_page_quotes_the_example():
    assert re.findall(r"```python\n(.*?)```", DOCS, re.S)[0].strip() in SOURCE


def _install(folder, source=SOURCE):
    """Lay the package out as an installer does, its entry point as pyproject.toml has it."""
    (group, points), *_ = PROJECT["project"]["entry-points"].items()
    (module,) = PROJECT["tool"]["setuptools"]["py-modules"]
    folder.mkdir(exist_ok=True)
    (folder / f"{module}.py").write_text(source)
    info = folder / f"{module}-1.0.dist-info"
    info.mkdir(exist_ok=True)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {module}\nVersion: 1.0\n")
    lines = [f"[{group}]", *(f"{name} = {value}" for name, value in points.items())]
    (info / "entry_points.txt").write_text("\n".join(lines) + "\n")
    return folder


def _maurice(*args, path, expect=0):
    return process(*args, expect=expect, PYTHONPATH=str(path), PYTHONDONTWRITEBYTECODE="1")


def _labels(done):
    return [run["label"] for run in runs_of(done.stdout)]


def test_it_is_tuned_and_used_by_name(small_session, tmp_path):
    path = _install(tmp_path / "site")
    survey, tuned = small_session.parent / "survey.log", tmp_path / "mine.toml"
    words = (small_session, "--channels", "mychannel", "-o", tuned)
    _maurice("library", "tune", survey, *words, path=path)
    assert "scales = { mychannel = " in tuned.read_text()
    done = _maurice(small_session, "--feature", "mychannel", "--config", tuned, *RUN, path=path)
    assert _labels(done) == ["mychannel"]
    assert done.stderr == ""
    facts = json.loads(_maurice("library", "show", survey, "--json", path=path).stdout)
    assert facts["channels"]["mychannel"]["length"] == 16


@pytest.mark.slow
def test_a_broken_one_costs_one_line_and_nothing_else(small_session, tmp_path):
    path = _install(tmp_path / "site", SOURCE.replace('name = "mychannel"', 'name = "color"'))
    done = _maurice(small_session, "--feature", "color", *RUN, path=path)
    assert _labels(done) == ["color"]
    (line,) = done.stderr.splitlines()
    assert line.startswith("channel of entry point mychannel:MyChannel left out: ")
    wanted = _maurice(small_session, "--feature", "mychannel", *RUN, path=path, expect=2)
    assert "no feature called 'mychannel'" in " ".join(wanted.stderr.replace("│", " ").split())


@pytest.mark.slow
def test_one_that_fails_on_pictures_is_left_out_of_the_library(small_session, tmp_path):
    source = SOURCE.replace("gray = cv2.cvtColor", "return np.ones(3)\n        gray = cv2.cvtColor")
    path = _install(tmp_path / "site", source.replace('"version": 1', '"version": 3'))
    done = _maurice(small_session, "--feature", "color", *RUN, path=path)
    (line,) = done.stderr.splitlines()
    expect_facts(line, "'mychannel'", "float64 (3,), expected float32 of one dimension", "without it")
    wanted = _maurice(small_session, "--feature", "mychannel", *RUN, path=path, expect=1)
    assert "expected mychannel; build the library again" in wanted.stderr
    _install(tmp_path / "site", SOURCE.replace('"version": 1', '"version": 3'))
    fixed = _maurice(small_session, "--feature", "mychannel", *RUN, path=path)
    assert _labels(fixed) == ["mychannel"], "the cache is no reason to stay broken"


@pytest.mark.slow
def test_a_library_folder_outlives_the_channel_and_its_parameters(small_session, tmp_path):
    path, kept = _install(tmp_path / "site"), tmp_path / "kept"
    _maurice("library", "build", small_session.parent / "survey.log", "-o", kept, path=path)
    args = [small_session, "--library", kept, *RUN]
    for source in (SOURCE.replace('"version": 1', '"version": 2'), "import nothing_of_that_name"):
        _install(path, source)
        assert _labels(_maurice(*args, "--feature", "color", path=path)) == ["color"]


def _rows():
    rows = [line.strip("|").split("|") for line in DOCS.splitlines() if line.startswith("| `")]
    return {row[0].strip().strip("`"): [c.strip() for c in row[1:]] for row in rows if len(row) == 9}


def test_the_documentation_lists_every_channel_as_it_is():
    rows = _rows()
    assert set(rows) == set(CHANNELS)
    for name, (_, size, _, _, distance, scale, score, source) in rows.items():
        channel = CHANNELS[name]
        assert distance == f"`{channel.distance}`"
        assert float(scale) == SCALES[name][channel.distance]
        assert -6.44 < float(score) < 0
        assert source
        assert len(channel.describe(np.full((24, 32, 3), 90, np.uint8))) == int(size)


def test_the_documentation_lists_every_distance():
    section = DOCS.split("## Distances")[1].split("## ")[0]
    assert set(re.findall(r"`(\w+)`", section)) == set(DISTANCES)
