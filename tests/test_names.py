"""Our folders hide nobody's packages: `datasets` is HuggingFace's, and stays theirs."""

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]


def python(code: str, cwd: Path, path: Path) -> str:
    env = os.environ | {"PYTHONPATH": str(path)}
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=cwd, env=env, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def stub_datasets(folder: Path) -> Path:
    (folder / "datasets").mkdir()
    (folder / "datasets" / "__init__.py").write_text("OWNER = 'somebody else'\n")
    return folder


def test_an_installed_datasets_is_not_hidden(tmp_path: Path) -> None:
    stub = stub_datasets(tmp_path)
    assert python("import datasets; print(datasets.OWNER)", ROOT, stub) == "somebody else"


def test_ours_works_beside_it(tmp_path: Path) -> None:
    stub = stub_datasets(tmp_path)
    code = "import datasets, maurice_datasets.maurice as ours; print(datasets.OWNER, bool(ours.__doc__))"
    assert python(code, tmp_path, stub) == "somebody else True"


def test_datasets_has_no_init() -> None:
    """With one, `import datasets` in a checkout would find our folder before the installed package."""
    assert not (ROOT / "datasets" / "__init__.py").exists()


def test_the_command_starts_without_importing_rerun(tmp_path: Path) -> None:
    """Nor whatever else is slow to import, and that few commands need."""
    slow = {"rerun", "matplotlib", "scipy.signal", "scipy.stats", "scipy.optimize"}
    code = f"import sys, maurice_viz.cli; print(sorted({slow} & set(sys.modules)))"
    assert python(code, tmp_path, tmp_path) == "[]"
