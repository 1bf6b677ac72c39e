"""Everything that the front pages export has a docstring, and an example in it that runs."""

import doctest
import importlib
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from maurice_loaders.session_log.writer import SessionWriter
from maurice_mcl.session import SessionInfo

FRONT_PAGES = ("maurice_mcl", "maurice_loaders")  # and what each exports in `__all__`
EXAMPLES = [(page, name) for page in FRONT_PAGES for name in importlib.import_module(page).__all__]


@pytest.fixture(autouse=True)
def _files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Change to a folder with the files that examples read: a session and a survey of two pictures."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MAURICE_CACHE", str(tmp_path / "cache"))
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
def test_every_export_has_a_docstring_whose_example_runs(page: str, name: str) -> None:
    export = _export(page, name)
    if not isinstance(export, type) and not callable(export):
        return  # a table: its names are its documentation
    found = doctest.DocTestFinder(recurse=False).find(export, f"{page}.{name}", module=False)
    assert found, f"{page}.{name} has no docstring"
    assert found[0].examples, f"{page}.{name} has no example"
    for test in found:
        problems: list[str] = []
        doctest.DocTestRunner(optionflags=doctest.ELLIPSIS).run(test, out=problems.append)
        assert not problems, "".join(problems)


@pytest.mark.parametrize("page", FRONT_PAGES)
def test_unknown_names_are_refused(page: str) -> None:
    with pytest.raises(AttributeError, match="no_such_name"):
        _ = importlib.import_module(page).no_such_name
