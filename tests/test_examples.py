"""Everything that the front pages export has a docstring, and an example in it that runs."""

import doctest
import importlib
from types import ModuleType

import pytest

FRONT_PAGES = ("maurice_mcl",)  # and what each exports in `__all__`
EXAMPLES = [(page, name) for page in FRONT_PAGES for name in importlib.import_module(page).__all__]


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
