"""The commands and Python of the tutorial and of docs/your-robot.md run as they stand there, a folder a page.

All pages after one another are in `test_readme.py`: two files, so that two processes share the work.
"""

from __future__ import annotations

import pytest

from helpers.pages import prepare, quick, run_step, steps_of


@pytest.mark.parametrize(("page", "least"), [("docs/tutorial.md", 13), ("docs/your-robot.md", 7)])
def test_a_page(page, least, tmp_path):
    prepare(tmp_path)
    steps = quick(steps_of(page))
    assert len(steps) >= least
    assert {step.page for step in steps} == {page}
    for step in steps:
        run_step(step, tmp_path)


def test_the_python_of_a_page_is_one_step():
    python = [step for step in steps_of("docs/your-robot.md") if step.is_python]
    assert len(python) == 1
    assert python[0].section == "Your own robot's log"
