"""What holds for all tests: nothing of the tester's own; and a small session."""

from __future__ import annotations

import faulthandler
import gc
import os
import shutil
import signal
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import settings

from helpers.small_session import write_small_session, write_small_survey

# What the tester set for their own terminal and runs; some of it is read only once, when typer is imported.
OWN = {"COLUMNS", "LINES", "FORCE_COLOR", "NO_COLOR", "PY_COLORS", "CLICOLOR_FORCE", "TERMINAL_WIDTH"}
OWN |= {"DISPLAY", "WAYLAND_DISPLAY"}  # where no test shall open a window
for _name in [name for name in os.environ if name in OWN or name.startswith(("TTY_", "MAURICE_FILTER_"))]:
    del os.environ[_name]
os.environ.setdefault("PYTHONUTF8", "1")  # what tests start writes what they read
# Every command that tests start would compile the project again.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False  # and every run of the tests would rewrite their asserts again

HUNG_S, SLOW_HUNG_S = 600, 2400  # far longer than any test takes, and any marked slow, on a busy machine

# the same examples on every machine and day; `pytest --hypothesis-profile=default` draws others, and more
settings.register_profile("anywhere", derandomize=True, deadline=None, max_examples=30)
settings.load_profile("anywhere")


def pytest_addoption(parser: pytest.Parser) -> None:
    """Let `pytest tests/golden --remake` write the golden texts anew."""
    parser.addoption("--remake", action="store_true", help="write the texts of tests/golden anew")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the longest files, so that no process is left alone with one of them at the end."""
    items.sort(key=lambda item: "pages" not in item.path.parts)


gc.disable()  # thousands of tests are found sooner without looking through what was found already


def pytest_collection_finish() -> None:
    """Leave what was imported and found alone from here on."""
    gc.enable()
    gc.collect()
    gc.freeze()


@pytest.fixture(autouse=True)
def _no_test_hangs(request: pytest.FixtureRequest) -> Iterator[None]:
    """End the process, with where it stood, after a test that does not end: others then go on without it."""
    limit_s = SLOW_HUNG_S if request.node.get_closest_marker("slow") else HUNG_S
    faulthandler.dump_traceback_later(limit_s, exit=True, file=sys.__stderr__)
    yield
    faulthandler.cancel_dump_traceback_later()


@pytest.fixture(scope="session", autouse=True)
def _own_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Keep all tests out of the user's folders; one cache serves them, in whichever process they run."""
    base = tmp_path_factory.getbasetemp()
    shared = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("MAURICE_CACHE", str(shared / "maurice-cache"))
        yield


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


@pytest.fixture(autouse=True)
def _no_real_time() -> Iterator[None]:
    """Undo what SVT-AV1 does as root: a real-time process starves what tests start."""
    yield
    if hasattr(os, "sched_getscheduler") and os.sched_getscheduler(0) != os.SCHED_OTHER:
        gc.collect()  # the encoder's end sets it once more
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))


@pytest.fixture(scope="session")
def _small_session(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("small")
    write_small_survey(folder)
    return write_small_session(folder)


@pytest.fixture
def small_session(_small_session: Path, tmp_path: Path) -> Path:
    """A session log of 14 pictures whose header names the survey beside it: a test's own copy."""
    return Path(shutil.copytree(_small_session.parent, tmp_path, dirs_exist_ok=True)) / _small_session.name
