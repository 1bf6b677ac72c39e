"""How many threads numpy and OpenCV use changes no result."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from helpers.commands import process
from maurice_mcl.threads import THREADS, bound_threads


def test_one_thread_an_operation_unless_the_user_says_otherwise(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in THREADS:
        monkeypatch.setenv(name, "")
        monkeypatch.delenv(name)
    bound_threads()
    assert {os.environ[name] for name in THREADS} == {"1"}
    monkeypatch.delenv("OMP_NUM_THREADS")
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "4")
    bound_threads()
    assert os.environ["OMP_NUM_THREADS"] == "1"  # setting one variable leaves the others bounded
    assert os.environ["OPENBLAS_NUM_THREADS"] == "4"


@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="counts threads as Linux tells them")
@pytest.mark.skipif((os.cpu_count() or 1) < 2, reason="numpy has one thread on one core")
@pytest.mark.parametrize(("package", "threads"), [("maurice_viz", 1), ("maurice_mcl", 1), ("os", None)])
def test_importing_a_package_of_ours_first_bounds_numpy(package: str, threads: int | None) -> None:
    code = f"import os, {package}, numpy; print(len(os.listdir('/proc/self/task')))"
    free = {name: value for name, value in os.environ.items() if name not in THREADS}
    done = subprocess.run([sys.executable, "-c", code], env=free, capture_output=True, text=True, check=True)
    assert int(done.stdout) == threads if threads else int(done.stdout) > 1


def test_one_and_two_threads_give_the_same_steps(small_session: Path, tmp_path: Path) -> None:
    """Every step that a saved run holds, bit by bit: `verify` compares with what is computed now."""
    words = ("--feature", "best", "--particles", "300", "-o", "none")
    one, two = (dict.fromkeys(THREADS, number) for number in ("1", "2"))
    process(small_session, *words, "--save-run", tmp_path / "one", **one)
    assert "the same, all 14 steps to the last bit" in process("verify", tmp_path / "one", **two).stdout
