"""Verdicts on the thesis's claims: each at least once from made-up runs, and those of the page again."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from benchmarks.thesis.__main__ import DOCS, EVIDENCE, claims_table
from benchmarks.thesis.claims import CLAIMS, STRATEGIES
from benchmarks.thesis.material import Material
from benchmarks.thesis.verdicts import (
    BUILT_IN,
    MEAN,
    NOT,
    REPRODUCED,
    SHARE,
    UNDECIDED,
    UNTESTABLE,
    Bound,
    Claim,
    ClaimResult,
    Sample,
    judged,
    read_evidence,
    write_evidence,
)
from maurice_datasets.trials.rows import TYPES
from maurice_datasets.trials.statistics import apart
from maurice_datasets.trials.table import with_settings

CLAIM = {claim.name: claim for claim in CLAIMS}
CALM = {"thesis": 0.2, "more heading noise": 0.2}


def verdict_of(name: str, *rows: dict[str, Any]) -> ClaimResult:
    """Return the result of a claim that is tested alone."""
    claim = CLAIM[name]
    return judged([claim], {name: claim.samples(material(*rows))})[0]


def material(*rows: dict[str, Any]) -> Material:
    made = Material(Path("trials"))
    filled = [{"settings": "{}", "arena": one.get("seed", 0) % 5, "session": "global"} | one for one in rows]
    held = pl.DataFrame([{name: one.get(name) for name in TYPES} for one in filled], schema=TYPES)
    made.__dict__["rows"] = with_settings(held)
    return made


def tracking(losses: dict[int, int], runs: int = 40, **more: Any) -> list[dict[str, Any]]:
    """Return runs of position tracking, so many of which were lost with each count."""
    named = {"part": "position-tracking", "session": "tracking", "error_mean_m": 0.1, "distance_m": 30.0}
    return [
        named | {"particles": count, "seed": seed, "lost": seed < number, "reached": seed >= number} | more
        for count, number in losses.items()
        for seed in range(runs)
    ]


def tracks(lost: int, runs: int = 40, **more: Any) -> list[dict[str, Any]]:
    """Return runs of the largest sample of position tracking, so many of which were lost."""
    return tracking({2000: lost}, runs, part="one-change", label="thesis", **more)


def pairs(
    part: str, key: str, values: dict[str, float], count: int = 20, **more: Any
) -> list[dict[str, Any]]:
    return [
        {
            "part": part,
            "session": "tracking",
            "seed": seed,
            key: value,
            "error_mean_m": error + 0.01 * (seed % 3),
        }
        | more
        for value, error in values.items()
        for seed in range(count)
    ]


def near(value: float, reach: float, drives: int = 20) -> Sample:
    """Return the sample of drives whose mean has this value, and an interval that reaches about so far."""
    values = np.resize([-1.0, 1.0], drives) * reach * np.sqrt(drives) / 2.1
    return Sample(MEAN, value + values - values.mean(), apart(drives))


BOUND = Bound("error", "in", 6, 13.5)


def verdict(*samples: Sample) -> str:
    claim = Claim("any", "1", "anything", (BOUND,) * len(samples), lambda material: samples)
    return judged([claim], {"any": samples})[0].verdict


@pytest.mark.parametrize(
    ("samples", "expected"),
    [
        ([near(9, 2)], REPRODUCED),
        ([near(9, 5)], UNDECIDED),
        ([near(20, 5)], NOT),
        ([near(3, 2)], NOT),
        ([near(3, 4)], UNDECIDED),
        ([near(9, 2, drives=4)], UNDECIDED),
        ([near(9, 2), near(9, 5)], UNDECIDED),
        ([near(9, 2), near(20, 3)], NOT),
    ],
)
def test_a_verdict_goes_as_far_as_the_interval(samples: list[Sample], expected: str) -> None:
    assert verdict(*samples) == expected


def test_one_of_many_claims_needs_more() -> None:
    alone, others = near(9, 2.7), near(9, 6)
    assert verdict(alone) == REPRODUCED
    claims = [Claim(str(number), "1", "", (BOUND,)) for number in range(12)]
    results = judged(claims, {claim.name: (others if int(claim.name) else alone,) for claim in claims})
    assert results[0].verdict == UNDECIDED


def test_no_verdict_is_wrong_more_often_than_promised() -> None:
    """Twenty claims at a time, whose figure lies on a bound: any verdict is wrong."""
    rng, wrong = np.random.default_rng(1), 0
    claims = [Claim(str(number), "1", "", (Bound("figure", low=0),)) for number in range(20)]
    for _ in range(60):
        samples = {claim.name: (Sample(MEAN, rng.normal(size=8), apart(8)),) for claim in claims}
        wrong += any(result.verdict != UNDECIDED for result in judged(claims, samples))
    assert wrong / 60 < 0.05 + 4 * np.sqrt(0.05 * 0.95 / 60)


def test_a_test_is_one_line_with_its_bounds_and_figures_keep_their_order() -> None:
    told = Bound("beside", "%", digits=0)
    claim = Claim("any", "1", "", (Bound("updates up to 16 in", "%", 50, digits=0), told))
    assert claim.tested == "updates up to 16 in: over 50 %"
    assert (BOUND.text, Bound("slope", high=3).text) == ("error: 6 to 13.5 in", "slope: below 3")
    half = Sample(SHARE, np.array([1.0, 1.0, 1.0, 0.0] * 5), apart(20))
    result = judged([claim], {"any": (half, Sample(SHARE, np.full(20, 0.02), apart(20)))})[0]
    assert result.shown == "75 % (53 to 89); beside 2 % (0 to 21)"
    assert result.sample == "20 drives"
    assert result.verdict == REPRODUCED  # what is only shown has no say
    assert judged([replace(claim, bounds=(claim.bounds[0],))], {"any": (half,)})[0].verdict == REPRODUCED


def test_a_share_of_shares_stays_within_0_and_100_percent() -> None:
    rare = Sample(SHARE, np.r_[np.zeros(19), 0.3], apart(20))
    assert 0 <= rare.interval(0.95).low < 0.015 < rare.interval(0.95).high
    rng = np.random.default_rng(0)
    means = [rng.beta(0.2, 1.8, 20) for _ in range(300)]  # of a tenth in the mean
    holds = [Sample(SHARE, values, apart(20)).interval(0.95) for values in means]
    assert np.mean([figure.low <= 0.1 <= figure.high for figure in holds]) > 0.90
    assert Sample(SHARE, np.ones(20), apart(20)).interval(0.999).high == 1


@cache
def shown() -> dict[str, ClaimResult]:
    return {result.claim.name: result for result in judged(CLAIMS, read_evidence(EVIDENCE))}


def test_the_page_has_the_verdicts_that_its_rows_give() -> None:
    """From what was measured of every run: each figure, interval, sample and verdict of docs/thesis.md."""
    page = (DOCS / "thesis.md").read_text(encoding="utf-8")
    assert f"\n{claims_table(read_evidence(EVIDENCE))}\n" in page


@pytest.mark.parametrize("claim", [claim for claim in CLAIMS if claim.test], ids=lambda claim: claim.name)
def test_every_claim_of_the_page_stands_on_runs_and_says_how_it_is_tested(claim: Claim) -> None:
    assert claim.tested.count(":") >= len([bound for bound in claim.bounds if bound.limits])
    assert shown()[claim.name].verdict in (REPRODUCED, NOT, UNDECIDED)
    assert "drive" in shown()[claim.name].sample


def test_evidence_is_read_as_it_was_written(tmp_path: Path) -> None:
    samples = (near(9, 2), Sample(SHARE, np.array([0.5, 1.0, 0.0]), apart(3)))
    write_evidence(tmp_path / "evidence.parquet", {"any": samples, "none": ()})
    again = read_evidence(tmp_path / "evidence.parquet")
    assert [sample.interval(0.9) for sample in again["any"]] == [sample.interval(0.9) for sample in samples]
    assert "none" not in again


def test_runs_of_two_drives_are_no_verdict() -> None:
    few = [row for row in tracking(dict.fromkeys((100, 500, 5000, 60000), 1)) if row["seed"] < 2]
    for name in ("Critical count", "Error and count", "100 particles"):
        assert verdict_of(name, *few).verdict in (UNDECIDED, UNTESTABLE)
    lost = [row | {"failure": "sensor"} for row in tracks(2, runs=2)]
    for name in ("Impoverishment", "Above 2,000", "Typical error"):
        assert verdict_of(name, *lost).verdict in (UNDECIDED, UNTESTABLE)


def test_drives_that_are_too_short_do_not_say_how_far_runs_get() -> None:
    short = tracking({100: 40}, distance_m=4.0, before_loss_m=1.0)
    assert verdict_of("100 particles", *short).verdict == UNTESTABLE


@pytest.mark.parametrize(
    ("name", "rows", "verdict"),
    [
        ("Critical count", tracking({500: 200, 5000: 0, 60_000: 0}, runs=400), REPRODUCED),
        ("Critical count", tracking({500: 0, 5000: 0, 60_000: 0}, runs=400), NOT),
        ("Critical count", tracking({500: 6, 5000: 0, 60_000: 0}, runs=20), UNDECIDED),
        ("Critical count", tracking({100: 3, 60_000: 0}), UNTESTABLE),
        ("Critical count", tracking({500: 0, 5000: 0, 60_000: 0}, lost=None), UNTESTABLE),
        ("Error and count", tracking({100: 0, 2000: 0}), REPRODUCED),
        ("Error and count", tracking({100: 0}) + tracking({2000: 0}, error_mean_m=1.0), NOT),
        ("Error and count", tracking({100: 40, 2000: 40}), UNTESTABLE),
        ("Error and distance", tracking({2000: 0}, error_mean_m=0.23), BUILT_IN),
        ("Heading noise", pairs("one-change", "label", CALM, 300, lost=False), REPRODUCED),
        ("Heading noise", pairs("one-change", "label", {**CALM, "more heading noise": 0.3}, lost=False), NOT),
        ("100 particles", tracking({100: 0}, before_loss_m=30.0), NOT),
        ("100 particles", tracking({100: 300}, runs=300, before_loss_m=14.0), REPRODUCED),
        ("100 particles", tracking({100: 39}, before_loss_m=14.0), UNDECIDED),
        ("100 particles", tracking({100: 0}, lost=None), UNTESTABLE),
        ("Impoverishment", tracks(40, failure="impoverished"), REPRODUCED),
        ("Impoverishment", tracks(40, failure="ambiguity"), NOT),
        ("Impoverishment", tracks(0), UNTESTABLE),
        ("Above 2,000", tracks(40, failure="motion"), REPRODUCED),
        ("Above 2,000", tracks(40, failure="sensor"), NOT),
        ("Above 2,000", tracks(5, failure="sensor"), UNDECIDED),
        ("Above 2,000", tracks(0), UNTESTABLE),
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
    assert result.verdict == verdict, result.shown
    assert "nan" not in result.shown


def test_variants_of_one_label_are_compared_whatever_they_set() -> None:
    values = {"plain L1": ('{"sensor.noise": 1}', 0.5), "thesis": ('{"preset": "thesis"}', 0.2)}
    rows = [
        one | {"settings": settings}
        for label, (settings, error) in values.items()
        for one in pairs("one-change", "label", {label: error})
    ]
    result = verdict_of("Noise floor and relevance", *rows)
    assert result.verdict == REPRODUCED, result.shown


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
    [("Success, global", "exact"), ("Success, kidnapped", "kidnapped")],
)
def test_success_is_the_thesis_s_and_told_beside_ours(name: str, part: str) -> None:
    result = verdict_of(name, *runs(part, 38, task="global"))
    assert result.verdict == REPRODUCED
    assert result.shown.count("(83 to 99") == 3, result.shown
    assert verdict_of(name, *runs(part, 2, task="global")).verdict == NOT
    assert verdict_of(name, *runs(part, 20, task="global")).verdict == UNDECIDED
    assert verdict_of(name, *runs(part, 38, 40, particles=500)).verdict == UNTESTABLE
    late = [row | {"localized_s": 301.0} for row in runs(part, 40, task="global")]
    assert verdict_of(name, *late).shown.endswith("our scores 0 % (0 to 9)")


def test_a_track_that_is_not_lost_is_success_by_ours() -> None:
    rows = runs("one-change", 40, task="tracking")
    assert verdict_of("Success, tracking", *rows).shown.endswith("our scores 100 % (91 to 100)")
    lost = [row | {"lost": True} for row in rows]
    assert verdict_of("Success, tracking", *lost).shown.endswith("our scores 0 % (0 to 9)")


@pytest.mark.parametrize(
    ("off_in", "verdict"),
    [([9.0] * 95 + [35.0] * 5, REPRODUCED), ([20.0] * 100, NOT), ([9.0] * 60 + [35.0] * 40, NOT)],
)
def test_typical_and_occasional_errors(off_in: list[float], verdict: str) -> None:
    rng = np.random.default_rng(0)
    rows = [row | {"error_m": [0.0254 * value for value in rng.permutation(off_in)]} for row in tracks(0)]
    result = verdict_of("Typical error", *rows)
    assert result.verdict == verdict, result.shown


def test_claims_have_names_of_their_own_and_a_test_or_a_reason() -> None:
    assert len({claim.name for claim in CLAIMS}) == len(CLAIMS)
    assert all(
        claim.stated and bool(claim.tested) != bool(claim.why) and claim.least >= 5 for claim in CLAIMS
    )


def test_fresh_particles_are_compared_with_none() -> None:
    def ends(strategy: str, right: bool) -> list[dict[str, Any]]:
        told = json.dumps({"recovery.strategy": strategy})
        named = {"part": "recovery", "label": strategy, "settings": told, "right_at_end": right}
        return [{**named, "seed": seed} for seed in range(20)]

    def of(right: bool, aided: bool) -> str:
        rows = [row for strategy in STRATEGIES for row in ends(strategy, aided)]
        return verdict_of("Sensor-aided sampling", *ends("none", right), *rows).verdict

    assert of(False, True) == REPRODUCED
    assert of(True, False) == NOT
    assert of(True, True) == UNDECIDED
    assert verdict_of("Sensor-aided sampling", *ends("none", False)).verdict == UNTESTABLE
