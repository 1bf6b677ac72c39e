import pytest

from maurice_datasets.render.conditions import Conditions, LightChange, conditions_for, parse_lights
from maurice_datasets.tasks import TIERS


def test_the_example_of_the_docs_is_read() -> None:
    assert parse_lights("dim@40,off@60,daylight@20-100,on@80") == (
        LightChange("daylight", 20, until=100),
        LightChange("dim", 40, amount=0.6),
        LightChange("off", 60),
        LightChange("on", 80),
    )


def test_shares_lamps_and_spaces_are_read() -> None:
    assert parse_lights(" dim:0.4@7 , off:west room lamp@8,bright@9, drift:0.1") == (
        LightChange("drift", amount=0.1),
        LightChange("dim", 7, amount=0.4),
        LightChange("off", 8, source="west room lamp"),
        LightChange("on", 9),
    )


@pytest.mark.parametrize("text", ["", "  "])
def test_nothing_is_no_change(text: str) -> None:
    assert parse_lights(text) == ()


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("flicker@4", "one of dim, off, on"),
        ("dim", "dim@ and the update"),
        ("drift@4", "drift without @"),
        ("dim@0", "integer from 1"),
        ("dim@4.5", "integer from 1"),
        ("dim@-4", "integer from 1"),
        ("dim@²", "integer from 1"),
        ("off@" + "9" * 30, "integer from 1"),
        ("dim:1.5@4", "share from 0 to 1"),
        ("dim:nan@4", "share from 0 to 1"),
        ("dim:much@4", "share from 0 to 1"),
        ("daylight@20", "daylight@FIRST-LAST"),
        ("daylight:0.5@20-30", "daylight@FIRST-LAST"),
        ("daylight@30-20", "last update comes after its first"),
        ("daylight@30-30", "last update comes after its first"),
        ("dim@4,", "one of dim"),
    ],
)
def test_what_cannot_be_read_ends_in_one_line_with_an_example(text: str, wanted: str) -> None:
    with pytest.raises(ValueError, match="expected") as caught:
        parse_lights(text)
    assert wanted in str(caught.value)
    assert "for example" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_tier_and_the_user_both_count_and_the_stronger_drift_wins() -> None:
    made = conditions_for(TIERS["hard"], parse_lights("drift:0.1,off@3"), gain="auto")
    assert made == Conditions((LightChange("off", 3),), 0.2, 0.1, 0.3, "auto")
    assert conditions_for(TIERS["nominal"], parse_lights("drift")).drift == 0.2
    assert conditions_for(TIERS["nominal"]) == Conditions()


@pytest.mark.parametrize(
    "bad", [{"drift": -0.1}, {"occluded": 1.1}, {"tint": float("nan")}, {"gain": "manual"}]
)
def test_senseless_conditions_are_refused(bad: dict[str, object]) -> None:
    with pytest.raises(ValueError, match="expected"):
        Conditions(**bad)  # type: ignore[arg-type]  # that is the point
