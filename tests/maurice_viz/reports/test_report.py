"""`maurice-replay report`: one page that stands alone, in a parser and in a real browser."""

from __future__ import annotations

import base64
import re
from collections.abc import Iterator
from contextlib import chdir
from html.parser import HTMLParser
from pathlib import Path

import cv2
import numpy as np
import pytest

from helpers.browser import Page, browser, needs_browser
from helpers.commands import maurice, one_line
from helpers.small_session import write_small_session, write_small_survey
from maurice_loaders.session_log.writer import SessionWriter
from maurice_mcl.values.arrays import F64, U8
from maurice_mcl.values.map import Arena, Region
from maurice_mcl.values.session import SessionInfo
from maurice_viz.style import STATES

SECTIONS = ("map", "summary", "traces", "events", "pictures", "configuration", "facts")
VOID = {"meta", "link", "img", "br", "hr", "input"}
EVIL = "走行 <script>alert('x')</script> & \"Ärger\""


class Outline(HTMLParser):
    """Checks that elements are closed as they were opened, and keeps what tests ask for."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.ids: list[str] = []
        self.counts: dict[str, int] = {}
        self.attributes: list[tuple[str, str, str]] = []
        self.headings: list[str] = []
        self.text: list[str] = []
        self.feed(page)
        assert not self.open

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.counts[tag] = self.counts.get(tag, 0) + 1
        self.attributes += [(tag, name, value or "") for name, value in attrs]
        self.ids += [value or "" for name, value in attrs if name == "id"]
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text.append(data)
        if self.open and self.open[-1] in ("h1", "h2"):
            self.headings.append(data)

    def values(self, tag: str, name: str) -> list[str]:
        return [value for found, key, value in self.attributes if (found, key) == (tag, name)]


def reported(session: Path, *words: str) -> str:
    """Save a run of a session, and give the page about it."""
    maurice(session, "--particles", "150", "--save-run", "kept", "-o", "none", *words)
    assert maurice("report", "kept", "-o", "r.html") == ("r.html\n", "")
    return Path("r.html").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def single(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page about a run, "kept", beside it."""
    folder = tmp_path_factory.mktemp("single")
    write_small_survey(folder)
    with chdir(folder):
        reported(write_small_session(folder))
    return folder / "r.html"


@pytest.fixture(scope="module")
def both(single: Path) -> Path:
    """The page about a comparison."""
    with chdir(single.parent):
        maurice("compare", "session.log", "--particles", "150", "--save-run", "both", "-o", "none")
        maurice("report", "both", "-o", "both.html")
    return single.with_name("both.html")


@pytest.fixture(scope="module")
def window(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    with browser(tmp_path_factory.mktemp("profile")) as page:
        yield page


def check(page: str) -> Outline:
    """Check what holds for every report."""
    found = Outline(page)
    assert set(SECTIONS) <= set(found.ids)
    assert len(set(found.ids)) == len(found.ids)
    assert len(found.headings) == 1 + len(SECTIONS)
    assert all(found.headings)
    assert found.counts["script"] == 2  # the numbers, and what shows them
    assert not found.values("script", "src")
    outside = [v for v in found.values("img", "src") + found.values("link", "href") if v[:5] != "data:"]
    assert not outside
    assert "http" not in page.replace("http-equiv", "")
    links = [value[1:] for value in found.values("a", "href")]
    assert set(links) <= set(found.ids)
    assert all(found.values("img", "alt"))
    assert len(found.values("img", "alt")) == found.counts.get("img", 0)
    assert found.counts["caption"] == found.counts["table"]
    assert not re.search(r"\b(nan|inf|None)\b", " ".join(found.text))
    assert not re.search(r'="[^"]*\bnan\b', page)
    return found


def test_every_section_is_there_and_filled(single):
    found = check(single.read_text(encoding="utf-8"))
    assert found.headings[0] == "kleine Fahrt"
    labels = [value for value in found.values("svg", "aria-label") if value]
    assert [label.split(" in ")[0] for label in labels[2:]] == [  # after the map and the lanes
        "Position error", "Heading error", "Spread", "Confidence", "Knows where it is",
        "Effective sample size", "Evidence",
    ]  # fmt: skip
    text = " ".join(found.text)
    for expected in ("position error, mean (m)", "wood", "160 at 20 places", "40 x 30 px", "sharpness = "):
        assert expected in text
    assert found.counts["img"] >= 4


def test_the_same_run_gives_the_same_bytes(single):
    assert "exists already" in one_line(maurice("report", single.parent / "kept", "-o", single, expect=1)[1])
    Path("r.html").write_text("earlier")
    maurice("report", single.parent / "kept", "-o", "r.html", "--force")
    assert Path("r.html").read_bytes() == single.read_bytes()


def test_a_comparison_is_one_page(both):
    page = both.read_text(encoding="utf-8")
    found = check(page)
    text = " ".join(found.text)
    assert "Where the runs differ" in text
    assert "sensor.weights" in text
    assert (
        found.values("g", "class").count("run0") == found.values("g", "class").count("run1") == 9
    )  # map, lanes, charts
    assert "color: estimate" in text
    assert "estimate of color" in text  # each in its run's color, as in the traces
    assert "background:rgb(200, 132, 0)" in page
    assert "blended: estimate" in text


def test_without_truth_the_errors_are_left_out_and_said(tmp_path):
    from_survey = session_of(tmp_path, truth=False)
    page = reported(from_survey)
    found = check(page)
    assert "position error, heading error" in " ".join(found.text)
    assert "widest cloud" in " ".join(found.text)
    assert len([label for label in found.values("svg", "aria-label") if label]) == 2 + 5


def test_without_session_and_library_it_says_so(small_session, tmp_path):
    maurice(small_session, "--particles", "150", "--save-run", "kept", "-o", "none")
    small_session.unlink()
    (tmp_path / "survey.log").unlink()
    maurice("report", "kept", "-o", "r.html")
    found = check(Path("r.html").read_text(encoding="utf-8"))
    assert "the picture is not available" in found.text
    assert "not available" in found.text


def test_one_picture_one_reference_and_hostile_names(tmp_path):
    session = session_of(tmp_path, name=EVIL, updates=1, references=1)
    found = check(reported(session))
    assert found.headings[0] == EVIL
    assert "1 at 1 places" in " ".join(found.text)


def test_what_is_no_run_is_a_line(tmp_path):
    assert "expected a saved run's folder" in one_line(maurice("report", "none", expect=1)[1])
    assert "ends in .html" in maurice("report", "none", "-o", "r.pdf", expect=2)[1]
    assert not list(tmp_path.iterdir())


def session_of(
    folder: Path, name: str = "x", updates: int = 6, truth: bool = True, references: int = 16
) -> Path:
    """Write a session and a survey whose names can be anything."""
    sofa = Region(name, np.array([[0.1, 0.1], [0.6, 0.1], [0.6, 0.5]]))
    arena = Arena(
        (0.0, 0.0, 2.0, 2.0), np.zeros((0, 4)), obstacles=(sofa,), floors=(Region(name, np.eye(3, 2)),)
    )
    with SessionWriter(folder / "survey.log", SessionInfo(name, "m", arena=arena), "survey") as log:
        for k in range(references):
            log.image(float(k), view(k), pose=np.array([1.0 + k / 32, 1.0, k * np.pi / 8]))
    info = SessionInfo(name, "m", survey=folder / "survey.log", arena=arena)
    with SessionWriter(folder / "session.log", info) as log:
        for k in range(updates):
            log.odometry(2.0 * k + 1, np.array([0.01, 0.0, 0.1]))
            log.image(2.0 * k + 2, view(k))
            if truth:
                log.truth(2.0 * k + 2, pose(k))
    return folder / "session.log"


def pose(k: int) -> F64:
    return np.array([1.0 + k / 32, 1.0, 0.1 * k])


def view(k: int) -> U8:
    return np.random.default_rng(k).integers(0, 255, (24, 32, 3)).astype(np.uint8)


@needs_browser
def test_a_browser_shows_it_without_a_complaint(single, tmp_path, window):
    for domain in ("Runtime", "Log"):
        window.call(f"{domain}.enable")
    brightness = []
    for scheme in ("light", "dark"):
        window.call(
            "Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}]
        )
        window.open(single.as_uri(), 1280, 1000)
        window.picture(tmp_path / f"{scheme}.png")
        brightness.append(float(cv2.imread(str(tmp_path / f"{scheme}.png")).mean()))
    complaints = {"Runtime.consoleAPICalled", "Runtime.exceptionThrown", "Log.entryAdded"}
    assert not [event for event in window.events if event["method"] in complaints]
    assert set(SECTIONS) <= set(Outline(window.value("document.documentElement.outerHTML")).ids)
    assert brightness[0] > 180
    assert brightness[1] < 75
    assert base64.b64decode(window.call("Page.printToPDF")["data"]).startswith(b"%PDF")


@needs_browser
def test_nothing_runs_in_a_page_but_its_own_script(single, tmp_path, window):
    """If text of a recording ever came into a page as markup, a browser would not run it."""
    page, whole = tmp_path / "page.html", single.read_text()
    evil = "<script>window.evil = 1</script><svg onload='window.evil = 2'></svg>"
    page.write_text(whole.replace("<main>", f"<main>{evil}<img src='https://127.0.0.1/x.png'>"))
    assert page.read_text() != whole
    window.open(page.as_uri())
    assert window.value("window.evil === undefined")
    assert window.value("document.querySelector('.readout .when').textContent").startswith("Step")  # its own
    failed = [event["params"] for event in window.events if event["method"] == "Network.loadingFailed"]
    assert [one["blockedReason"] for one in failed] == ["csp"]


MARKED = """(() => {
  const place = (one) => one.getAttribute("transform").match(/-?[\\d.]+/g).slice(0, 3).map(Number);
  return {
    when: document.querySelector(".readout .when").textContent,
    runs: [...document.querySelectorAll("[data-run]")].map((one) => one.textContent),
    robots: [...document.querySelectorAll(".now.robot")].map(place),
    cursor: place(document.querySelector(".chart .now.cursor"))[0],
  };
})()"""
BOX = """(() => {
  const box = document.querySelector(".chart svg").getBoundingClientRect();
  return [box.left, box.top, box.width, box.height];
})()"""
SMALLEST = """Math.min(
  ...[...document.querySelectorAll("svg text")].map(
    (one) => parseFloat(getComputedStyle(one).fontSize) * one.ownerSVGElement.getScreenCTM().a),
  ...[...document.querySelectorAll("body *")].filter((one) => one.innerText).map(
    (one) => parseFloat(getComputedStyle(one).fontSize)))"""


def at_chart(page: Page, share: float) -> tuple[float, float]:
    """Scroll to the first chart; give a point in it, from its left to its right edge."""
    page.value("document.querySelector('.chart').scrollIntoView({block: 'end'})")
    left, top, width, height = page.value(BOX)
    return left + share * width, top + 0.6 * height


@needs_browser
def test_a_step_under_the_pointer_is_marked_on_the_map_and_told(single, window):
    window.open(single.as_uri())
    first = window.value(MARKED)
    window.hover(*at_chart(window, 0.1))
    early = window.value(MARKED)
    window.hover(*at_chart(window, 0.99))
    late = window.value(MARKED)
    window.press("ArrowLeft")
    before = window.value(MARKED)
    window.hover(*at_chart(window, 0.1))
    window.call("Emulation.setTouchEmulationEnabled", enabled=True)
    window.tap(*at_chart(window, 0.99))
    tapped = window.value(MARKED)
    window.call("Emulation.setTouchEmulationEnabled", enabled=False)
    assert first["when"].startswith("Step ")
    assert [one["when"].split(",")[0] for one in (early, late, before)] == ["Step 1", "Step 14", "Step 13"]
    assert early["cursor"] < before["cursor"] < late["cursor"]
    assert early["robots"] != late["robots"] != before["robots"]
    assert tapped == late
    assert "truth (" in late["when"]
    truth, estimate = late["robots"]
    assert np.hypot(truth[0] - estimate[0], truth[1] - estimate[1]) < 15  # px: it is localized
    (words,) = late["runs"]
    assert re.match(r"at \(\d\.\d\d, \d\.\d\d\) m, -?\d+ deg; .* error \d\.\d\d m; heading ", words)
    assert "confidence 100 %" in words


@needs_browser
def test_what_is_not_known_is_said_and_hostile_names_are_text(tmp_path, window):
    reported(session_of(tmp_path, name=EVIL, truth=False))
    window.open((tmp_path / "r.html").as_uri())
    window.hover(*at_chart(window, 0.99))
    found = window.value(MARKED)
    assert found["when"].startswith("Step 6, ")
    assert "truth" not in found["when"]
    assert len(found["robots"]) == 1
    assert "position error" not in found["runs"][0]


@needs_browser
@pytest.mark.parametrize("size", [(1600, 1000), (800, 1000), (400, 900)], ids=str)
def test_text_has_at_least_11_px_and_nothing_is_cut_off(both, window, size):
    window.open(both.as_uri(), *size)
    assert window.value(SMALLEST) >= 11
    assert window.value("document.documentElement.scrollWidth") <= size[0]
    if size[0] > 1200:  # side by side
        window.value("document.querySelector('#traces').scrollIntoView()")
        free = size[1]
    else:
        free = at_chart(window, 0.5)[1] - 0.6 * window.value(BOX)[3]
    assert 0 < window.value("document.querySelector('.board').getBoundingClientRect().bottom") <= free


FIRST_SCREEN = """["p.verdict", ".board > svg", "#summary"].map((name) => {
  const box = document.querySelector(name).getBoundingClientRect();
  return [box.left, box.top, box.right, box.bottom];
})"""


@needs_browser
@pytest.mark.parametrize("size", [(1280, 800), (390, 844)], ids=str)
def test_the_first_screen_has_headline_and_map(both, window, size):
    window.open(both.as_uri(), *size)
    headline, plan, summary = window.value(FIRST_SCREEN)
    assert headline[3] <= plan[1] < plan[3] <= size[1]
    assert (summary[0] >= plan[2] and summary[1] < size[1] / 2) == (size[0] > 1200)  # beside it, or below


def test_the_lanes_have_the_states_of_the_viewer(single):
    page = single.read_text(encoding="utf-8")
    states = page[page.index('<figure class="lanes">') : page.index("</figure>", page.index("lanes"))]
    colors = set(re.findall(r'fill="rgb\((.*?)\)"', page))
    assert colors
    assert colors <= {", ".join(map(str, color)) for color in STATES.values()}
    assert ">localized</text>" in states
