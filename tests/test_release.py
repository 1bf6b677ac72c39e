"""The sdist and the wheel, tried in a fresh environment: what a user gets from the index.

`make release-check` runs it; it installs packages.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tomllib
import venv
import zipfile
from email import message_from_bytes
from pathlib import Path

import pytest

from helpers.commands import no_display, one_line

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[1]
SETTINGS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
VERSION = SETTINGS["project"]["version"]
FOLDERS = SETTINGS["tool"]["setuptools"]["package-dir"]
PYTHONS = [line.split()[-1] for line in SETTINGS["project"]["classifiers"] if " :: 3." in line]


def run(*words: object, cwd: Path = ROOT, expect: int = 0) -> subprocess.CompletedProcess[str]:
    command = [str(word) for word in words]
    done = subprocess.run(command, cwd=cwd, env=no_display(), capture_output=True, text=True, check=False)
    assert done.returncode == expect, (done.stdout, done.stderr)
    return done


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """Build the sdist from the files that belong in it alone, and the wheel from the sdist."""
    source, built = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("dist")
    for folder in FOLDERS.values():
        shutil.copytree(ROOT / folder, source / folder, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "setup.py", "MANIFEST.in", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, source)
    run(sys.executable, "-m", "build", "--outdir", built, source)
    assert (built / f"maurice_replay-{VERSION}.tar.gz").exists()
    (file,) = built.glob("*.whl")
    return file


@pytest.fixture(scope="module")
def command(wheel, tmp_path_factory):
    """Install the wheel alone, without an extra, into an environment of its own."""
    folder = tmp_path_factory.mktemp("fresh")
    venv.create(folder, with_pip=True)
    binaries = folder / ("Scripts" if os.name == "nt" else "bin")
    run(
        binaries / "python",
        "-m",
        "pip",
        "install",
        "--quiet",
        "--constraint",
        ROOT / "constraints.txt",
        wheel,
    )
    return binaries / "maurice-replay"


def test_the_wheel_holds_every_file_of_the_packages(wheel):
    expected = {
        "/".join([package, *file.relative_to(ROOT / folder).parts])
        for package, folder in FOLDERS.items()
        for file in (ROOT / folder).rglob("*")
        if file.is_file() and file.suffix != ".pyc"
    }
    names = {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}
    assert names == expected
    assert {f"{package}/py.typed" for package in FOLDERS} <= names


def test_the_page_on_the_index_has_no_relative_link(wheel):
    archive = zipfile.ZipFile(wheel)
    (name,) = [name for name in archive.namelist() if name.endswith("/METADATA")]
    about = message_from_bytes(archive.read(name))
    repository = SETTINGS["project"]["urls"]["Repository"]
    assert about["Description-Content-Type"] == "text/markdown"
    assert about["Project-URL"] == f"Repository, {repository}"
    text = about.get_payload()
    assert text.count("](") == (ROOT / "README.md").read_text(encoding="utf-8").count("](")
    targets = re.findall(r"\]\(([^)]+)\)", text)
    assert all(target.startswith("https://") for target in targets)
    ours = [target for target in targets if target.startswith(repository)]
    assert len(ours) > 20
    for target in ours:
        file = re.sub(r"^/(blob|raw)/main/", "", target.removeprefix(repository).partition("#")[0])
        assert (ROOT / file).exists(), target


def test_the_version_is_the_same_everywhere(command):
    assert f"\nversion: {VERSION}\n" in (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\n## {VERSION}" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert run(command, "--version").stdout == f"maurice-replay {VERSION}\n"


def test_first_commands_in_a_fresh_environment(command, tmp_path):
    assert "demo" in run(command, "--help", cwd=tmp_path).stdout
    run(command, "demo", cwd=tmp_path)
    assert (tmp_path / "demo.rrd").stat().st_size > 100_000
    run(command, "demo", "features", "--session-only", "mine", cwd=tmp_path)
    run(command, "mine", "-o", "none", "--save-run", "run", cwd=tmp_path)
    run(command, "diagnose", "run", cwd=tmp_path)
    run(command, "report", "run", "-o", "report.html", cwd=tmp_path)


def test_figures_without_matplotlib_name_the_command_that_installs_it(command, tmp_path):
    failed = run(command, "calibrate", "noise", tmp_path, "-o", "noise.png", cwd=tmp_path, expect=1)
    line = one_line(failed.stderr)
    assert "noise.png" in line
    assert "pip install 'maurice-replay[plots]'" in line


@pytest.mark.parametrize("python", PYTHONS)
def test_constraints_resolve(python, tmp_path):
    """For the first release of each Python, with wheels for all: nobody needs a compiler."""
    extras = [word for extra in SETTINGS["project"]["optional-dependencies"] for word in ("--extra", extra)]
    words = ["--constraint", "constraints.txt", "--python-version", f"{python}.0", "--only-binary", ":all:"]
    run(sys.executable, "-m", "uv", "pip", "compile", "--quiet", *extras, *words, "pyproject.toml")
