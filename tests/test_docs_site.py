"""The documentation builds as a site: strictly, without a network."""

import importlib.util
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.mark.skipif(
    importlib.util.find_spec("mkdocstrings") is None,
    reason="the site's packages are not installed: pip install 'maurice-replay[docs]'",
)
def test_the_site_builds_and_has_the_api(tmp_path: Path) -> None:
    command = [
        sys.executable,
        "-m",
        "mkdocs",
        "build",
        "--quiet",
        "--strict",
        "--site-dir",
        str(tmp_path / "site"),
    ]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    page = (tmp_path / "site" / "api.html").read_text(encoding="utf-8")
    for name in ("maurice_viz", "maurice_loaders", "maurice_mcl", "maurice_datasets"):
        assert f'id="{name}"' in page, name
