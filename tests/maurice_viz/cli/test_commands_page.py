"""docs/commands.md says what the commands are: their options, and every key of their JSON."""

from __future__ import annotations

import importlib.util
import os
import re
from pathlib import Path
from types import ModuleType

import pytest

from helpers.json_outputs import SLOW, WORDS, keys_of, output_of, sample, samples_on, write_material
from maurice_viz.cli.app import COMMANDS, FAMILIES, load

PAGE = Path(__file__).parents[3] / "docs" / "commands.md"
AGAIN = "run .venv/bin/python docs/make_commands.py"


@pytest.fixture(scope="module")
def page() -> str:
    return PAGE.read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with what the commands read: a small drive, saved runs of it, its survey."""
    folder, before = tmp_path_factory.mktemp("json"), Path.cwd()
    os.chdir(folder)
    try:
        write_material(Path())
    finally:
        os.chdir(before)
    return folder


def _maker() -> ModuleType:
    spec = importlib.util.spec_from_file_location("make_commands", PAGE.parent / "make_commands.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_page_is_as_it_is_made(page):
    assert page == _maker().made(page, samples_on(page)), AGAIN


@pytest.mark.parametrize("name", COMMANDS)
def test_every_option_stands_in_the_section_of_its_command(name, page):
    section = re.split(rf"^## maurice-replay {name}$", page, flags=re.MULTILINE)[1].split("\n## ")[0]
    named = set(re.findall(r"--[\w-]+", "".join(re.findall(r"^\* (.*?): ", section, re.MULTILINE))))
    names = [{*one.opts, *one.secondary_opts} for one in load(COMMANDS[name]).params]
    options = [kept for kept in ({w for w in words if w.startswith("--")} for words in names) if kept]
    assert named <= set().union(*options), AGAIN
    assert all(words & named for words in options), AGAIN


def test_every_command_with_json_has_a_sample(page):
    printing = {
        name for name, one in COMMANDS.items() if any("--json" in option.opts for option in load(one).params)
    }
    assert printing == set(WORDS) == set(samples_on(page)), AGAIN


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.slow) if name in SLOW else name for name in WORDS]
)
def test_the_keys_of_json_are_those_of_its_sample(name, page, folder, monkeypatch):
    monkeypatch.chdir(folder)
    now, shown = (set(keys_of(one)) for one in (sample(output_of(name)), samples_on(page)[name]))
    assert (sorted(now - shown), sorted(shown - now)) == ([], []), AGAIN


PAGES = [*PAGE.parent.rglob("*.md"), *(PAGE.parents[1] / name for name in ("README.md", "CONTRIBUTING.md"))]


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.name)
def test_what_pages_type_has_options_of_its_command(path):
    for line in re.findall(r"maurice-replay ([a-z][^`\n]*)", path.read_text(encoding="utf-8")):
        words = re.sub(r"['\"(]", " ", re.split(r"[#|>]", line)[0]).split()
        name = " ".join(words[: 2 if words[:1] and words[0] in FAMILIES else 1])
        if name not in COMMANDS:
            continue  # help, or a session that is replayed
        known = {text for option in load(COMMANDS[name]).params for text in option.opts} | {"--help"}
        known |= {text for option in load(COMMANDS[name]).params for text in option.secondary_opts}
        typed = {word.rstrip(".,;:)").split("=")[0] for word in words if re.match(r"--?[a-z]", word)}
        assert typed <= known, line
