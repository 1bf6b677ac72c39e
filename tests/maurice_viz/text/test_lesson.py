from __future__ import annotations

import pytest

from maurice_mcl.reasons.place import PlaceKnown
from maurice_mcl.values.geometry import INCH_M
from maurice_viz.style import UNITS, Scale
from maurice_viz.text.lesson import say_lesson

INCHES, METERS = Scale(UNITS["in"]), Scale(UNITS["m"])
REACH_M = 24 * INCH_M


def away(inches: float, rank: int | None = 1, *, is_true: bool = True) -> PlaceKnown:
    return PlaceKnown(is_true, inches * INCH_M, 0.0, 0, REACH_M, rank, 624)


def near(share: float, rank: int | None = 1, *, is_true: bool = True) -> PlaceKnown:
    return PlaceKnown(is_true, 0.0, share, 9, REACH_M, rank, 624)


@pytest.mark.parametrize(
    ("places", "sentence"),
    [
        ({"a": away(108.7)}, "The picture knows the place (rank 1 of 624); no dot is within 108 in."),
        (
            {"thesis": away(108.7), "robust": near(0.9)},
            "The picture knows the place (rank 1 of 624); no dot of `thesis` is within 108 in; "
            "the dots of `robust` are there.",
        ),
        ({"a": near(0.9, 210)}, "The picture does not know the place (rank 210 of 624); the dots are there."),
        ({"a": near(0.1, 30)}, "The picture ranks the place 30th of 624; 10% of the weight is there."),
        (
            {"a": away(50, 2), "b": away(61.2, 6)},
            "The picture knows the place (rank 2 to 6 of 624); no dot of `a` or `b` is within 50 in.",
        ),
        (
            {"a": near(0.001, 444), "b": near(1.0, 7), "c": near(1.0, 7)},
            "Of 624 places the picture ranks this one 444th for `a`, 7th for `b` and `c`; "
            "less than 1% of `a`'s weight is there; the dots of `b` and `c` are there.",
        ),
        ({"a": near(0.0, None, is_true=False)}, "Less than 1% of the weight is where the picture fits best."),
        (
            {"a": away(46.2, None, is_true=False), "b": near(1.0, None, is_true=False)},
            "No dot of `a` is within 46 in of where the picture fits best; the dots of `b` are there.",
        ),
        ({"a": away(46.2, None), "b": None}, "No dot of `a` is within 46 in of the white disk."),
        ({"a": None}, ""),
    ],
)
def test_the_sentence_follows_from_the_numbers(places, sentence):
    assert say_lesson(places, INCHES) == sentence


def test_dots_that_face_another_way_are_not_called_there():
    turned = PlaceKnown(True, 0.1, 0.0, 0, REACH_M, 1, 624)
    expected = "The picture knows the place (rank 1 of 624); dots are there, but face another way."
    assert say_lesson({"a": turned}, METERS) == expected


@pytest.mark.parametrize(("entries", "rank"), [(20, 2), (40, 3), (96, 5), (624, 7), (4000, 41)])
def test_a_rank_that_is_not_among_the_best_is_not_called_known(entries, rank):
    place = PlaceKnown(True, 0.0, 1.0, 9, REACH_M, rank, entries)
    assert "knows the place" not in say_lesson({"a": place}, METERS)
    first = PlaceKnown(True, 0.0, 1.0, 9, REACH_M, 1, entries)
    assert "knows the place (rank 1 of" in say_lesson({"a": first}, METERS)


@pytest.mark.parametrize(
    ("entries", "text"),
    [(1, "The dots are there."), (9, "The picture ranks the place 1st of 9; the dots are there.")],
)
def test_few_references_tell_nothing_of_knowing(entries, text):
    assert say_lesson({"a": PlaceKnown(True, 0.0, 1.0, 9, REACH_M, 1, entries)}, METERS) == text


@pytest.mark.parametrize(
    ("agree", "words"),
    [
        ((58, 60), "The scan fits the place (58"),
        ((40, 60), "The scan fits the place in part (40"),
        ((20, 60), "The scan does not fit the place (20"),
    ],
)
def test_of_a_laser_the_beams_that_agree_at_the_truth_tell(agree, words):
    place = PlaceKnown(True, 2.78, 0.0, 0, 0.6, agree=agree)
    text = say_lesson({"amcl": place}, METERS)
    assert text.startswith(words)
    assert text.endswith(f"of {agree[1]} beams agree); no dot is within 2.7 m.")
