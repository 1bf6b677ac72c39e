"""Configurations of earlier versions still mean what they meant."""

import pytest

from maurice_mcl.config.parameters import RENAMED_KEYS, RULES, Layer, configure, defaults

OLD = {
    "selection.method": "nearest",
    "selection.interpolation.between": False,
    "tail.share": 0.02,
    "tail.widen": "3",
    "reseeding.strategy": "threshold",
    "reseeding.threshold.settle": 7,
    "reseeding.dual.teleport": 0.5,
}


def test_old_keys_set_what_todays_keys_set() -> None:
    values = configure([Layer("old.toml", OLD)]).values()
    assert values["references.method"] == "nearest"
    assert values["references.interpolation.virtual"] is False
    assert values["motion_outliers.share"] == 0.02
    assert values["motion_outliers.widen"] == 3.0
    assert values["recovery.strategy"] == "threshold"
    assert values["recovery.threshold.settle"] == 7
    assert values["recovery.mixture.teleport"] == 0.5
    assert list(values) == list(RULES)


def test_every_old_key_and_word_stands_for_one_of_today() -> None:
    assert set(RENAMED_KEYS.values()) <= set(RULES)
    assert not set(RENAMED_KEYS) & set(RULES)
    assert len(set(RENAMED_KEYS.values())) == len(RENAMED_KEYS)
    named = {key: defaults()[key] for key in RENAMED_KEYS.values()}
    renamed = configure([Layer("old", {old: named[key] for old, key in RENAMED_KEYS.items()})])
    assert renamed.values() == defaults()
    for key in ("reseeding.strategy", "recovery.strategy"):
        assert configure([Layer("old", {key: "dual"})]).parameters.recovery.strategy == "mixture"


def test_a_later_layer_wins_and_errors_name_todays_key() -> None:
    origin = "MAURICE_FILTER_TAIL__SHARE"
    layers = [Layer("file", {"motion_outliers.share": 0.1}), Layer(origin, {"tail.share": "0.3"})]
    found = configure(layers)
    assert found.parameters.motion_outliers.share == 0.3
    assert {s.key: s.origin for s in found.settings}["motion_outliers.share"] == origin
    with pytest.raises(
        ValueError, match=r"old\.toml: motion_outliers\.share: found 2, expected a number from 0"
    ):
        configure([Layer("old.toml", {"tail.share": 2})])
