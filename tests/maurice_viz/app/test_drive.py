"""Driving by keys: what each does to the robot and the filter, and what is drawn and saved of it."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest
from rerun.chunk import RrdReader

import maurice_viz as mv
from helpers.small_room import write_small_room
from maurice_datasets import simulation, surveys
from maurice_datasets.sessions import simulation_plan
from maurice_datasets.surveys import Surveyor
from maurice_datasets.worlds.build import load_world
from maurice_viz.app.drive.drive import drive
from maurice_viz.entities import CAMERA, VERDICT
from maurice_viz.errors import OptionError

pytestmark = pytest.mark.filterwarnings("ignore:RRD file has no footer")  # live ones have none on purpose
QUICK = {"particles": 300}
PLAN = {"world", "laser", "half_resolution", "tier"}  # the others are the filter's
WORLD = cache(load_world)  # the same one, so that it is lit once


@pytest.fixture(scope="module")
def own_cache(tmp_path_factory: pytest.TempPathFactory) -> str:
    folder = tmp_path_factory.mktemp("cache")  # not that of other tests: its surveys have few headings
    QUICK["world"] = str(write_small_room(folder))
    return str(folder)


@pytest.fixture(autouse=True)
def quick_survey(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, own_cache: str) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MAURICE_CACHE", own_cache)
    monkeypatch.setattr(surveys, "_surveyor_of", lambda _: Surveyor(headings=2, covered=1))
    monkeypatch.setattr(simulation, "load_world", WORLD)


def driven(keys: str | list[str], **how: object) -> tuple[mv.RunScores, list[str]]:
    lines: list[str] = []
    asked = QUICK | how
    plan = simulation_plan(asked.pop("start", "global"), **{k: asked.pop(k) for k in PLAN & asked.keys()})
    to = asked.pop("to", None)
    scores = drive(list(keys), plan, mv.Filter(**asked), to=to, tell=lines.append)
    return scores, lines


def test_every_key_does_what_the_help_says():
    keys = "up,a, ,k,b,l,p,up,p,1,w,7,?,A,,,A,,S,q,up"
    scores, lines = driven(keys.split(","))
    assert lines[-1] == ""
    assert lines[0].startswith("step 1 | ")
    assert lines[0].endswith("?: help")
    after = iter(lines[1:])
    for words in (
        "teleoperation",
        "teleoperation",
        "step 4",
        "kidnapped",
        "bump, slip",
        "lights dim",
        "paused",
        "paused",
        "goes on",
        "thesis | thesis goes on from here",
        "branch with preset thesis",
        "'7' does nothing",
        "1: thesis, 2: refined, 3: robust, 4: precise",
        "on its own",
        "wandering",
        "step 10",
        "by hand",
        "saved: drive",
    ):
        assert words in next(after)
    assert scores.runs[0].score.updates == 10  # neither paused, nor without a key, nor after the end


def test_a_saved_drive_replays_to_the_same_scores():
    """The picture, the movements and the filter's random numbers are those of the drive."""
    scores, _ = driven("wwawdwwSq", start="tracking")
    replayed = mv.replay("drive", filter=mv.Filter("robust", particles=300))
    assert replayed.runs[0].score == scores.runs[0].score
    assert len(mv.diagnose("drive", filter=mv.Filter("robust", particles=300)).runs) == 1


def test_another_preset_goes_on_from_the_present_belief():
    """A filter that is localized stays so under another preset; from anywhere it would not be so soon."""
    _, lines = driven("wwww1 ", start="tracking", particles=1000)
    before, after = (float(line.split(" | ")[1].split()[0]) for line in (lines[-3], lines[-2]))
    assert "thesis" in lines[-2]
    assert abs(after - before) < 6
    _, lines = driven("1wa3w2d", laser=False)  # also where another sensor comes and goes
    assert "refined" in lines[-2]


def test_it_is_drawn_live(tmp_path: Path):
    scores, _ = driven("w1wl", to="out.rrd")
    assert scores.rrd == Path("out.rrd")
    chunks = RrdReader(tmp_path / "out.rrd").stream().to_chunks()
    paths = {str(chunk.entity_path) for chunk in chunks}
    assert {CAMERA, "/what_happened"} <= paths
    assert any(path.startswith("/filter/belief/particles") for path in paths)
    headlines = [chunk for chunk in chunks if str(chunk.entity_path) == VERDICT]
    assert "Up to step 4: " in str([chunk.to_record_batch() for chunk in headlines])


def test_a_laser_is_driven_alike():
    scores, lines = driven("w2dlS", laser=True, start="tracking")
    assert "a laser sees no light" in lines[-3]
    assert scores.runs[0].score.updates == 3
    replayed = mv.replay("drive", filter=mv.Filter(particles=300)).runs[0]
    assert replayed.label == "laser"
    assert replayed.score.updates >= 2  # scans after no way and no turn are left out


def test_what_cannot_be_is_told():
    Path("drive").mkdir()
    (Path("drive") / "mine.txt").write_text("mine")
    _, lines = driven("S")
    assert "drive" in lines[-2]
    assert "saved" not in lines[-2]
    assert (Path("drive") / "mine.txt").exists()
    with pytest.raises(OptionError, match="expected global or tracking"):
        drive([], simulation_plan("kidnapped"))
    with pytest.raises(OptionError, match="no preset"):
        driven("w", preset="brilliant")


def test_a_request_to_stop_keeps_what_was_driven():
    def keys() -> Iterator[str]:
        yield "w"
        raise KeyboardInterrupt

    reports = []
    plan = simulation_plan("global", world=QUICK["world"])
    with pytest.raises(KeyboardInterrupt, match="complete"):
        drive(keys(), plan, mv.Filter(particles=300), to="out.rrd", report=reports.append)
    assert reports[0].runs[0].score.updates == 2
    assert Path("out.rrd").exists()
