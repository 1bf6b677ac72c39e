from __future__ import annotations

from dataclasses import replace

from maurice_mcl.reasons.causes import CARRIED, PROPOSAL, Failure, Incident
from maurice_mcl.reasons.tour import tour_of
from maurice_mcl.reasons.verdict import Ambiguity, RunVerdict, SureAndWrong
from maurice_mcl.scoring.episodes import Episode

CARRY = Incident(CARRIED, 51, 51, None, 1.7)
RUN = RunVerdict(updates=100, has_truth=True, localized=1, first=1, last=100)
STAYS = Episode("kidnapped", 51, 100, 51, 53, 54, steps=50, sure=40, bereft=50)
LOST = replace(RUN, incidents=(CARRY,), episodes=(STAYS,), sure_and_wrong=SureAndWrong(85, 3.1, 1.0))
FOUND = Episode("kidnapped", 51, 53, 51, localized=54, steps=3, fresh=200)
BACK = replace(RUN, incidents=(CARRY,), episodes=(FOUND,))


def told(tour):
    return [(moment.step, moment.kind) for moment in tour]


def test_a_kidnapping_with_two_runs_has_five_moments_in_order():
    tour = tour_of({"thesis": LOST, "robust": BACK})
    assert [(one.step, one.kind, one.label) for one in tour] == [
        (1, "begins", ""),
        (51, "befell", ""),
        (54, "back", "robust"),
        (85, "sure", "thesis"),
        (100, "ends", ""),
    ]


def test_a_search_shows_where_the_cloud_was_divided_and_when_it_was_localized():
    divided = Ambiguity(3, 2, 4, (0.5, 0.4), 1.6, 2)
    run = replace(RUN, updates=40, localized=9, last=40, most_at=1, ambiguity=divided)
    assert told(tour_of({"a": run})) == [(1, "begins"), (3, "divided"), (9, "found"), (40, "ends")]


def test_before_the_first_update_there_is_no_tour():
    assert tour_of({"a": RunVerdict()}) == ()


def test_there_are_never_more_than_five_moments():
    losses = [Episode("lost", k, k + 4, k, lost=k + 3, localized=k + 5, steps=5) for k in range(10, 90, 10)]
    tour = tour_of({"a": replace(RUN, updates=90, last=90, episodes=tuple(losses))})
    assert len(tour) == 5
    assert [one.step for one in tour] == sorted({one.step for one in tour})


def test_many_things_that_befell_the_robot_leave_room_for_what_came_of_them():
    carried = tuple(Incident(CARRIED, k, k, None, 1.7) for k in range(11, 61, 10))
    kinds = [kind for _, kind in told(tour_of({"a": replace(LOST, incidents=carried)}))]
    assert kinds.count("befell") == 2
    assert "sure" in kinds


def test_a_failure_is_shown_where_its_cause_shows_first():
    episode = Episode("searching", 1, 40, lost=4, steps=40, sure=22, bereft=20)
    lost = replace(
        RUN,
        updates=40,
        last=40,
        localized=None,
        episodes=(episode,),
        failures=(Failure(PROPOSAL, 10, episode),),
    )
    tour = tour_of({"a": replace(lost, sure_and_wrong=SureAndWrong(26, 1.2, 1.0))})
    assert told(tour) == [(1, "begins"), (10, "caused"), (26, "sure"), (40, "ends")]
