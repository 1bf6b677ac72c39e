"""What commands do to start sooner; how many threads numpy and OpenCV use, which changes no result."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from helpers.commands import process
from maurice_mcl import THREADS, bound_threads
from maurice_viz.cli.app import COMMANDS

HEAVY = (
    "rerun",
    "matplotlib",
    "pandas",
    "jinja2",
    "av",
    "dask",
    "scipy.signal",
    "scipy.stats",
    "scipy.optimize",
)


def _seen(code: str) -> dict[str, object]:
    """Run code in a fresh Python and return what it has put into `seen`."""
    told = subprocess.run(
        [sys.executable, "-c", f"import json, sys\nseen = {{}}\n{code}\nprint(json.dumps(seen))"],
        check=True,
        capture_output=True,
        text=True,
    )
    return dict(json.loads(told.stdout))


def test_pyarrow_does_not_import_pandas_until_somebody_asks_for_its_tables():
    pytest.importorskip("pandas")
    seen = _seen(
        "import pyarrow as pa\n"
        "from maurice_viz.cli.shared.startup import skip_pandas\n"
        "skip_pandas()\n"
        "pa.array([0.5]), pa.table({'a': [1]})\n"
        "seen['early'] = 'pandas' in sys.modules\n"
        "seen['cell'] = int(pa.table({'a': [1]}).to_pandas().a[0])\n"
        "import pandas\n"
        "seen['missing'] = pa.array(pandas.Series([1.0, float('nan')])).null_count\n"
    )
    assert seen == {"early": False, "cell": 1, "missing": 1}


def test_no_command_imports_rerun_matplotlib_or_templates_before_it_is_called():
    seen = _seen(
        "from maurice_viz.cli.app import COMMANDS, load\n"
        "for name, one in COMMANDS.items():\n"
        "    load(one)\n"
        f"    seen[name] = [one for one in {HEAVY!r} if one in sys.modules]\n"
    )
    assert seen == {name: [] for name in COMMANDS}


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
