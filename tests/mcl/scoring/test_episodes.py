"""Episodes: one account of being wrong, that agrees with the scores whatever happens."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from helpers import expect_facts
from helpers.run_tables import scored_table
from maurice_mcl.scoring.episodes import Episode, Recent, doubts, episodes, standing
from maurice_mcl.scoring.metrics import StepScore, first_mostly, first_run_of
from maurice_mcl.scoring.table import (
    KIDNAPPED,
    LOST,
    OF_A_RUN,
    OF_THE_DRIVE,
    SEARCHING,
    RunTable,
    Standing,
)

SCORES = {
    "R": StepScore(0.1, 0.0, True, True, False),  # localized
    "U": StepScore(0.1, 0.0, False, True, False),  # right, not converged
    "B": StepScore(0.7, 0.0, True, False, False),  # between right and lost, sure
    "O": StepScore(2.0, 0.0, True, False, True),  # too far off, sure
    "S": StepScore(2.0, 0.0, False, False, True),  # too far off, unsure
    "N": StepScore(None, None, True, None, None),  # truth not known
}


def run(letters: str, doubted: range = range(0), fresh: range = range(0), given: int = 0) -> RunTable:
    """A run of a score a step, from step 1; a small letter is a step at which it is kidnapped."""
    steps = np.arange(1, len(letters) + 1, dtype=np.int32)
    return scored_table(
        [SCORES[letter.upper()] for letter in letters],
        kidnapped=np.array([letter.islower() for letter in letters], bool),
        given=steps == given,
        doubted=np.isin(steps, doubted),
        fresh=100 * np.isin(steps, fresh),
    )


def test_a_kidnapping_has_one_set_of_step_numbers():
    table = run("RRRRRo" + "O" * 8, doubted=range(8, 99))
    found = episodes(table)
    (one,) = found.episodes
    assert (one.kind, one.first, one.wrong, one.noticed, one.lost, one.last) == (KIDNAPPED, 6, 6, 8, 9, 14)
    expect_facts(one.account, "wrong from step 6", "noticed", "step 8", "lost at step 9")
    assert (one.ending, one.is_failure, found.localized) == ("not localized again", True, 1)
    assert doubts(table) == ((8, 14),)
    (back,) = episodes(run("RRRRRoO" + "R" * 6, fresh=range(6, 9))).episodes
    assert (back.wrong, back.lost, back.localized, back.last, back.is_failure) == (6, None, 8, 7, False)
    assert back.fresh == 200, "those of step 8 were drawn after it was right"


@pytest.mark.parametrize(("given", "told"), [(8, 8), (11, 11), (12, None), (7, None), (0, None)])
def test_a_pose_that_was_given_while_it_was_lost_put_it_right(given: int, told: int | None):
    (one,) = episodes(run("RRRRRROOOORRRRR", given=given)).episodes
    assert one.given == told
    assert ("given a pose" in one.ending) == (told is not None)


def test_a_loss_begins_at_the_first_of_the_four_and_a_doubt_can_be_older():
    (one,) = episodes(run("RRRRRROOOORRRRR", doubted=range(5, 9))).episodes
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
        ("UUUUUUUSSSSSsSSSS", [(LOST, 8), (KIDNAPPED, 13)]),  # right from the start, though never sure
        ("USSSUUSSSSSSS", [(SEARCHING, 1)]),  # right by chance, in the middle of a spread cloud
        ("NNNNNNNN", []),
    ],
)
def test_what_counts_as_a_failure(letters, failures):
    assert [(one.kind, one.onset) for one in episodes(run(letters)).episodes if one.is_failure] == failures


@settings(max_examples=100)
@given(st.lists(st.sampled_from("RRRRRUBOOOOSNro"), min_size=1, max_size=40).map("".join))
def test_episodes_agree_with_the_scores_whatever_happens(letters):
    table = run(letters)
    found = episodes(table)
    judged = {
        step: SCORES[letter.upper()] for step, letter in enumerate(letters, 1) if letter != "N"
    }  # without truth nothing begins or ends
    steps, scores = list(judged), list(judged.values())
    lost = first_run_of([score.lost is True for score in scores], 4)
    declared = next((episode.lost for episode in found.episodes if episode.lost is not None), None)
    assert declared == (None if lost is None else steps[lost - 1])
    localized = first_mostly(np.array([score.localized is True for score in scores], bool))
    assert found.localized == (None if localized is None else steps[localized - 1])
    for before, after in zip(found.episodes, found.episodes[1:], strict=False):
        assert before.last < after.first or (before.steps == 0 and before.last <= after.first)
    for episode in found.episodes:
        _check(episode, judged)
    assert table.is_lost[-1] <= (bool(found.episodes) and found.episodes[-1].lost is not None)


@settings(max_examples=100)
@given(st.lists(st.sampled_from("RRRRRUBOOOOSNro"), min_size=1, max_size=40).map("".join), st.integers(0, 40))
def test_a_live_run_is_told_the_same_by_its_last_rows(letters, doubted):
    """Nothing but the rows since it was at rest is needed, and nothing that was told is taken back."""
    whole, recent = run(letters, doubted=range(doubted, doubted + 9)), Recent(_Growing(letters, doubted))
    told = list[tuple[int, str]]()
    for updates in range(1, len(letters) + 1):
        recent.rows.updates = updates
        so_far, rows = run(letters[:updates], doubted=range(doubted, doubted + 9)), recent.table()
        assert rows.states[-1] == so_far.states[-1] == whole.states[updates - 1]
        changes = episodes(rows).changes
        told += [(updates - 1, one.account) for update, one in changes if update == rows.updates - 1]
        assert recent.standing() == standing(so_far)
    assert told == [(update, one.account) for update, one in episodes(whole).changes]


class _Growing:
    """The rows of a run so far."""

    def __init__(self, letters: str, doubted: int) -> None:
        self.letters, self.doubted, self.updates = letters, doubted, 0

    def table(self, *, first: int, before: Standing | None) -> RunTable:
        whole = run(self.letters[: self.updates], doubted=range(self.doubted, self.doubted + 9))
        columns = {name: getattr(whole, name)[first:] for name in (*OF_THE_DRIVE, *OF_A_RUN, "events")}
        return replace(whole, before=before, **columns)


def test_a_run_at_rest_keeps_a_row_or_two():
    growing = _Growing("SSSS" + "R" * 60, 100)
    recent, lengths = Recent(growing), []
    for growing.updates in range(1, 65):
        lengths.append(recent.table().updates)
        recent.standing()
    assert lengths[:8] == [*range(1, 9)]
    assert set(lengths[9:]) == {2}


def _check(episode: Episode, judged: dict[int, StepScore]) -> None:
    """Check what the numbers of an episode mean, against the scores of the steps whose truth is known."""
    steps = list(judged)
    named = [at for at in (episode.wrong, episode.lost) if at is not None]
    assert all(episode.first <= at <= episode.last for at in named)
    assert episode.first <= episode.last
    if episode.wrong is not None:
        assert judged[episode.wrong].lost
        assert episode.kind != SEARCHING
    if episode.lost is not None:
        at = steps.index(episode.lost)
        assert all(judged[step].lost for step in steps[at - 3 : at + 1])
    end = episode.last + 1 if episode.localized is None else episode.localized
    assert not any(episode.last < step < end for step in steps)
    if episode.localized is not None:
        at = steps.index(episode.localized)
        assert judged[episode.localized].localized
        assert sum(judged[step].localized is True for step in steps[at : at + 5]) >= 4
    span = [judged[step] for step in steps if episode.first <= step < end]
    assert episode.steps == len(span)
    assert episode.sure == sum(score.wrong_and_confident is True for score in span)
