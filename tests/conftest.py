"""A small session and survey on disk, quick to make, whose pictures are a formula of the pose."""

import os
import signal
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import settings

from maurice_loaders.session_log.writer import SessionWriter
from maurice_mcl.arrays import F64, U8
from maurice_mcl.geometry import compose
from maurice_mcl.map import Arena, Region
from maurice_mcl.session import SessionInfo

# What the tester set for their own terminal and runs; some of it is read only once, when typer is imported.
OWN = {"COLUMNS", "LINES", "FORCE_COLOR", "NO_COLOR", "PY_COLORS", "CLICOLOR_FORCE", "TERMINAL_WIDTH"}
OWN |= {"DISPLAY", "WAYLAND_DISPLAY"}  # where no test shall open a window
for _name in [name for name in os.environ if name in OWN or name.startswith(("TTY_", "MAURICE_FILTER_"))]:
    del os.environ[_name]
os.environ.setdefault("PYTHONUTF8", "1")  # what tests start writes what they read

# the same examples on every machine and day, however busy; `pytest --hypothesis-profile=default` draws others
settings.register_profile("anywhere", derandomize=True, deadline=None)
settings.load_profile("anywhere")

COLUMNS, ROWS, HEADINGS, SPACING_M = 5, 4, 8, 0.5
UPDATES = 14


@pytest.fixture(autouse=True)
def _own_cache(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    """Keep every test out of the user's folders; one cache serves the whole run of tests."""
    monkeypatch.setenv("MAURICE_CACHE", str(tmp_path_factory.getbasetemp() / "maurice-cache"))
    monkeypatch.setenv("MAURICE_STATE", str(tmp_path_factory.getbasetemp() / "maurice-state"))


@pytest.fixture(autouse=True)
def _signals_as_in_a_terminal() -> Iterator[None]:
    """Let tests, and what they start, be stopped: in the background, or under nohup, Ctrl-C is ignored."""
    heard = {signal.SIGINT: signal.default_int_handler, signal.SIGTERM: signal.SIG_DFL}
    ignored = [number for number in heard if signal.getsignal(number) is signal.SIG_IGN]
    for number in ignored:
        signal.signal(number, heard[number])
    yield
    for number in ignored:
        signal.signal(number, signal.SIG_IGN)


def small_arena() -> Arena:
    width, depth = COLUMNS * SPACING_M, ROWS * SPACING_M
    corners = [(0.0, 0.0), (width, 0.0), (width, depth), (0.0, depth)]
    walls = np.array([[*a, *b] for a, b in zip(corners, corners[1:] + corners[:1], strict=True)])
    floor = Region("wood", np.array(corners))
    return Arena((0.0, 0.0, width, depth), walls, floors=(floor,))


def picture_at(pose: F64, height: int = 30, width: int = 40) -> U8:
    columns = pose[2] + np.linspace(0.5, -0.5, width)
    red = 120 + 90 * np.sin(columns + pose[0])
    green = 60 + 40 * pose[1] + 30 * np.cos(columns)
    blue = 110 + 60 * np.sin(2 * columns + pose[1])
    image = np.repeat(np.stack([red, green, blue], axis=1)[None], height, axis=0)
    image[:, :: 3 + int(2 * abs(pose[0]))] *= 0.6
    return np.clip(image, 0, 255).astype(np.uint8)


def write_small_survey(folder: Path) -> Path:
    path = folder / "survey.log"
    with SessionWriter(path, SessionInfo("kleiner Raum", "m", arena=small_arena()), "survey") as log:
        log.image(0.0, np.full((30, 40, 3), 18, np.uint8), covered=True)
        poses = [
            np.array([(i + 0.5) * SPACING_M, (j + 0.5) * SPACING_M, k * 2 * np.pi / HEADINGS])
            for j in range(ROWS)
            for i in range(COLUMNS)
            for k in range(HEADINGS)
        ]
        for t, pose in enumerate(poses, start=1):
            log.image(float(t), picture_at(pose), pose=pose)
    return path


def write_small_session(folder: Path, *, truth: bool = True, updates: int = UPDATES) -> Path:
    """A drive on a circle; its odometry is exact, so that the generic motion model serves well."""
    path = folder / "session.log"
    pose = np.array([1.6, 0.6, 0.3])
    info = SessionInfo("kleine Fahrt", "m", start=pose, survey=folder / "survey.log", arena=small_arena())
    with SessionWriter(path, info) as log:
        for step in range(updates):
            motion = np.array([0.12, 0.0, 0.21])
            pose = compose(pose, motion)
            log.odometry(2.0 * step + 1, motion)
            log.image(2.0 * step + 2, picture_at(pose))
            if truth:
                log.truth(2.0 * step + 2, pose)
    return path


@pytest.fixture
def small_session(tmp_path: Path) -> Path:
    """A session log of 14 pictures whose header names the survey beside it."""
    write_small_survey(tmp_path)
    return write_small_session(tmp_path)
