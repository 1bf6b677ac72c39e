"""How many threads numpy and OpenCV use changes no result."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from helpers.commands import process
from maurice_viz.cli.main import THREADS, bound_threads


def test_one_thread_an_operation_unless_the_user_says_otherwise(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in THREADS:
        monkeypatch.setenv(name, "")
        monkeypatch.delenv(name)
    bound_threads()
    assert {os.environ[name] for name in THREADS} == {"1"}
    monkeypatch.delenv("OMP_NUM_THREADS")
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "4")
    bound_threads()
    assert "OMP_NUM_THREADS" not in os.environ
    assert os.environ["OPENBLAS_NUM_THREADS"] == "4"


def test_one_and_two_threads_give_the_same_steps(small_session: Path, tmp_path: Path) -> None:
    """Every step that a saved run holds, bit by bit: `verify` compares with what is computed now."""
    words = ("--feature", "best", "--particles", "300", "-o", "none")
    one, two = (dict.fromkeys(THREADS, number) for number in ("1", "2"))
    process(small_session, *words, "--save-run", tmp_path / "one", **one)
    assert "the same, all 14 steps to the last bit" in process("verify", tmp_path / "one", **two).stdout
