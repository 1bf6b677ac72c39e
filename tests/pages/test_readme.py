"""Commands and Python of README and docs/your-robot.md run as they stand there, in order, in a folder a page.

Those of the tutorial run where all pages do, after one another.
"""

from __future__ import annotations

import pytest

from helpers.pages import OWN, PLACEHOLDER, ROOT, Step, prepare, quick, run_quickly, run_step, steps_of
from maurice_datasets import demos, sessions
from maurice_viz.viewer import snapshot

PAGES = ("README.md", "docs/tutorial.md", "docs/your-robot.md")  # in the order of reading


@pytest.mark.parametrize(("page", "least"), [("README.md", 15), ("docs/your-robot.md", 7)])
def test_a_page(page, least, tmp_path, monkeypatch):
    """With a shorter demo, and no viewer to draw pictures; the slow test below has both."""
    for module in (demos, sessions):
        monkeypatch.setattr(module, "KIDNAPPING_UPDATES", 50)
    monkeypatch.setattr(snapshot, "software_driver", lambda: None)
    monkeypatch.chdir(tmp_path)
    prepare(tmp_path)
    steps = quick(steps_of(page))
    assert len(steps) >= least
    assert {step.page for step in steps} == {page}
    run_quickly(steps, tmp_path)


def test_the_python_of_a_page_is_one_step():
    (python,) = (step for step in steps_of("docs/your-robot.md") if step.is_python)
    assert python.section == "Your own robot's log"


@pytest.mark.slow
def test_all_pages_after_one_another_in_one_folder(tmp_path):
    """As a reader does: what one page writes is there when the next one is read."""
    prepare(tmp_path)
    for page in PAGES:
        for step in steps_of(page):
            run_step(step, tmp_path)


def test_what_is_long_is_left_out_with_what_needs_it():
    lines = (
        "maurice-replay trials run p -o out  # minutes",
        "maurice-replay trials report out -o a.html",
        "maurice-replay a.rrd",
    )
    steps = [Step("page", "section", line) for line in lines]
    assert quick(steps) == [steps[2]]


def test_words_in_capitals_are_the_reader_s_own_and_something_stands_for_each():
    typed = [step.text.split("#")[0] for page in PAGES for step in steps_of(page) if not step.is_python]
    assert {word for line in typed for word in PLACEHOLDER.findall(line)} <= set(OWN)


def test_make_has_the_targets_that_pages_name():
    targets = (ROOT / "Makefile").read_text()
    named = [line.split()[1] for line in _shell_lines() if line.startswith("make ")]
    assert named
    assert all(f"\n{target}:" in targets for target in named)


def _shell_lines() -> list[str]:
    pages = ((ROOT / page).read_text(encoding="utf-8") for page in PAGES)
    return [
        line
        for page in pages
        for block in page.split("```sh\n")[1:]
        for line in block.split("\n```")[0].split("\n")
    ]
