"""What runs are called where room is scarce."""

from __future__ import annotations

import pytest

from maurice_viz.scene import SHORT, RunView, numbered, short_names, shortly


@pytest.mark.parametrize(
    ("labels", "names"),
    [
        (["thesis", "calibrated"], ["thesis", "calibrated"]),
        (["calibrated-landmarks", "robust"], ["calibra\N{HORIZONTAL ELLIPSIS}ndmarks", "robust"]),
        (["kitchen-robust-monday", "kitchen-thesis-monday", "S"], ["robust", "thesis", "S"]),
        (
            ["kitchen-robust-monday", "kitchen-robust"],
            ["kitchen\N{HORIZONTAL ELLIPSIS}-monday", "kitchen-robust"],
        ),
    ],
)
def test_long_names_are_shortened_and_none_are_alike(labels, names):
    assert short_names(labels) == names
    assert [run.short for run in numbered(RunView(label, ()) for label in labels)] == names
    assert all(len(name) <= SHORT for name in names)


def test_no_text_has_the_long_name():
    runs = numbered(RunView(label, ()) for label in ("kitchen-robust-monday", "kitchen-thesis-monday"))
    text = "`kitchen-robust-monday` is closer than `kitchen-thesis-monday`."
    assert shortly(runs, text) == "`robust` is closer than `thesis`."


def test_no_name_is_that_of_another_run():
    """Also not of one whose name happens to be the short form."""
    taken = "calibra\N{HORIZONTAL ELLIPSIS}ndmarks"
    names = short_names([taken, "calibrated-landmarks", "calibrated-by-landmarks"])
    assert len({*names}) == 3
    assert names[0] == taken
