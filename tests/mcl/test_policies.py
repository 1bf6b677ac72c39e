import numpy as np
import pytest

from maurice_mcl.filter.resampling import always, below_effective, every, never
from maurice_mcl.records import Belief, normalize


def _belief(weights):
    logs = normalize(np.log(np.asarray(weights, float)))[0]
    return Belief(np.zeros((len(logs), 3), np.float32), logs, np.zeros(2))


EVEN = _belief([1, 1, 1, 1])
UNEVEN = _belief([2, 1, 1])  # 1 / (1/4 + 1/16 + 1/16) = 8/3 of 3


def test_always_and_never():
    assert all(always(belief, step) for belief in (EVEN, UNEVEN) for step in (1, 2))
    assert not any(never(belief, step) for belief in (EVEN, UNEVEN) for step in (1, 2))


@pytest.mark.parametrize(("share", "expected"), [(0.88, False), (0.89, True), (0.5, False), (1.0, True)])
def test_below_a_share_of_effective_particles(share, expected):
    """8/3 of 3 are 0.889."""
    assert below_effective(share)(UNEVEN, 1) is expected


def test_even_weights_are_never_below():
    assert not below_effective(0.999)(EVEN, 1)


def test_every_third():
    assert [step for step in range(1, 11) if every(3)(EVEN, step)] == [3, 6, 9]
    assert all(every(1)(EVEN, step) for step in range(1, 5))
