"""A name or path that no system takes is an InputError of every public function of the four packages."""

from __future__ import annotations

import ast
import inspect
import json
import re
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

import maurice_datasets
import maurice_loaders
import maurice_mcl
import maurice_viz
from helpers.commands import failure, run
from helpers.small_session import write_small_session, write_small_survey
from maurice_mcl.errors import InputError

PACKAGES: tuple[ModuleType, ...] = (maurice_mcl, maurice_loaders, maurice_datasets, maurice_viz)
BAD = {"long": "x" * 5000, "deep": "/".join(["y" * 100] * 60), "nul": "a\0b", "half": "a\ud800b"}
NOT_HERE = {"maurice_viz.show"}  # its widget is an extra
NOT_MADE = {  # they take values that are not made here: rows of trials, a plan, options of reading, keys
    "maurice_datasets.simulation_plan",  # and opens none
    "maurice_datasets.grouped",
    "maurice_datasets.paired",
    "maurice_datasets.run_plan",
    "maurice_loaders.write_reading",
    "maurice_viz.drive",
}


def takes_text(parameter: inspect.Parameter) -> bool:
    return any(kind in str(parameter.annotation) for kind in ("str", "Path"))


CASES = [
    pytest.param(function, parameter, id=f"{package.__name__}.{name}-{parameter.name}")
    for package in PACKAGES
    for name in package.__all__
    if inspect.isfunction(function := getattr(package, name))
    and not {f"{package.__name__}.{name}"} & (NOT_HERE | NOT_MADE)
    for parameter in inspect.signature(function).parameters.values()
    if takes_text(parameter)
    and parameter.name != "map_unit"
    and parameter.kind is not inspect.Parameter.VAR_KEYWORD
]


@pytest.fixture(scope="module")
def valid(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Return arguments by their names: a drive, its survey, and new places to write to."""
    folder = tmp_path_factory.mktemp("valid")
    survey, session = write_small_survey(folder), write_small_session(folder)
    sources = dict.fromkeys(("session", "source", "recording", "path"), session)
    return sources | {"survey": survey, "library": survey, "folder": folder, "plan": "tracking"}


def argument(parameter: inspect.Parameter, bad: str) -> Any:
    """Return the bad text in the type that the parameter takes."""
    kind = str(parameter.annotation)
    if kind.startswith("Mapping"):
        return {bad: 1.0}
    if kind.startswith("Sequence"):
        return [bad]
    return bad if "str" in kind else Path(bad)


@pytest.mark.parametrize("bad", BAD)
@pytest.mark.parametrize(("function", "parameter"), CASES)
def test_what_no_system_takes_is_bad_input(function, parameter, bad, valid, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    value = argument(parameter, BAD[bad])
    positional, named = [], {}
    for other in inspect.signature(function).parameters.values():
        if other.kind is inspect.Parameter.VAR_POSITIONAL:
            positional = [*named.values(), value if other.name == parameter.name else valid["session"]]
            named = {}
        elif other.name == parameter.name:
            named[other.name] = value
        elif other.default is other.empty and other.kind is not inspect.Parameter.VAR_KEYWORD:
            named[other.name] = valid.get(other.name, tmp_path / "new")
    if function is maurice_mcl.make_localizer:
        named["library"] = maurice_mcl.tiny_library()
    with pytest.raises(InputError) as caught:
        function(*positional, **named)
    text = str(caught.value)
    assert len(text.splitlines()) == 1
    assert not re.search(r"--[a-z]", re.sub("maurice-replay [^;]*", "", text)), (
        "an option of the command line"
    )


@pytest.mark.parametrize("function", [maurice_loaders.build_library, maurice_loaders.open_library])
def test_a_channel_that_is_not_known_is_bad_input(function, valid):
    with pytest.raises(InputError, match="found channel 'smell', expected one of color"):
        function(valid["survey"], channels=["smell"])


def test_an_error_names_what_the_caller_has_options_or_parameters(small_session, tmp_path):
    alone = tmp_path / "alone.log"
    header, *lines = small_session.read_text(encoding="utf-8").splitlines()
    kept = {key: value for key, value in json.loads(header).items() if key not in ("survey", "start")}
    alone.write_text("\n".join([json.dumps(kept), *lines]), encoding="utf-8")
    for more, option, parameter in (
        ({}, "name one with --library.", "name one with library=."),
        ({"library": tmp_path / "survey.log", "start": "tracking"}, "give --start truth", "give start=truth"),
    ):
        asked = maurice_viz.Filter(start=more.get("start"))
        with pytest.raises(InputError, match=re.escape(parameter)):
            maurice_viz.replay(alone, more.get("library"), asked)
        words = [word for name, value in more.items() for word in (f"--{name}", value)]
        assert option in " ".join(failure("replay", alone, *words, "-o", "none").split())


def test_no_message_or_help_sends_people_to_pages_that_are_not_installed():
    for package in PACKAGES:
        for file in Path(str(package.__file__)).parent.rglob("*.py"):
            source = file.read_text(encoding="utf-8")
            nodes = list(ast.walk(ast.parse(source))) if "docs/" in source else []
            docstrings = {id(node.value) for node in nodes if isinstance(node, ast.Expr)}
            texts = [node for node in nodes if isinstance(node, ast.Constant) and isinstance(node.value, str)]
            assert not [node.value for node in texts if "docs/" in node.value and id(node) not in docstrings]


@pytest.mark.parametrize(
    ("option", "setting"),
    [
        (("particles", 100), "particles=300"),
        (("feature", "color"), "sensor.weights={edges=1}"),
        (("feature", "color"), "sensor.weights.edges=1"),
    ],
)
def test_what_an_option_and_a_setting_both_give_is_refused(small_session, tmp_path, option, setting):
    name, value = option
    key, _, text = setting.partition("=")
    drive = "replay", small_session, "-o", "none"
    err = " ".join(run(*drive, f"--{name}", value, "--set", setting, expect=2).stderr.split())
    assert f"{key} is given twice, by --{name} and by --set; give it once" in err
    with pytest.raises(InputError, match=f"{key} is given twice, by {name}= and by settings="):
        maurice_viz.replay(small_session, filter=maurice_viz.Filter(settings={key: text}, **{name: value}))
    run("replay", small_session, "-o", "none", "--save-run", tmp_path / "kept")
    err = run(
        "what-if", tmp_path / "kept", "--from", 3, f"--{name}", value, "--set", setting, expect=2
    ).stderr
    assert "is given twice" in " ".join(err.split())
    assert "--set gives particles twice" in " ".join(
        run(*drive, "--set", "particles=1", "--set", "particles=1", expect=2).stderr.split()
    )
