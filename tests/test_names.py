"""Our folders hide nobody's packages: `datasets` is HuggingFace's, and stays theirs."""

from __future__ import annotations

import ast
import importlib
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


def python(code: str, cwd: Path, path: Path) -> str:
    env = os.environ | {"PYTHONPATH": str(path)}
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=cwd, env=env, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def test_an_installed_datasets_is_not_hidden_and_ours_works_beside_it(tmp_path):
    (tmp_path / "datasets").mkdir()
    (tmp_path / "datasets" / "__init__.py").write_text("OWNER = 'somebody else'\n")
    (tmp_path / "datasets" / "features.py").write_text("KIND = 'theirs'\n")
    code = (
        "from datasets import OWNER; from datasets.features import KIND; import maurice_datasets.sessions; "
    )
    assert python(code + "print(OWNER, KIND)", ROOT, tmp_path) == "somebody else theirs"


def test_without_it_the_folder_is_no_package_of_that_name(tmp_path):
    code = """
try:
    import datasets
except ModuleNotFoundError as problem:
    print(problem)
"""
    assert "maurice_datasets" in python(code, ROOT, tmp_path)


def test_a_replay_is_ready_without_what_others_need(tmp_path):
    """No table library, no simulation, no bags: they took a quarter of the time until the first step."""
    code = "import sys, maurice_viz.app.replay, maurice_viz.cli.replay, maurice_viz.app.diagnose; "
    slow = {
        "polars",
        "scipy",
        "rosbags",
        "mcap",
        "ruamel",
        "maurice_datasets",
        "maurice_loaders.bags.recording",
    }
    code += f"print(sorted({slow} & set(sys.modules)))"
    assert python(code, tmp_path, tmp_path) == "[]"


@pytest.mark.parametrize("name", ["maurice_mcl", "maurice_loaders", "maurice_datasets", "maurice_viz"])
def test_the_names_that_type_checkers_see_are_those_that_are_there(name):
    page = importlib.import_module(name)
    tree = ast.parse(Path(str(page.__file__)).read_text(encoding="utf-8"))
    (checked,) = (
        node for node in tree.body if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
    )
    seen = [alias.asname for line in checked.body if isinstance(line, ast.ImportFrom) for alias in line.names]
    assert sorted(map(str, seen)) == sorted(page.__all__)
    assert all(hasattr(page, public) for public in page.__all__)
