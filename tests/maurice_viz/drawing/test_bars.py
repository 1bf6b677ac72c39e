"""Charts of histograms: how high their bands are."""

import numpy as np

from maurice_mcl.library import ChannelIndex
from maurice_viz.drawing.bars import usual_difference


def _index(references: list[list[float]]) -> ChannelIndex:
    held = np.array(references, np.float32)
    return ChannelIndex(held, np.zeros(held.shape[1], np.float32), held.max(axis=0))


def test_differences_are_as_high_as_those_to_the_most_similar_reference() -> None:
    index = _index([[1, 4], [100, 900], [1.5, 4], [100, 900.5]])  # in pairs, far from the one beside it
    assert 0.4 < usual_difference(index, "l1") <= 0.5


def test_a_single_reference_has_nothing_to_differ_from() -> None:
    assert usual_difference(_index([[1, 2]]), "hellinger") == 1.0


def test_equal_references_still_give_a_band_that_can_be_seen() -> None:
    assert usual_difference(_index([[3, 3], [3, 3]]), "hellinger") > 0
