"""Charts of histograms: how high their bands are."""

import numpy as np
import pytest

from maurice_mcl.library import ChannelIndex
from maurice_viz.drawing.bars import usual_difference


def _index(references: list[list[float]]) -> ChannelIndex:
    held = np.array(references, np.float32)
    return ChannelIndex(held, np.zeros(held.shape[1], np.float32), held.max(axis=0))


@pytest.mark.parametrize(
    ("references", "distance", "low", "high"),
    [
        ([[1, 4], [100, 900], [1.5, 4], [100, 900.5]], "l1", 0.4, 0.5),  # to the most similar reference
        ([[1, 2]], "hellinger", 1.0, 1.0),  # a single one has nothing to differ from
        ([[3, 3], [3, 3]], "hellinger", 1e-9, 1.0),  # equal ones still give a visible band
    ],
)
def test_height_of_bands(references: list[list[float]], distance: str, low: float, high: float) -> None:
    assert low <= usual_difference(_index(references), distance) <= high
