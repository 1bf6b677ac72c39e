"""The packages, and the rooms inside each, depend on each other in one direction; nothing is hidden.

Every import counts: at the top of a file, inside a function, and under TYPE_CHECKING.
"""

from __future__ import annotations

import ast
import re
from collections import Counter, defaultdict
from collections.abc import Iterator
from functools import cache
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
    "polars": {"maurice_viz", "maurice_datasets", "maurice_loaders", "maurice_mcl"},
}
# Rooms of each package from the ground up: a room may import those before a `>` before it, not its neighbors.
ROOMS = {
    "maurice_mcl": "errors > values > sensor > library > filter > config > scoring > reasons fitting",
    "maurice_loaders": "errors > files > reading > formats > session_log > bags > amcl > config_files > "
    "libraries live > runs > export calibration_trials doctor > importing",
    "maurice_datasets": "tasks > worlds > render robot > simulation",
    "maurice_viz": "errors style > entities playback > drawing > scene > text > panels > layouts > "
    "viewer plots > running > app > reports notebook > cli",
}


@cache
def modules() -> dict[str, Path]:
    """Every module by its dotted name."""
    found = {}
    for folder, package in FOLDERS.items():
        for file in sorted((ROOT / folder).rglob("*.py")):
            parts = [package, *file.relative_to(ROOT / folder).with_suffix("").parts]
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = file
    return found


@cache
def tree(file: Path) -> ast.Module:
    return ast.parse(file.read_text(encoding="utf-8"))


@cache
def nodes(file: Path) -> list[ast.AST]:
    return list(ast.walk(tree(file)))


@cache
def outside(file: Path) -> set[str]:
    """The top-level names of everything a file imports by an absolute name."""
    names = set()
    for node in nodes(file):
        if isinstance(node, ast.Import):
            names |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            names.add((node.module or "").split(".")[0])
    return names


def inside(name: str) -> Iterator[str]:
    """The modules of the same package that a module imports."""
    file = modules()[name]
    home = name.split(".") if file.name == "__init__.py" else name.split(".")[:-1]
    for node in nodes(file):
        if not isinstance(node, ast.ImportFrom) or not node.level:
            continue
        base = home[: len(home) - node.level + 1] + (node.module.split(".") if node.module else [])
        for alias in node.names:
            full = ".".join([*base, alias.name])
            target = full if full in modules() else ".".join(base)
            assert target in modules(), f"{file}: nothing is at {target}"
            if target != name:
                yield target


@cache
def graph() -> dict[str, frozenset[str]]:
    return {name: frozenset(inside(name)) for name in modules()}


def room(name: str) -> str:
    """The second part of a dotted name; of a package's front page nothing."""
    return ".".join(name.split(".")[1:2])


def cycle(edges: dict[str, set[str]]) -> list[str]:
    """Some cycle of a directed graph, as a walk; empty where there is none."""
    done: set[str] = set()
    for start in edges:
        walk, choices = [start], [iter(sorted(edges[start]))]
        while walk and start not in done:
            step = next(choices[-1], None)
            if step is None:
                done.add(walk.pop())
                choices.pop()
            elif step in walk:
                return [*walk[walk.index(step) :], step]
            elif step not in done:
                walk.append(step)
                choices.append(iter(sorted(edges.get(step, ()))))
    return []


SOURCES = [(folder, file) for folder in FOLDERS for file in sorted((ROOT / folder).rglob("*.py"))]


def test_there_is_something_to_check():
    assert {folder for folder, _ in SOURCES} == set(FOLDERS)
    assert sum(len(targets) for targets in graph().values()) > 300
    assert cycle({"a": {"b"}, "b": {"c"}, "c": {"b"}}) == ["b", "c", "b"]
    assert cycle({"a": {"b", "c"}, "b": {"c"}, "c": set()}) == []


@pytest.mark.parametrize("folder", FOLDERS)
def test_packages_import_one_way(folder):
    package = FOLDERS[folder]
    above = set(ORDER[: ORDER.index(package)])
    for file in sorted((ROOT / folder).rglob("*.py")):
        names = outside(file)
        assert not names & above, f"{file} imports what stands above it"
        assert package not in names, f"{file} should import its own package relatively"
        bare = {"mcl", "loaders", "datasets"}  # would load a second copy of every class
        assert not names & bare, f"{file} imports a folder by its bare name"
        assert "benchmarks" not in names, f"{file} imports what is not installed"
        for library, allowed in HEAVY.items():
            assert library not in names or package in allowed, f"{file} imports {library}"


def test_no_cycle_between_modules():
    assert cycle({name: set(targets) for name, targets in graph().items()}) == []


FRONT_PAGES = [  # of folders whose files no registry lists
    page
    for _, page in SOURCES
    if page.name == "__init__.py" and not {*page.parent.glob("registry.py"), *page.parent.glob("app.py")}
]


@pytest.mark.parametrize("page", FRONT_PAGES, ids=lambda page: str(page.parent.relative_to(ROOT)))
def test_a_front_page_names_every_room(page):
    rooms = {file.stem for file in page.parent.glob("*.py")} - {"__init__"}
    rooms |= {inner.parent.name for inner in page.parent.glob("*/__init__.py")}
    assert rooms - set(re.findall(r"\w+", ast.get_docstring(tree(page)) or "")) == set()


@pytest.mark.parametrize("package", ROOMS)
def test_rooms_import_one_way(package):
    floor = {name: number for number, row in enumerate(ROOMS[package].split(" > ")) for name in row.split()}
    top = len(floor)  # what is not listed stands above all that is
    wrong = defaultdict(set)
    for name, targets in graph().items():
        for target in targets:
            here, there = room(name), room(target)
            if not name.startswith(package) or here == there or not here or here not in floor:
                continue
            if floor.get(there, top) >= floor[here]:
                wrong[f"{here} -> {there}"].add(f"{name} -> {target}")
    assert not wrong


@pytest.mark.parametrize("package", ROOMS)
def test_no_cycle_between_rooms(package):
    edges: dict[str, set[str]] = defaultdict(set)
    for name, targets in graph().items():
        if name.startswith(package) and room(name):
            edges[room(name)] |= {room(t) for t in targets if room(t) != room(name) and room(t)}
    assert cycle(edges) == []


def test_only_the_command_line_knows_the_console():
    for file in sorted((ROOT / "maurice_viz").rglob("*.py")):
        if "cli" not in file.parts:
            assert not outside(file) & {"typer", "rich", "click"}, file


def test_only_the_command_line_prints():
    for _, file in SOURCES:
        calls = [node.func for node in nodes(file) if isinstance(node, ast.Call)]
        printing = any(isinstance(call, ast.Name) and call.id == "print" for call in calls)
        assert not printing or "cli" in file.parts, file


def test_nothing_is_unpickled():
    """A pickle runs what it holds; a file of the cache may come from anybody who can write there."""
    modules = {"pickle", "marshal", "shelve", "dill", "cloudpickle"}
    for file in [*(file for _, file in SOURCES), *(ROOT / "benchmarks").rglob("*.py")]:
        names = {node.attr for node in nodes(file) if isinstance(node, ast.Attribute)}
        assert not outside(file) & modules, file
        assert "joblib" not in outside(file) or not names & {"Memory", "dump", "load"}, file
        for node in nodes(file):
            if isinstance(node, ast.keyword) and node.arg == "allow_pickle":
                assert ast.unparse(node.value) == "False", file


def test_files_are_chapters_and_folders_have_room():
    for folder, file in SOURCES:
        assert file.read_text(encoding="utf-8").count("\n") <= 600, file
        assert (ROOT / folder) in file.parents
    folders = Counter(file.parent for _, file in SOURCES if file.name != "__init__.py")
    assert {str(folder): count for folder, count in folders.items() if count > 16} == {}


def test_a_class_name_has_one_meaning():
    defined = defaultdict(set)
    for _, file in SOURCES:
        for node in tree(file).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                defined[node.name].add(str(file.relative_to(ROOT)))
    assert {name: files for name, files in defined.items() if len(files) > 1} == {}


def test_tests_mirror_the_packages():
    for folder in FOLDERS:
        for file in (ROOT / "tests" / folder).rglob("*.py"):
            assert (ROOT / file.parent.relative_to(ROOT / "tests")).is_dir(), file


def test_clean_removes_what_git_ignores():
    recipe = (ROOT / "Makefile").read_text(encoding="utf-8").partition("\nclean:\n")[2].split()
    for line in (ROOT / ".gitignore").read_text(encoding="utf-8").split():
        assert line.strip("/") in recipe


def test_constraints_name_versions_and_nothing_else():
    lines = (ROOT / "constraints.txt").read_text().split("\n")
    pins = [line for line in lines if line and not line.startswith("#")]
    assert pins
    for pin in pins:
        name, _, version = pin.partition("==")
        assert name, pin
        assert version, pin
        assert " " not in pin, pin


def test_files_that_the_architecture_names_exist():
    text = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    names = {file.name for _, file in SOURCES} | {file.name for file in (ROOT / "tests").glob("*.py")}
    files = set(re.findall(r"`(?:[\w/]+/)?(\w+\.py)`", text))
    assert len(files) > 40
    assert files <= names
    folders = set(re.findall(r"`(\w+)/`", text)) - {"typings"}
    rooms = [file for _, file in SOURCES] + [*(ROOT / "benchmarks").rglob("*.py")]
    assert folders <= {part for file in rooms for part in file.parts}
