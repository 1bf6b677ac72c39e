"""The four folders depend on each other in one direction, and every package is in the wheel."""

import ast
import fnmatch
import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FOLDERS = {
    "maurice_viz": "maurice_viz",
    "datasets": "maurice_datasets",
    "loaders": "maurice_loaders",
    "mcl": "maurice_mcl",
}
ORDER = list(FOLDERS.values())  # each may import those after it, and itself
HEAVY = {
    "rerun": {"maurice_viz"},
    "typer": {"maurice_viz"},
    "rich": {"maurice_viz"},
    "polars": {"maurice_viz", "maurice_datasets", "maurice_loaders"},
}
SOURCES = [(folder, file) for folder in FOLDERS for file in sorted((ROOT / folder).rglob("*.py"))]


def imported(file: Path) -> set[str]:
    """The top-level names of everything a file imports by an absolute name, wherever in the file."""
    names = set()
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            names.add((node.module or "").split(".")[0])
    return names


def test_there_is_something_to_check() -> None:
    assert {folder for folder, _ in SOURCES} == set(FOLDERS)


@pytest.mark.parametrize(("folder", "file"), SOURCES, ids=lambda value: str(value).removeprefix(f"{ROOT}/"))
def test_imports_go_one_way(folder: str, file: Path) -> None:
    package = FOLDERS[folder]
    names = imported(file)
    above = set(ORDER[: ORDER.index(package)])
    assert not names & above, f"{file} imports what stands above it"
    assert package not in names, f"{file} should import its own package relatively"
    bare = {"mcl", "loaders", "datasets"}  # would load a second copy of every class
    assert not names & bare, f"{file} imports a folder by its bare name"
    for library, allowed in HEAVY.items():
        assert library not in names or package in allowed, f"{file} imports {library}"


def test_the_core_never_prints() -> None:
    for file in sorted((ROOT / "mcl").rglob("*.py")):
        calls = [n for n in ast.walk(ast.parse(file.read_text(encoding="utf-8"))) if isinstance(n, ast.Call)]
        assert not any(isinstance(c.func, ast.Name) and c.func.id == "print" for c in calls), file


def test_package_list_is_complete() -> None:
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]
    found = set()
    for folder, package in FOLDERS.items():
        for directory in {ROOT / folder} | {file.parent for file in (ROOT / folder).rglob("*.py")}:
            found.add(".".join([package, *directory.relative_to(ROOT / folder).parts]))
    assert set(settings["packages"]) == found
    assert settings["package-dir"] == {package: folder for folder, package in FOLDERS.items()}


def test_constraints_name_versions_and_nothing_else() -> None:
    lines = (ROOT / "constraints.txt").read_text().split("\n")
    pins = [line for line in lines if line and not line.startswith("#")]
    assert pins
    for pin in pins:
        name, _, version = pin.partition("==")
        assert name, pin
        assert version, pin
        assert " " not in pin, pin


def test_files_that_the_architecture_names_exist() -> None:
    text = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    named = set(re.findall(r"`(?:[\w/]+/)?([\w*]+\.py)`", text))
    there = {file.name for _, file in SOURCES} | {file.name for file in (ROOT / "tests").glob("*.py")}
    assert len(named) > 50
    assert not [name for name in named if not fnmatch.filter(there, name)]
