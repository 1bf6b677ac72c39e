from __future__ import annotations

from dataclasses import replace

from helpers import expect_facts
from maurice_mcl.filter.recovery import DRAWS_NEVER, DRAWS_WHERE_LIKELY
from maurice_mcl.reasons.causes import CARRIED, DATA, UNKNOWN, Failure, Incident
from maurice_mcl.reasons.tour import tour_of
from maurice_mcl.reasons.verdict import RunVerdict
from maurice_mcl.scoring.episodes import Episode
from maurice_mcl.scoring.table import PROBABLY_LOST
from maurice_viz.scene import RunView
from maurice_viz.style import UNITS, Scale
from maurice_viz.text.tour import tour_pages, words

INCHES = Scale(UNITS["in"])
CARRY = Incident(CARRIED, 51, 51, None, 1.7)
EPISODE = Episode("kidnapped", 51, 53, 51, localized=54, steps=3, fresh=200)


LESSONS = {step: f"Lesson {step}." for step in (1, 30, 51, 52, 54, 60, 100)}


def test_each_page_says_where_it_is_where_to_look_and_what_comes_next():
    run = RunVerdict(
        updates=100, has_truth=True, localized=1, first=1, last=100, incidents=(CARRY,), episodes=(EPISODE,)
    )
    verdicts = {"robust": run}
    tour = tour_of(verdicts)
    pages = dict(tour_pages(tour, verdicts, INCHES, LESSONS))
    assert list(pages) == list(LESSONS)
    expect_facts(pages[51], "2 of 4", "step 51", "kidnapped", "white disk", "**Lesson 51.**")
    assert pages[51].endswith("Next: **step 54**, localized again.")
    assert "200 were drawn anew" in pages[54]
    assert "Next" not in pages[100]
    crowd = words([RunView(label, ("color",)) for label in "abcd"])  # little room for it
    crowded = dict(tour_pages(tour, verdicts, INCHES, LESSONS, crowd, letters=210))
    assert all(page.endswith(crowd) and len(page) <= 212 for page in crowded.values())
    assert "white disk jumps" not in crowded[51]
    tight = dict(tour_pages(tour, verdicts, INCHES, LESSONS, crowd, letters=100))
    assert not any(crowd in page for page in tight.values())


def test_between_moments_a_page_names_its_own_step_and_the_moment_before():
    run = RunVerdict(updates=100, has_truth=True, localized=1, first=1, last=100, incidents=(CARRY,))
    tour = tour_of({"robust": run})
    pages = dict(tour_pages(tour, {"robust": run}, INCHES, LESSONS))
    assert pages[52] == "**Step 52**, after step 51 (kidnapped). **Lesson 52.** Next: **step 100**, the end."
    for step, page in pages.items():
        assert f"tep {step}" in page.split(".")[0]
        assert f"**Lesson {step}.**" in page
    before = dict(tour_pages((), {}, INCHES, LESSONS))  # the replay runs
    assert before[60] == "**Step 60.** **Lesson 60.**"


def test_the_command_names_what_is_opened_and_without_a_file_there_is_none():
    run = RunVerdict(updates=100, first=1, last=100)
    explained = words([RunView("robust", ("color",))])
    pages = dict(tour_pages((), {"a": run}, INCHES, LESSONS, explained, "my drive.rrd"))
    assert pages[30].endswith("`maurice-replay open 'my drive.rrd' --step 30 --phase weight`")
    without = dict(tour_pages((), {"a": run}, INCHES, LESSONS, explained))
    assert not any("maurice-replay" in page or "Phase by phase" in page for page in without.values())


def test_without_truth_no_page_speaks_of_it():
    verdicts = {"a": RunVerdict(updates=9, first=1, last=9)}
    pages = list(tour_pages(tour_of(verdicts), verdicts, INCHES, dict.fromkeys(range(1, 10), "")))
    assert len(pages) == 9
    assert not any("truth" in page or "white" in page.casefold() for _, page in pages)


def test_a_moment_whose_cause_is_not_known_is_that_it_goes_wrong():
    failure = Failure(UNKNOWN, 5, Episode(PROBABLY_LOST, 6, 9, noticed=6), truth_known=False)
    verdicts = {"a": RunVerdict(updates=9, first=1, last=9, failures=(failure,))}
    page = dict(tour_pages(tour_of(verdicts), verdicts, INCHES, dict.fromkeys(range(1, 10), "")))[5]
    assert "step 5: it goes wrong" in page
    assert "goes wrong: " not in page
    known = {
        "a": replace(verdicts["a"], failures=(replace(failure, kind=DATA, evidence={"equal_pictures": 4}),))
    }
    page = dict(tour_pages(tour_of(known), known, INCHES, dict.fromkeys(range(1, 10), "")))[5]
    assert "step 5: it goes wrong: gap in the recording" in page


def test_runs_that_differ_in_it_are_told_apart_by_where_they_draw_new_particles():
    thesis, robust = RunView("thesis", ("color",)), RunView("robust", ("color",))
    assert "`thesis`" not in words([thesis, robust])  # not known, of saved runs
    runs = [replace(thesis, draws_new=DRAWS_NEVER), replace(robust, draws_new=DRAWS_WHERE_LIKELY)]
    assert words(runs).startswith("`thesis` never draws new dots; `robust` draws new dots where")
    assert words(runs[:1]).startswith("A **dot** is one guess")
    assert not {"white", "truth", "localized"} & set(words(runs[:1], has_truth=False).split())
    assert "reseeded" in words(runs[:1])  # the lane of what was noticed stands on a single run's screen
    assert "reseeded" not in words(runs)
