from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from benchmarks.studies.planted.drives import pack, unpack
from maurice_datasets import demos, sessions, simulation
from maurice_datasets.demos import demo_paths
from maurice_datasets.folders import SimulationPaths
from maurice_datasets.robot.segments import crossings
from maurice_datasets.sessions import demo_plan, write_simulation
from maurice_datasets.simulation import SimulationPlan
from maurice_datasets.surveys import Surveyor
from maurice_datasets.trials.drives import RenderedSession
from maurice_datasets.worlds.build import load_world
from maurice_datasets.worlds.world import floor_at
from maurice_loaders.errors import InputError
from maurice_loaders.formats.registry import open_session
from maurice_loaders.session_log.reader import SurveyLog
from maurice_mcl.values import NamedProgress
from maurice_mcl.values.geometry import INCH_M
from maurice_mcl.values.session import Frame, Moment

QUICK = Surveyor(headings=1, covered=2)
WORLD = cache(load_world)  # the same one, so that it is lit once
UPDATES = 6


TOLD: list[tuple[int, int, str]] = []  # what is told of the progress of making the demo


def write_demo(
    folder: Path, seed: int = 0, updates: int = UPDATES, progress: NamedProgress | None = None
) -> SimulationPaths:
    return write_simulation(folder, demo_plan(seed, updates), surveyor=QUICK, progress=progress)


@pytest.fixture(scope="module", autouse=True)
def one_world() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(simulation, "load_world", WORLD)
        yield


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> SimulationPaths:
    folder = tmp_path_factory.mktemp("demo") / "zero"
    return write_demo(folder, progress=lambda *told: TOLD.append(told))


def contents(paths: SimulationPaths) -> dict[str, bytes]:
    folder = paths.session.parent
    return {str(f.relative_to(folder)): f.read_bytes() for f in folder.rglob("*") if f.is_file()}


@pytest.mark.slow
def test_a_seed_decides_every_byte(demo, tmp_path):
    again = write_demo(tmp_path / "again")
    other = write_demo(tmp_path / "other", 1, updates=1)
    assert contents(again) == contents(demo)
    assert not (set(contents(other).values()) & set(contents(demo).values()))


def test_the_session_reads_back(demo):
    log = open_session(demo.session)
    assert (log.info.display_units, log.info.survey) == ("in", demo.survey)
    assert log.info.motion["model"] == "maurice"
    assert {floor.name for floor in log.info.arena.floors} == {"wood", "carpet"}
    assert log.info.start is not None
    (camera,) = log.info.cameras
    assert (camera.width_px, camera.height_px) == (176, 144)
    moments = list(open_session(demo.session).moments())
    assert len(moments) == UPDATES
    for moment in moments:
        turn, straight = moment.frame.motions
        assert (turn[:2] == 0).all()
        assert turn[2] != 0
        assert straight[0] >= 0
        assert (straight[1:] == 0).all()
        assert moment.frame.image.shape == (144, 176, 3)
        assert moment.truth is not None
    times = np.diff([m.frame.time_s for m in moments])
    assert (times > 3.3).all()
    assert (times < 25).all()
    first = next(iter(log.moments()))
    assert log.info.arena is not None
    assert log.info.start is not None
    x, y, _ = log.info.start
    assert first.events[0] == f"floor {floor_at(log.info.arena, x, y)}"


def test_the_survey_reads_back_with_nominal_poses_and_covered_pictures(demo):
    pictures = list(SurveyLog(demo.survey).survey_pictures())
    assert sum(p.covered for p in pictures) == 2
    poses = np.array([p.pose for p in pictures if p.pose is not None])
    inches = poses[:, :2] / INCH_M
    assert len(poses) == 78
    assert np.allclose((inches - 8) / 18, np.rint((inches - 8) / 18))


def test_floors_are_named_where_they_change(world):
    border = min(
        f.polygon[:, 0].min() for f in world.arena.floors if f.name == "carpet" and f.polygon[0, 1] == 0
    )
    x = np.linspace(border - 0.2, border + 0.3, 101)
    path = np.stack([x, np.full(101, 1.8), np.zeros(101)], axis=1)
    ((share, floor),) = crossings(path, world.arena)
    assert floor == "carpet"
    assert share == pytest.approx(0.4, abs=0.02)
    assert crossings(path[::-1], world.arena)[0][1] == "wood"


def test_a_demo_leaves_other_folders_alone_and_nothing_half(tmp_path):
    (tmp_path / "letter.txt").write_text("dear")
    with pytest.raises(InputError):
        write_demo(tmp_path, updates=1)
    assert [f.name for f in tmp_path.iterdir()] == ["letter.txt"]

    def stop(done: int, total: int, what: str) -> None:
        if done == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_demo(tmp_path / "demo", updates=1, progress=stop)
    assert [f.name for f in tmp_path.iterdir()] == ["letter.txt"]


@pytest.mark.slow
def test_the_cache_is_made_once_and_made_again_when_damaged(tmp_path, monkeypatch):
    made: list[Path] = []

    def quick(folder: Path, plan: SimulationPlan, **options: object) -> SimulationPaths:
        made.append(folder)
        return write_simulation(folder, replace(plan, updates=2), surveyor=QUICK)

    monkeypatch.setenv("MAURICE_CACHE", str(tmp_path))
    monkeypatch.setattr(demos, "UPDATES", 2)
    monkeypatch.setattr(sessions, "write_simulation", quick)
    first = demo_paths()
    before = contents(first)
    assert demo_paths() == first
    assert len(made) == 1
    next(first.session.parent.glob("pictures/*.jpg")).write_bytes(b"cut")
    assert demo_paths() == first
    assert len(made) == 2
    assert contents(first) == before
    (first.session.parent / "simulation.json").unlink()
    demo_paths()
    assert len(made) == 3
    assert [f.name for f in (tmp_path / "demos").iterdir()] == [first.session.parent.name]


def test_progress_is_told(demo):
    assert (TOLD[77], TOLD[-1]) == ((78, 78, "survey"), (UPDATES, UPDATES, "session"))


def test_a_drive_comes_back_from_its_bytes_to_the_last_bit(demo: SimulationPaths) -> None:
    log = open_session(demo.session)
    moments = [
        *log.moments(),
        Moment(Frame(9, 1e9, np.zeros((0, 3)), np.zeros((1, 1, 3), np.uint8), "", {"ir": 0.1}), None, ("é",)),
    ]
    moments[-1] = replace(moments[-1], frame=replace(moments[-1].frame, image=moments[0].frame.image))
    again = unpack(pack(RenderedSession(log.info, tuple(moments))))
    for field in ("name", "display_units", "robot", "motion", "cameras", "notes"):
        assert getattr(again.info, field) == getattr(log.info, field)
    for one, other in zip(moments, again.moments(), strict=True):
        assert one.frame.image.tobytes() == other.frame.image.tobytes()
        assert one.frame.motions.tobytes() == other.frame.motions.tobytes()
        assert (one.truth is None) == (other.truth is None)
        assert one.truth is None or np.array_equal(one.truth, other.truth)
        assert (one.events, one.frame.readings) == (other.events, other.frame.readings)
        assert (one.frame.step, one.frame.time_s) == (other.frame.step, other.frame.time_s)
