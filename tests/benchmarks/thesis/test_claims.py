"""Verdicts on the thesis's claims: from made-up runs, each verdict at least once."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from scipy.special import ndtri

from benchmarks.thesis.claims import CLAIMS
from benchmarks.thesis.material import Material
from benchmarks.thesis.verdicts import (
    BUILT_IN,
    NOT,
    REPRODUCED,
    UNDECIDED,
    UNTESTABLE,
    ClaimFigure,
    ClaimResult,
    judged,
    said,
)
from maurice_datasets.trials.rows import TYPES
from maurice_datasets.trials.statistics import Interval, mean
from maurice_datasets.trials.table import with_settings

CLAIM = {claim.name: claim for claim in CLAIMS}


def verdict_of(name: str, *rows: dict[str, Any]) -> ClaimResult:
    """Return the result of a claim that is tested alone."""
    return judged([CLAIM[name].check(material(*rows))])[0]


def material(*rows: dict[str, Any]) -> Material:
    made = Material(Path("trials"))
    filled = [{"settings": "{}", "arena": one.get("seed", 0) % 5, "session": "global"} | one for one in rows]
    held = pl.DataFrame([{name: one.get(name) for name in TYPES} for one in filled], schema=TYPES)
    made.__dict__["rows"] = with_settings(held)
    return made


def tracking(losses: dict[int, int], runs: int = 40, **more: Any) -> list[dict[str, Any]]:
    """Return runs of position tracking, so many of which were lost with each count."""
    named = {"part": "position-tracking", "session": "tracking", "error_m": 0.1, "distance_m": 30.0}
    return [
        named | {"particles": count, "seed": seed, "lost": seed < number, "reached": seed >= number} | more
        for count, number in losses.items()
        for seed in range(runs)
    ]


def pairs(part: str, key: str, values: dict[str, float], **more: Any) -> list[dict[str, Any]]:
    return [
        {"part": part, "session": "tracking", "seed": seed, key: value, "error_m": error + 0.01 * (seed % 3)}
        | more
        for value, error in values.items()
        for seed in range(20)
    ]


def evidence(value: float, reach: float, low: float = 6, high: float = 13.5, drives: int = 20) -> ClaimFigure:
    """Return a figure whose interval reaches so far at 95 %, and farther at a higher level."""

    def figure(level: float) -> Interval:
        wide = reach * ndtri((1 + level) / 2) / 1.96
        return Interval(value, value - wide, value + wide, drives, drives)

    return ClaimFigure(figure, low, high)


@pytest.mark.parametrize(
    ("parts", "verdict"),
    [
        ([evidence(9, 2)], REPRODUCED),
        ([evidence(9, 5)], UNDECIDED),
        ([evidence(20, 5)], NOT),
        ([evidence(3, 2)], NOT),
        ([evidence(3, 4)], UNDECIDED),
        ([evidence(9, 2, drives=4)], UNDECIDED),
        ([evidence(9, 2), evidence(9, 5)], UNDECIDED),
        ([evidence(9, 2), evidence(20, 3)], NOT),
        ([evidence(9, np.nan)], UNDECIDED),
    ],
)
def test_a_verdict_goes_as_far_as_the_interval(parts: list[ClaimFigure], verdict: str) -> None:
    assert judged([ClaimResult("", evidence=tuple(parts))])[0].verdict == verdict


def test_one_of_many_claims_needs_more() -> None:
    alone = ClaimResult("", evidence=(evidence(9, 2.7),))
    assert judged([alone])[0].verdict == REPRODUCED
    others = [ClaimResult("", evidence=(evidence(9, 6),))] * 11
    assert judged([alone, *others, ClaimResult("", UNTESTABLE)])[0].verdict == UNDECIDED


def test_no_verdict_is_wrong_more_often_than_promised() -> None:
    """Twenty claims at a time, whose figure lies on a bound: any verdict is wrong."""
    rng, wrong = np.random.default_rng(1), 0
    for _ in range(60):
        figures = [partial(mean, rng.normal(size=8), None) for _ in range(20)]
        results = judged([ClaimResult("", evidence=(ClaimFigure(figure, 0),)) for figure in figures])
        wrong += any(result.verdict != UNDECIDED for result in results)
    assert wrong / 60 < 0.05 + 4 * np.sqrt(0.05 * 0.95 / 60)


def test_a_figure_is_said_with_its_interval_and_drives() -> None:
    assert said(Interval(0.59, 0.52, 0.65, 20, 20), "", 1, 2) == "0.59 (0.52 to 0.65, 20 drives)"
    assert said(Interval(0.5, 0.25, 0.75, 8, 1), "%", 100, 0) == "50 % (25 to 75, 8 runs of 1 drive)"
    assert said(mean(np.ones(2)), "in") == "1.0 in (no interval, 2 drives)"


def test_runs_of_two_drives_are_no_verdict() -> None:
    few = [row for row in tracking(dict.fromkeys((100, 500, 5000, 60000), 1)) if row["seed"] < 2]
    for name in ("Critical count", "Error and count", "100 particles", "Impoverishment", "Above 2,000"):
        result = verdict_of(name, *[row | {"failure": "sensor"} for row in few])
        assert result.verdict in (UNDECIDED, UNTESTABLE), result.ours


def test_drives_that_are_too_short_do_not_say_how_far_runs_get() -> None:
    short = tracking({100: 40}, distance_m=4.0, before_loss_m=1.0)
    assert verdict_of("100 particles", *short).verdict == UNTESTABLE


@pytest.mark.parametrize(
    ("name", "rows", "verdict"),
    [
        ("Critical count", tracking({500: 200, 2000: 0, 60_000: 0}, runs=400), REPRODUCED),
        ("Critical count", tracking({500: 0, 2000: 0, 60_000: 0}, runs=400), NOT),
        ("Critical count", tracking({500: 6, 2000: 0, 60_000: 0}, runs=20), UNDECIDED),
        ("Critical count", tracking({100: 3, 60_000: 0}), UNTESTABLE),
        ("Critical count", tracking({500: 0, 2000: 0, 60_000: 0}, lost=None), UNTESTABLE),
        ("Error and count", tracking({100: 0, 2000: 0}), REPRODUCED),
        ("Error and count", tracking({100: 0}) + tracking({2000: 0}, error_m=1.0), NOT),
        ("Error and count", tracking({100: 40, 2000: 40}), UNTESTABLE),
        ("Error and distance", tracking({2000: 0}, error_m=0.23), BUILT_IN),
        ("Error and distance", tracking({2000: 0}, error_m=1.8), BUILT_IN),
        ("Error and distance", tracking({100: 0}), UNTESTABLE),
        ("100 particles", tracking({100: 0}, before_loss_m=30.0), NOT),
        ("100 particles", tracking({100: 300}, runs=300, before_loss_m=14.0), REPRODUCED),
        ("100 particles", tracking({100: 39}, before_loss_m=14.0), UNDECIDED),
        ("100 particles", tracking({100: 0}, lost=None), UNTESTABLE),
        ("Impoverishment", tracking({100: 40}, failure="impoverished"), REPRODUCED),
        ("Impoverishment", tracking({100: 40}, failure="ambiguity"), NOT),
        ("Impoverishment", tracking({100: 0}), UNTESTABLE),
        ("Above 2,000", tracking({5000: 40}, failure="motion"), REPRODUCED),
        ("Above 2,000", tracking({5000: 40}, failure="sensor"), NOT),
        ("Above 2,000", tracking({5000: 2, 10_000: 2, 20_000: 1}, failure="sensor"), UNDECIDED),
        ("Above 2,000", tracking({5000: 0}), UNTESTABLE),
        ("Confidence", tracking({5000: 0}, confidence_end=0.97), UNTESTABLE),
        ("Turns", [], BUILT_IN),
        ("Edges", pairs("blended", "feature", {"color": 0.5, "edges": 0.2}), REPRODUCED),
        ("Edges", pairs("blended", "feature", {"color": 0.2, "edges": 0.5}), NOT),
        ("Edges", pairs("blended", "feature", {"color": 0.2}), UNTESTABLE),
        (
            "Brightness",
            pairs("brightness", "lights", {"": 0.1, "dim:1.3@1": 0.4}, feature="color"),
            REPRODUCED,
        ),
        ("Brightness", pairs("brightness", "lights", {"": 0.4, "dim:1.3@1": 0.1}, feature="color"), NOT),
        ("Brightness", pairs("brightness", "lights", {"": 0.1}, feature="color"), UNTESTABLE),
        ("Sensor-aided sampling", [], UNTESTABLE),
        ("Real time", [], UNTESTABLE),
    ],
)
def test_verdicts(name: str, rows: list[dict[str, Any]], verdict: str) -> None:
    result = verdict_of(name, *rows)
    assert result.verdict == verdict, result.ours
    assert "nan" not in result.ours


def test_variants_of_one_label_are_compared_whatever_they_set() -> None:
    values = {"plain L1": ('{"sensor.noise": 1}', 0.5), "thesis": ('{"preset": "thesis"}', 0.2)}
    rows = [
        one | {"settings": settings}
        for label, (settings, error) in values.items()
        for one in pairs("one-change", "label", {label: error})
    ]
    result = verdict_of("Noise floor and relevance", *rows)
    assert result.verdict == REPRODUCED, result.ours


def runs(part: str, right: int, count: int = 40, **more: Any) -> list[dict[str, Any]]:
    """Return runs of which so many succeed by every reading."""
    named = {"part": part, "label": "thesis", "feature": "color", "particles": 2000, "lost": False} | more
    ends = [seed < right for seed in range(count)]
    return [
        named
        | {
            "seed": seed,
            "succeeded_tenth": good,
            "succeeded_circle": good,
            "localized_s": 20.0 if good else None,
        }
        for seed, good in enumerate(ends)
    ]


@pytest.mark.parametrize(
    ("name", "part"),
    [("Success, global", "global-localization"), ("Success, kidnapped", "kidnapped")],
)
def test_success_is_the_thesis_s_and_told_beside_ours(name: str, part: str) -> None:
    result = verdict_of(name, *runs(part, 38, task="global"))
    assert result.verdict == REPRODUCED
    assert result.ours.count("(83 to 99") == 3, result.ours
    assert verdict_of(name, *runs(part, 2, task="global")).verdict == NOT
    assert verdict_of(name, *runs(part, 20, task="global")).verdict == UNDECIDED
    assert verdict_of(name, *runs(part, 38, 40, particles=500)).verdict == UNTESTABLE
    late = [row | {"localized_s": 301.0} for row in runs(part, 40, task="global")]
    assert "ours, localized in five minutes: 0 (" in verdict_of(name, *late).ours


def test_a_track_that_is_not_lost_is_success_by_ours() -> None:
    rows = runs("position-tracking", 40, task="tracking")
    assert "ours, not lost: 100 (" in verdict_of("Success, tracking", *rows).ours
    lost = [row | {"lost": True} for row in rows]
    assert "ours, not lost: 0 (" in verdict_of("Success, tracking", *lost).ours


@pytest.mark.parametrize(
    ("off_in", "verdict"),
    [([9.0] * 95 + [35.0] * 5, REPRODUCED), ([20.0] * 100, NOT), ([9.0] * 60 + [35.0] * 40, NOT)],
)
def test_typical_and_occasional_errors(off_in: list[float], verdict: str) -> None:
    rng = np.random.default_rng(0)
    rows = [
        row | {"off_m": [0.0254 * value for value in rng.permutation(off_in)]} for row in tracking({2000: 0})
    ]
    result = verdict_of("Typical error", *rows)
    assert result.verdict == verdict, result.ours


def test_every_claim_says_how_it_is_tested() -> None:
    assert len({claim.name for claim in CLAIMS}) == len(CLAIMS)
    assert all(claim.tested and claim.stated and claim.least >= 5 for claim in CLAIMS)


def test_fresh_particles_are_compared_with_none() -> None:
    def ends(strategy: str, right: bool) -> list[dict[str, Any]]:
        told = json.dumps({"recovery.strategy": strategy})
        named = {"part": "recovery", "settings": told, "right_at_end": right}
        return [{**named, "seed": seed} for seed in range(20)]

    name = "Sensor-aided sampling"
    assert verdict_of(name, *ends("none", False), *ends("sensor", True)).verdict == REPRODUCED
    assert verdict_of(name, *ends("none", True), *ends("sensor", False)).verdict == NOT
    assert verdict_of(name, *ends("none", True), *ends("sensor", True)).verdict == UNDECIDED
    assert verdict_of(name, *ends("none", False)).verdict == UNTESTABLE
