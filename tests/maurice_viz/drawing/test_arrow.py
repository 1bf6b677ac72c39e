import numpy as np
import pytest
from rerun.components import TensorDataBatch

from maurice_viz.drawing.bars import tensor_of


@pytest.mark.parametrize("length", [1, 2, 84, 168])
def test_the_short_way_gives_what_rerun_gives(length: int) -> None:
    values = np.random.default_rng(length).random(length, np.float32)
    short = tensor_of(values)
    short.validate(full=True)
    assert short.equals(TensorDataBatch(values).as_arrow_array())


def test_tensors_are_copies() -> None:
    first = tensor_of(np.array([1, 2], np.float32))
    second = tensor_of(np.array([3, 4], np.float32))
    assert not first.equals(second)
    assert first.equals(TensorDataBatch(np.array([1, 2], np.float32)).as_arrow_array())
    values = np.arange(8, dtype=np.float32)[::2]
    assert tensor_of(values).equals(TensorDataBatch(values.copy()).as_arrow_array())
