"""Episodes: one account of being wrong, that agrees with the scores whatever happens."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from helpers import expect_facts
from maurice_mcl.scoring.episodes import KIDNAPPED, LOST, SEARCHING, Episode, EpisodeFinder
from maurice_mcl.scoring.metrics import StepScore, first_mostly, first_run_of

SCORES = {
    "R": StepScore(0.1, 0.0, True, True, False),  # localized
    "U": StepScore(0.1, 0.0, False, True, False),  # right, not converged
    "B": StepScore(0.7, 0.0, True, False, False),  # between right and lost, sure
    "O": StepScore(2.0, 0.0, True, False, True),  # too far off, sure
    "S": StepScore(2.0, 0.0, False, False, True),  # too far off, unsure
    "N": StepScore(None, None, True, None, None),  # truth not known
}


def found(letters: str, doubts: range = range(0), fresh: range = range(0)) -> EpisodeFinder:
    """Follow a run of a score a step, from step 1; a small letter is a step at which it is kidnapped."""
    finder = EpisodeFinder()
    for step, letter in enumerate(letters, 1):
        score, carried = SCORES[letter.upper()], letter.islower()
        finder.see(step, score, kidnapped=carried, doubted=step in doubts, fresh=100 * (step in fresh))
    return finder


def test_a_kidnapping_has_one_set_of_step_numbers():
    finder = found("RRRRRo" + "O" * 8, doubts=range(8, 99))
    (one,) = finder.episodes
    assert (one.kind, one.first, one.wrong, one.noticed, one.lost, one.last) == (KIDNAPPED, 6, 6, 8, 9, 14)
    expect_facts(one.account, "wrong from step 6", "noticed", "step 8", "lost at step 9")
    assert (one.ending, one.is_failure, finder.localized) == ("not localized again", True, 1)
    assert finder.doubts == ((8, 14),)
    (back,) = found("RRRRRoO" + "R" * 6, fresh=range(6, 9)).episodes
    assert (back.wrong, back.lost, back.localized, back.last, back.is_failure) == (6, None, 8, 7, False)
    assert back.fresh == 200, "those of step 8 were drawn after it was right"


def test_a_loss_begins_at_the_first_of_the_four_and_a_doubt_can_be_older():
    (one,) = found("RRRRRROOOORRRRR", doubts=range(5, 9)).episodes
    assert (one.kind, one.first, one.noticed, one.lost, one.localized) == (LOST, 7, 5, 10, 11)
    expect_facts(one.account, "wrong from step 7", "doubted", "step 5", "lost")


@pytest.mark.parametrize(
    ("letters", "failures"),
    [
        ("SSSSSSRRRRRR", []),  # a search that ends well
        ("SSSSSSSS", [(SEARCHING, 1)]),
        ("O" * 12 + "R" * 6, [(SEARCHING, 1)]),  # sure of a wrong place for long
        ("UUUUUUUU", [(SEARCHING, 1)]),
        ("RRRRRROOORRRRR", []),  # three are not four
        ("RRRRRrRRRRR", []),  # carried, and right at once
        ("RRRROOOOoOOORRRRR", [(LOST, 5), (KIDNAPPED, 9)]),
        ("SSSSsSSSSSS", [(SEARCHING, 1)]),  # carried before it was anywhere: still the same search
        ("NNNNNNNN", []),
    ],
)
def test_what_counts_as_a_failure(letters, failures):
    assert [(one.kind, one.onset) for one in found(letters).episodes if one.is_failure] == failures


@settings(max_examples=100)
@given(st.lists(st.sampled_from("RRRRRUBOOOOSNro"), min_size=1, max_size=40).map("".join))
def test_episodes_agree_with_the_scores_whatever_happens(letters):
    finder = found(letters)
    scores = [SCORES[letter.upper()] for letter in letters]
    lost = first_run_of([one.lost is True for one in scores], 4)
    assert next((one.lost for one in finder.episodes if one.lost is not None), None) == lost
    localized = np.array([one.localized is True for one in scores])
    assert finder.localized == first_mostly(localized)
    for before, after in zip(finder.episodes, finder.episodes[1:], strict=False):
        assert before.last < after.first or (before.steps == 0 and before.last <= after.first)
    for one in finder.episodes:
        _check(one, scores)
    assert finder.is_lost <= (bool(finder.episodes) and finder.episodes[-1].lost is not None)


def _check(one: Episode, scores: list[StepScore]) -> None:
    """Check what the numbers of an episode mean, against the scores of its steps."""
    named = [at for at in (one.wrong, one.lost) if at is not None]
    assert all(one.first <= at <= one.last for at in named)
    assert one.first <= one.last <= len(scores)
    if one.wrong is not None:
        assert scores[one.wrong - 1].lost
        assert one.kind != SEARCHING
    if one.lost is not None:
        assert all(scores[at - 1].lost for at in range(one.lost - 3, one.lost + 1))
    if one.localized is not None:
        assert one.localized <= one.last + 1
        five = scores[one.localized - 1 : one.localized + 4]
        assert five[0].localized
        assert sum(score.localized is True for score in five) >= 4
        assert one.steps == one.localized - one.first
    else:
        assert one.steps == one.last - one.first + 1
    span = scores[one.first - 1 : one.first - 1 + one.steps]
    assert one.sure == sum(score.wrong_and_confident is True for score in span)
