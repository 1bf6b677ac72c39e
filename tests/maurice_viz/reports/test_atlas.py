"""The failure atlas as a page: drawn from trials of a small session, and used in a browser."""

from __future__ import annotations

from pathlib import Path

import pytest

from helpers.browser import browser, needs_browser
from helpers.commands import run
from helpers.small_session import write_small_session, write_small_survey


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("atlas")
    write_small_survey(folder)
    write_small_session(folder)
    plan = 'title = "Mine"\nseeds = 2\n[[sessions]]\npath = "session.log"\n[settings]\nparticles = 50\n'
    (folder / "mine.toml").write_text(plan)
    run("trials", folder / "mine.toml", "-o", folder / "trials", "--workers", "1")
    run("atlas", folder / "trials", "-o", folder / "atlas.html", "--spot", "30cm")
    return folder / "atlas.html"


def test_it_stands_alone(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert "Where runs go wrong: Mine" in text
    assert "http" not in text.replace("http-equiv", "")
    assert 'class="wall"' in text
    assert "2 runs of" in text


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


def test_trials_without_truth_are_refused(tmp_path: Path) -> None:
    write_small_survey(tmp_path)
    write_small_session(tmp_path, truth=False)
    (tmp_path / "mine.toml").write_text(
        'seeds = 1\n[[sessions]]\npath = "session.log"\n[settings]\nparticles = 50\n'
    )
    run("trials", tmp_path / "mine.toml", "-o", tmp_path / "trials", "--workers", "1")
    done = run("atlas", tmp_path / "trials", "-o", tmp_path / "atlas.html", expect=1)
    assert "found no true positions" in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
