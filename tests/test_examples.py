"""Everything that the front pages export has a docstring, and an example in it that runs."""

from __future__ import annotations

import doctest
import importlib
import inspect
import os
import shutil
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import maurice_viz as mv
from helpers.small_session import write_small_session, write_small_survey
from maurice_loaders.session_log.writer import SessionWriter
from maurice_mcl.values.session import SessionInfo

FRONT_PAGES = ("maurice_mcl", "maurice_loaders", "maurice_datasets", "maurice_viz")
RAISE_NOTHING = ("score", "table", "tiny_library", "tiny_session", "with_landmarks", "with_keypoints")
EXAMPLES = [
    (page, name)
    for page in FRONT_PAGES
    for name in importlib.import_module(page).__all__
    if getattr(getattr(importlib.import_module(page), name), "__module__", page).startswith(page)
]  # a name that another page has, too, is tried there


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a session of 14 pictures, its survey, and a saved run of it, "my-run"."""
    folder = tmp_path_factory.mktemp("saved")
    write_small_survey(folder)
    mv.replay(write_small_session(folder), filter=mv.Filter(particles=50), save_run=folder / "my-run")
    return folder


@pytest.fixture(autouse=True)
def _files(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Change to a folder with the files that examples of a front page read."""
    monkeypatch.chdir(tmp_path)
    if "maurice_viz-" in request.node.name:
        files = request.getfixturevalue("saved")  # which no example changes
        shutil.copytree(files, tmp_path, copy_function=os.link, dirs_exist_ok=True)
        return
    (tmp_path / "session").mkdir()
    image = np.full((4, 6, 3), 100, np.uint8)
    with SessionWriter(tmp_path / "session.log", SessionInfo(name="session")) as log:
        log.image(0.0, image)
        log.odometry(0.1, (0.05, 0.0, 0.0))
        log.image(0.2, image)
    with SessionWriter(tmp_path / "survey.log", SessionInfo(name="survey"), "survey") as log:
        log.image(0.0, image, pose=(0.0, 0.0, 0.0))
        log.image(0.2, image, pose=(1.0, 0.0, 0.0))


def _export(page: str, name: str) -> object:
    module: ModuleType = importlib.import_module(page)
    assert name in dir(module)
    return getattr(module, name)


@pytest.mark.parametrize(("page", "name"), EXAMPLES)
def test_every_export_has_a_docstring_whose_example_runs(page, name):
    export = _export(page, name)
    if not isinstance(export, type) and not callable(export):
        return  # a table: its names are its documentation
    found = doctest.DocTestFinder(recurse=False).find(export, f"{page}.{name}", module=False)
    assert found, f"{page}.{name} has no docstring"
    assert found[0].examples, f"{page}.{name} has no example"
    if inspect.isfunction(export) and name not in RAISE_NOTHING:
        assert "Error" in (export.__doc__ or ""), f"{page}.{name} does not document what it raises"
    for test in found:
        problems: list[str] = []
        doctest.DocTestRunner(optionflags=doctest.ELLIPSIS).run(test, out=problems.append)
        assert not problems, "".join(problems)


@pytest.mark.parametrize("page", FRONT_PAGES)
def test_unknown_names_are_refused(page):
    with pytest.raises(AttributeError, match="no_such_name"):
        _ = importlib.import_module(page).no_such_name
