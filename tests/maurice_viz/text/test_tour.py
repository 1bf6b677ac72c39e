from __future__ import annotations

from dataclasses import replace

from helpers import expect_facts
from maurice_mcl.reasons.causes import CARRIED, Incident
from maurice_mcl.reasons.tour import tour_of
from maurice_mcl.reasons.verdict import RunVerdict
from maurice_mcl.scoring.episodes import Episode
from maurice_viz.scene import DRAWS_NEVER, DRAWS_WHERE_LIKELY, RunView
from maurice_viz.style import UNITS, Scale
from maurice_viz.text.tour import tour_pages, words

INCHES = Scale(UNITS["in"])
CARRY = Incident(CARRIED, 51, 51, None, 1.7)
EPISODE = Episode("kidnapped", 51, 53, 51, localized=54, steps=3, fresh=200)


def test_each_page_says_where_it_is_where_to_look_and_what_comes_next():
    run = RunVerdict(
        updates=100, has_truth=True, localized=1, first=1, last=100, incidents=(CARRY,), episodes=(EPISODE,)
    )
    verdicts = {"robust": run}
    pages = tour_pages(tour_of(verdicts), verdicts, INCHES)
    assert [step for step, _ in pages] == [1, 51, 54, 100]
    _, page = pages[1]
    expect_facts(page, "2 of 4", "step 51", "kidnapped", "white disk")
    assert page.endswith("Next: **step 54**, localized again.")
    assert "200 were drawn anew" in pages[2][1]
    assert "Next" not in pages[-1][1]
    (_, first), *_ = tour_pages(tour_of(verdicts), verdicts, INCHES, words([RunView("robust", ("color",))]))
    assert first.endswith("`maurice-replay open FILE --step 1 --phase weight`")
    crowd = words([RunView(label, ("color",)) for label in "abcd"])  # no room for it
    assert all(page.endswith(crowd) for _, page in tour_pages(tour_of(verdicts), verdicts, INCHES, crowd))


def test_without_truth_no_page_speaks_of_it():
    verdicts = {"a": RunVerdict(updates=9, first=1, last=9)}
    pages = tour_pages(tour_of(verdicts), verdicts, INCHES)
    assert pages
    assert not any("truth" in page or "white" in page.casefold() for _, page in pages)


def test_runs_that_differ_in_it_are_told_apart_by_where_they_draw_new_particles():
    thesis, robust = RunView("thesis", ("color",)), RunView("robust", ("color",))
    assert "`thesis`" not in words([thesis, robust])  # not known, of saved runs
    runs = [replace(thesis, draws_new=DRAWS_NEVER), replace(robust, draws_new=DRAWS_WHERE_LIKELY)]
    assert words(runs).startswith("`thesis` never draws new dots; `robust` draws new dots where")
    assert words(runs[:1]).startswith("A **dot** is one guess")
    assert not {"white", "truth", "localized"} & set(words(runs[:1], has_truth=False).split())
    assert "reseeded" in words(runs[:1])  # the lane of what was noticed stands on a single run's screen
    assert "reseeded" not in words(runs)
