"""Results as JSON has them, whatever is in them."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from maurice_mcl.values.plain import plain, plain_value


@dataclass(frozen=True)
class Inner:
    share: float

    @property
    def double(self) -> float:
        return 2 * self.share


@dataclass(frozen=True)
class Named:
    name: str

    def to_json(self) -> dict[str, Any]:
        return {"called": self.name}


@dataclass(frozen=True)
class Outer:
    file: Path
    inner: Inner
    more: tuple[Named, ...]
    found: dict[str, Any]


def test_what_is_within_is_plain_too_and_json_has_it_all():
    found = {
        "n": np.float32("nan"),
        "a": np.array([[1.0, -np.inf]]),
        "i": np.int32(3),
        "none": None,
        "b": np.True_,
    }
    made = plain(Outer(Path("a", "b.log"), Inner(float("inf")), (Named("x"),), found))
    assert json.loads(json.dumps(made, allow_nan=False)) == made
    assert made == {
        "file": str(Path("a", "b.log")),
        "inner": {"share": None},
        "more": [{"called": "x"}],
        "found": {"n": None, "a": [[1.0, None]], "i": 3, "none": None, "b": True},
    }


def test_properties_come_after_the_fields_and_a_method_of_its_own_is_not_asked_at_the_top():
    assert list(plain(Inner(0.5), "double").items()) == [("share", 0.5), ("double", 1.0)]
    assert plain(Named("x")) == {"name": "x"}
    assert plain_value(Named("x")) == {"called": "x"}
