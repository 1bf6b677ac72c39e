from __future__ import annotations

import pytest

from maurice_loaders.errors import InputError
from maurice_viz.plots.calibration import figure, save


@pytest.mark.parametrize("name", ["noise", "noise.", "noise.jpeg"])
def test_a_figure_needs_an_ending_that_can_be_written(name, tmp_path):
    drawing, _ = figure("title", "x", "y")
    with pytest.raises(InputError, match=r"expected \.png, \.svg, \.pdf"):
        save(drawing, tmp_path / name, force=False)
