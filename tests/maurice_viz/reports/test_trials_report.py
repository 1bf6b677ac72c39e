"""The page about trials: what variants reached, and its atlas, used in a browser."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from helpers.browser import browser, needs_browser
from helpers.commands import run
from helpers.small_session import write_small_session, write_small_survey


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("page")
    write_small_survey(folder)
    write_small_session(folder)
    plan = 'title = "Mine"\nseeds = 2\n[[sessions]]\npath = "session.log"\n[settings]\nparticles = 50\n'
    (folder / "mine.toml").write_text(plan)
    run("trials", "run", folder / "mine.toml", "-o", folder / "trials", "--workers", "1")
    run("trials", "report", folder / "trials", "-o", folder / "trials.html")
    return folder / "trials.html"


def test_it_stands_alone(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert "<h1>Mine</h1>" in text
    assert "Where runs go wrong" in text
    assert "http" not in text.replace("http-equiv", "")
    assert 'class="wall"' in text
    assert "2 runs. A square" in text  # the variant has no name


@needs_browser
def test_a_spot_shows_its_worst_runs(page: Path, tmp_path: Path) -> None:
    with browser(tmp_path) as tab:
        tab.open(page.as_uri())
        assert tab.value("document.querySelectorAll('.spot').length") > 3
        tab.value("document.querySelector('.spot').dispatchEvent(new MouseEvent('click'))")
        shown = tab.value("document.getElementById('chosen').innerText")
        assert "Spot at (" in shown
        assert f"maurice-replay {page.parent / 'session.log'} --set particles=50 --seed " in shown
        tab.value("document.querySelector('input[value=rank]').click()")
        assert tab.value("document.querySelector('.spot').getAttribute('fill')").startswith("#")


SMALLEST = """Math.min(...[...document.querySelectorAll("svg text")].map(
  (text) => parseFloat(getComputedStyle(text).fontSize) * text.ownerSVGElement.getScreenCTM().a))"""
SCROLLED = """[...document.querySelectorAll(".wide")].filter((box) => box.scrollWidth > box.clientWidth)"""


@needs_browser
def test_the_page_has_no_errors_and_fits_a_phone(page: Path, tmp_path: Path) -> None:
    with browser(tmp_path) as shown:
        for domain in ("Runtime", "Log"):
            shown.call(f"{domain}.enable")
        for width in (400, 1600):
            shown.open(page.as_uri(), width=width, height=800)
            events = list(shown.events_until(time.monotonic() + 1))
            assert not [one for one in events if one["method"].startswith(("Runtime.exception", "Log.entry"))]
            assert shown.value("document.documentElement.scrollWidth") <= width
            shown.value("document.querySelector('.spot').dispatchEvent(new MouseEvent('click'))")
            assert shown.value(SMALLEST) >= 11
            assert shown.value(SCROLLED) == []


def test_trials_without_truth_have_no_atlas(tmp_path: Path) -> None:
    write_small_survey(tmp_path)
    write_small_session(tmp_path, truth=False)
    (tmp_path / "mine.toml").write_text(
        'seeds = 1\n[[sessions]]\npath = "session.log"\n[settings]\nparticles = 50\n'
    )
    run("trials", "run", tmp_path / "mine.toml", "-o", tmp_path / "trials", "--workers", "1")
    run("trials", "report", tmp_path / "trials", "-o", tmp_path / "page.html")
    assert "Where runs go wrong" not in (tmp_path / "page.html").read_text()
