"""The words that stand on screens are explained on one page."""

from __future__ import annotations

import re

import pytest

from helpers.pages import ROOT
from maurice_mcl.reasons.causes import CAUSES
from maurice_mcl.scoring.events import KINDS


@pytest.fixture(scope="module")
def words() -> str:
    page = (ROOT / "docs" / "layouts.md").read_text(encoding="utf-8")
    return page.split("## Words on the screens")[1].split("\n## ")[0]


def test_every_cause_has_its_meaning(words):
    assert dict(re.findall(r"^\| ([^|]+?) \| ([^|]+?) \|$", words, re.MULTILINE)).items() >= {
        (cause.title, cause.meaning) for cause in CAUSES.values()
    }


def test_every_short_word_of_the_lanes_is_explained(words):
    assert [kind.word for kind in KINDS.values() if kind.word and kind.word not in words] == []


def test_the_first_pages_lead_to_them():
    for page in ("README.md", "docs/index.md"):
        assert "layouts.md#words-on-the-screens" in (ROOT / page).read_text(encoding="utf-8")


def test_the_site_begins_with_the_picture_and_the_commands():
    """It has a search as well, whose index is made with the site."""
    start = (ROOT / "docs" / "index.md").read_text(encoding="utf-8")
    assert start.index("pictures/story.png") < start.index("```sh\nmake demo") < start.index("| I want to")
    assert "\n  - search\n" in (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
