from __future__ import annotations

import numpy as np
import pytest

from maurice_datasets.render.conditions import (
    Conditions,
    LightChange,
    brightness_at,
    conditions_for,
    daylight_at,
    events_at,
    named_lights,
    parse_lights,
    reshades,
    sources_off,
    weights_at,
)
from maurice_datasets.render.image_sensor import Exposure, drifted, swings
from maurice_datasets.render.light import LightPart, parts_of, windows_of
from maurice_datasets.tasks import TIERS

PARTS = (LightPart("lamp"), LightPart("other lamp"), LightPart("window", 1), LightPart("window", -1))
WINDOWS = frozenset({"window"})


def weights(text: str, number: int) -> np.ndarray:
    return weights_at(PARTS, WINDOWS, parse_lights(text), number)


def test_dimming_lasts_until_the_lights_are_on_again():
    lights = parse_lights("dim@10,dim:0.2@20,on@30")
    assert [brightness_at(lights, k) for k in (1, 9, 10, 19, 20, 29, 30)] == [1, 1, 0.6, 0.6, 0.2, 0.2, 1]
    assert brightness_at((LightChange("dim", 3),), 3) == brightness_at(parse_lights("dim@3"), 3)


def test_lamps_and_windows_go_out_alone():
    lights = parse_lights("off:a@2,off:b@3,on:a@4,on@5")
    assert [sorted(sources_off(lights, k)) for k in range(1, 6)] == [[], ["a"], ["a", "b"], ["b"], []]
    assert (weights("off:lamp@5,daylight@6-9", 4) == 1).all()
    assert weights("off:lamp@5", 5)[:, 0].tolist() == [0, 1, 1, 1]
    assert weights("off:window@5", 5)[:, 0].tolist() == [1, 1, 0, 0]


def test_daylight_moves_and_ends_weaker_warmer_and_from_one_side():
    lights = parse_lights("daylight@20-100")
    moved = np.array([daylight_at(lights, k) for k in range(1, 121)])
    assert (moved[:20] == 0).all()
    assert (moved[99:] == 1).all()
    assert (np.diff(moved) >= 0).all()
    assert np.diff(moved).max() < 0.02
    late = weights("daylight@2-10", 10)
    assert (late[:2] == 1).all()
    assert (late[2] > 5 * late[3]).all()
    together = late[2:].mean(axis=0)
    assert (together < 1).all()
    assert together[0] > together[1] > together[2]


def test_changes_begin_rest_and_reshade():
    lights = parse_lights("dim@3,off:lamp@3,on@5,daylight@4-9")
    told = {k: events_at(lights, k) for k in range(1, 11)}
    assert told.pop(3) == ("lights dim to 60%", "lights off lamp")
    assert told.pop(4) == ("lights daylight moves",)
    assert told.pop(5) == ("lights on",)
    assert told.pop(9) == ("lights daylight rests",)
    assert set(told.values()) == {()}
    assert not reshades(Conditions(parse_lights("dim@3,on@5")))
    assert reshades(Conditions(parse_lights("off@3")))
    assert reshades(Conditions(parse_lights("daylight@3-4")))


def test_lights_are_named(world):
    lamp = next(source for source in world.sources if source not in windows_of(world))
    assert named_lights(world, parse_lights("off@3"))[0].source == lamp
    with pytest.raises(ValueError, match="no light called 'attic'") as caught:
        named_lights(world, parse_lights("off:attic@3"))
    assert world.sources[0] in str(caught.value)


def test_parts_of_a_source_share_it_out_without_rest(world):
    for source in world.sources:
        parts = [part for part in parts_of(world) if part.source == source]
        assert sum(part.whole for part in parts) == pytest.approx(1)
        for lamp in world.lamps:
            if lamp.source == source:
                assert sum(part.shares(lamp) for part in parts) == pytest.approx(np.ones(len(lamp.points)))


def test_drift_is_smooth_seeded_and_bounded():
    conditions, plain = Conditions(drift=0.2, tint=0.1), Exposure((1.1, 1.0, 0.9))
    seen = []
    for seed in range(40):
        gains = np.array([drifted(plain, conditions, seed, k).gain for k in range(1, 401, 5)]) / plain.gain
        assert np.abs(gains[:, 1] - 1).max() <= 0.2
        assert np.abs(gains[:, [0, 2]] / gains[:, 1:2] - 1).max() <= 0.1 + 1e-12
        assert np.abs(np.diff(gains[:, 1])).max() < 5 * 0.2 * 0.07
        seen.append(np.abs(gains[:, 1] - 1).max())
    assert min(seen) > 0.1  # over 400 updates every session really drifts
    assert swings(1, 7, 3) == swings(1, 7, 3)
    assert swings(1, 7, 3) != swings(2, 7, 3)
    assert drifted(Exposure((1.1, 1.0, 0.9), True), Conditions(), 3, 50) == Exposure((1.1, 1.0, 0.9), True)


def test_the_notation_is_read():
    assert parse_lights("dim@40,off@60,daylight@20-100,on@80") == (
        LightChange("daylight", 20, until=100),
        LightChange("dim", 40, amount=0.6),
        LightChange("off", 60),
        LightChange("on", 80),
    )
    assert parse_lights(" dim:0.4@7 , off:west room lamp@8,bright@9, drift:0.1") == (
        LightChange("drift", amount=0.1),
        LightChange("dim", 7, amount=0.4),
        LightChange("off", 8, source="west room lamp"),
        LightChange("on", 9),
    )


@pytest.mark.parametrize("text", ["", "  "])
def test_nothing_is_no_change(text):
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
        ("dim:2.5@4", "share from 0 to 2"),
        ("drift:1.5", "share from 0 to 1"),
        ("dim:nan@4", "share from 0 to 2"),
        ("dim:much@4", "share from 0 to 2"),
        ("daylight@20", "daylight@FIRST-LAST"),
        ("daylight:0.5@20-30", "daylight@FIRST-LAST"),
        ("daylight@30-20", "last update comes after its first"),
        ("daylight@30-30", "last update comes after its first"),
        ("dim@4,", "one of dim"),
    ],
)
def test_what_cannot_be_read_ends_in_one_line_with_an_example(text, wanted):
    with pytest.raises(ValueError, match="expected") as caught:
        parse_lights(text)
    assert wanted in str(caught.value)
    assert "for example" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_tier_and_the_user_both_count_and_the_stronger_drift_wins():
    made = conditions_for(TIERS["hard"], parse_lights("drift:0.1,off@3"), gain="auto")
    assert made == Conditions((LightChange("off", 3),), 0.2, 0.1, 0.3, "auto")
    assert conditions_for(TIERS["nominal"], parse_lights("drift")).drift == 0.2
    assert conditions_for(TIERS["nominal"]) == Conditions()


@pytest.mark.parametrize(
    "bad", [{"drift": -0.1}, {"occluded": 1.1}, {"tint": float("nan")}, {"gain": "manual"}]
)
def test_senseless_conditions_are_refused(bad):
    with pytest.raises(ValueError, match="expected"):
        Conditions(**bad)  # type: ignore[arg-type]  # that is the point


def test_lights_can_get_brighter_than_the_survey():
    lights = parse_lights("dim:1.15@3")
    assert [brightness_at(lights, number) for number in (2, 3)] == [1, 1.15]
    assert events_at(lights, 3) == ("lights brighten to 115%",)
