"""The documentation builds as a site: strictly, without a network, and can be searched."""

from __future__ import annotations

import importlib.util
import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

import maurice_datasets
import maurice_loaders
import maurice_mcl
import maurice_viz

ROOT = Path(__file__).parents[1]


@pytest.mark.slow
@pytest.mark.skipif(
    importlib.util.find_spec("mkdocstrings") is None,
    reason="the site's packages are not installed: pip install 'maurice-replay[docs]'",
)
def test_the_site_builds_and_has_the_api(tmp_path):
    target = ["--site-dir", str(tmp_path / "site")]
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", *target]  # --quiet counts no warnings
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    index = json.loads((tmp_path / "site" / "search" / "search_index.json").read_text(encoding="utf-8"))
    assert any("few heavy" in entry["text"] for entry in index["docs"])
    start = (tmp_path / "site" / "index.html").read_text(encoding="utf-8")
    assert (
        re.findall(
            r"<(?:script|img)[^>]* src=.?https?:|<link[^>]* rel=.?stylesheet[^>]* href=.?https?:", start
        )
        == []
    )
    page = (tmp_path / "site" / "python.html").read_text(encoding="utf-8")
    for package in (maurice_viz, maurice_loaders, maurice_mcl, maurice_datasets):
        for name in package.__all__:
            # what several packages have by one name is described in that which it comes from
            comes_from = str(getattr(getattr(package, name), "__module__", "")).partition(".")[0]
            homes = {package.__name__, comes_from}
            assert any(f'id="{home}.{name}"' in page for home in homes), name
