from __future__ import annotations

import json
from dataclasses import replace
from functools import reduce
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from maurice_datasets import simulation, surveys
from maurice_datasets.folders import SimulationPaths
from maurice_datasets.render.conditions import parse_lights
from maurice_datasets.robot.drive import KIDNAP_M
from maurice_datasets.robot.recorded_path import read_recording
from maurice_datasets.sessions import write_simulation
from maurice_datasets.simulation import SimulationPlan
from maurice_datasets.surveys import Surveyor
from maurice_datasets.tasks import TASKS
from maurice_datasets.worlds.world import World, clearance
from maurice_loaders.errors import InputError
from maurice_loaders.formats.registry import open_session
from maurice_loaders.session_log.reader import SurveyLog
from maurice_loaders.session_log.records import read_header
from maurice_loaders.session_log.writer import SessionWriter
from maurice_mcl.values.geometry import compose_motions
from maurice_mcl.values.session import SessionInfo

QUICK = Surveyor(headings=1, covered=1)
SHORT = SimulationPlan(TASKS["tracking"], updates=4)


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("cache")


@pytest.fixture(autouse=True)
def one_world(world: World, monkeypatch: pytest.MonkeyPatch, cache: Path) -> None:
    """Every arena seed gives the same world, so that it is lit once; surveys are small and cached here."""
    monkeypatch.setenv("MAURICE_CACHE", str(cache))
    monkeypatch.setattr(simulation, "load_world", lambda name, seed, tier: world)
    monkeypatch.setattr(surveys, "_surveyor_of", lambda _: QUICK)


def contents(folder: Path) -> dict[str, bytes]:
    return {str(f.relative_to(folder)): f.read_bytes() for f in folder.rglob("*") if f.is_file()}


def records(paths: SimulationPaths) -> list[dict[str, Any]]:
    return [json.loads(line) for line in paths.session.read_text(encoding="utf-8").splitlines()]


def test_the_same_plan_gives_the_same_bytes(tmp_path: Path) -> None:
    write_simulation(tmp_path / "a", SHORT)
    write_simulation(tmp_path / "b", SHORT)
    assert contents(tmp_path / "a") == contents(tmp_path / "b")


def test_another_seed_changes_the_session_and_not_the_survey(tmp_path: Path) -> None:
    write_simulation(tmp_path / "a", SHORT)
    write_simulation(tmp_path / "b", replace(SHORT, seed=1))
    a, b = contents(tmp_path / "a"), contents(tmp_path / "b")
    survey = {name for name in a if name.startswith("survey")}
    assert len(survey) == 1 + 1 + 78
    assert all(a[name] == b[name] for name in survey)
    assert all(a[name] != b.get(name) for name in a if name not in survey)


def test_another_arena_seed_changes_the_survey_and_not_the_drive(tmp_path: Path) -> None:
    a = write_simulation(tmp_path / "a", SHORT)
    b = write_simulation(tmp_path / "b", replace(SHORT, arena_seed=1))
    assert not {p.read_bytes() for p in a.survey.parent.glob("pictures/*")} & {
        p.read_bytes() for p in b.survey.parent.glob("pictures/*")
    }
    odometry = [[r["odometry"] for r in records(paths) if "odometry" in r] for paths in (a, b)]
    assert odometry[0] == odometry[1]  # here, where the world is the same


def test_the_survey_is_made_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MAURICE_CACHE", str(tmp_path / "cache"))
    told: list[str] = []
    for name in ("a", "b"):
        plan = replace(SHORT, seed=len(told))
        write_simulation(tmp_path / name, plan, progress=lambda done, total, what: told.append(what))
    assert told.count("survey") == 78
    assert told.count("session") == 8


def test_the_global_task_hides_the_start_and_tracking_tells_it(tmp_path: Path) -> None:
    known = open_session(write_simulation(tmp_path / "a", SHORT).session)
    hidden = open_session(write_simulation(tmp_path / "b", replace(SHORT, task=TASKS["global"])).session)
    assert known.info.start is not None
    assert hidden.info.start is None
    truth = [[m.truth for m in log.moments()] for log in (known, hidden)]
    assert np.array_equal(truth[0], truth[1])


def test_a_kidnapping_is_in_the_truth_and_in_no_odometry(tmp_path: Path) -> None:
    plan = replace(SHORT, task=TASKS["kidnapped"])
    lines = records(write_simulation(tmp_path / "a", plan))
    (at,) = [k for k, r in enumerate(lines) if r.get("event") == "kidnapped"]
    before = [np.array(r["truth"]) for r in lines[:at] if "truth" in r][-1]
    after = next(np.array(r["truth"]) for r in lines[at:] if "truth" in r)
    assert np.hypot(*(after - before)[:2]) >= KIDNAP_M
    assert sum("image" in r for r in lines[:at]) == 2
    assert all(abs(r["odometry"][0]) < 0.5 for r in lines if "odometry" in r)
    log = open_session(tmp_path / "a" / "session.log")
    assert [("kidnapped" in m.events) for m in log.moments()] == [False, False, True, False]


def test_wheels_that_slip_count_more_than_the_robot_moves(tmp_path: Path) -> None:
    slip_at = range(2, 4)
    log = open_session(write_simulation(tmp_path / "a", replace(SHORT, slip_at=slip_at)).session)
    before = None
    for moment in log.moments():
        step, truth = moment.frame.step, moment.truth
        assert truth is not None
        told = any("the wheels spin" in text for text in moment.events)
        assert told == (step in slip_at)
        if before is not None:
            driven_m = float(np.hypot(*reduce(compose_motions, moment.frame.motions)[:2]))
            moved_m = float(np.hypot(*(truth - before)[:2]))
            assert (moved_m < 0.5 * driven_m) == told
        before = truth


def test_light_changes_are_told_where_they_happen(tmp_path: Path) -> None:
    plan = replace(SHORT, lights=parse_lights("dim:0.3@3"))
    log = open_session(write_simulation(tmp_path / "a", plan).session)
    moments = list(log.moments())
    assert [any(e.startswith("lights") for e in m.events) for m in moments] == [False, False, True, False]
    plain = list(open_session(write_simulation(tmp_path / "b", SHORT).session).moments())
    ratio = [m.frame.image.mean() / p.frame.image.mean() for m, p in zip(moments, plain, strict=True)]
    assert ratio[:2] == [1, 1]
    assert max(ratio[2:]) < 0.95


def test_half_resolution_is_the_cameras_and_so_of_survey_and_session_alike(tmp_path: Path) -> None:
    plan = replace(SHORT, half_resolution=True)
    paths, plain = write_simulation(tmp_path / "a", plan), write_simulation(tmp_path / "b", SHORT)
    for log in (paths.session, paths.survey):
        assert any("half resolution" in note for note in read_header(log)[0].notes)
    survey = next(p.image for p in SurveyLog(paths.survey).survey_pictures() if p.pose is not None)
    session = next(open_session(paths.session).moments()).frame.image
    full = next(open_session(plain.session).moments()).frame.image
    apart = [np.abs(np.diff(image.astype(float), axis=1)[:, ::2]).mean() for image in (survey, session, full)]
    assert max(apart[:2]) < 0.7 * apart[2]  # JPEG keeps twins from being quite equal


def test_a_recorded_session_is_driven_again_in_free_space(tmp_path: Path, world: World) -> None:
    first = write_simulation(tmp_path / "a", replace(SHORT, updates=6))
    plan = replace(SHORT, task=TASKS["global"], seed=9, recording=first.session)
    again = write_simulation(tmp_path / "b", plan)
    old, new = (list(open_session(p.session).moments()) for p in (first, again))
    assert len(new) == 4  # no more than asked for
    for a, b in zip(old, new, strict=False):
        assert np.array_equal(a.frame.motions, b.frame.motions)
    steps = [np.diff([m.truth for m in moments[:4] if m.truth is not None], axis=0) for moments in (old, new)]
    assert np.hypot(*steps[0].T[:2]) == pytest.approx(np.hypot(*steps[1].T[:2]))
    places = np.array([m.truth[:2] for m in new if m.truth is not None])
    assert clearance(world.arena, places).min() > 0.07
    assert open_session(again.session).info.motion == open_session(first.session).info.motion


def logged(file: Path, ways: list[float], kidnapped_at: int = 0) -> Path:
    """Write a drive along x with these ways between its pictures; carried 1 m to the left at one of them."""
    x_m = y_m = 0.0
    with SessionWriter(file, SessionInfo("drive")) as log:
        log.truth(0.0, (0.0, 0.0, 0.0))
        for number, way_m in enumerate(ways, start=1):
            x_m += way_m
            if number == kidnapped_at:
                log.event(number - 0.5, "kidnapped")
                y_m = 1.0
            log.odometry(float(number), (way_m, 0.0, 0.0))
            log.truth(float(number), (x_m, y_m, 0.0))
            log.image(float(number), np.zeros((4, 4, 3), np.uint8))
    return file


def test_where_the_recorded_robot_was_carried_the_simulated_one_is_too(tmp_path: Path) -> None:
    plan = replace(SHORT, updates=9, recording=logged(tmp_path / "in.log", [0.24] * 9, kidnapped_at=6))
    paths = write_simulation(tmp_path / "out", plan)
    moments = list(open_session(paths.session).moments())
    assert [number for number, m in enumerate(moments, start=1) if "kidnapped" in m.events] == [6]
    assert any("was carried: 1 times" in note for note in open_session(paths.session).info.notes)
    assert read_recording(paths.session, 9).carried == 1


def test_a_path_that_fits_nowhere_is_refused(tmp_path: Path) -> None:
    log = logged(tmp_path / "in.log", [10.0] * 9)
    with pytest.raises(InputError, match="fits nowhere"):
        write_simulation(tmp_path / "out", replace(SHORT, updates=400, recording=log))
    assert not (tmp_path / "out").exists()


def test_a_recording_without_movement_or_truth_is_refused(tmp_path: Path) -> None:
    log = tmp_path / "session.log"
    header = '{"format": "maurice-session-log", "version": 1, "kind": "session"}\n'
    log.write_text(header + '{"t": 0, "odometry": [1, 0, 0]}\n')
    with pytest.raises(InputError, match="start pose"):
        read_recording(log, 9)
    log.write_text(header + '{"t": 0, "truth": [1, 0, 0]}\n')
    with pytest.raises(InputError, match="no movement"):
        read_recording(log, 9)
    log.write_text(header + '{"t": 0, "truth": [1, 0, 0]}\n{"t": 9, "image": "a.png"}\n')
    with pytest.raises(InputError, match="without truth"):
        read_recording(log, 9)


@pytest.mark.parametrize(
    "wrong",
    [
        {"tier": "easy"},
        {"gain": "high"},
        {"updates": 0},
        {"task": TASKS["kidnapped"], "recording": Path("a")},
        {"kidnap_at": 3},
        {"task": TASKS["kidnapped"], "updates": 1},
        {"lights": parse_lights("dim@5")},
        {"slip_at": range(5, 6)},
    ],
)
def test_a_plan_that_cannot_be_is_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=r"found|no |nobody"):
        replace(SHORT, **wrong)


def test_a_simulation_that_fails_leaves_nothing(tmp_path: Path) -> None:
    def stop(done: int, total: int, what: str) -> None:
        if what == "session":
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_simulation(tmp_path / "out", SHORT, progress=stop)
    assert not list(tmp_path.iterdir())
