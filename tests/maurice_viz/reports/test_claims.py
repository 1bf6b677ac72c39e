"""Verdicts on the thesis's claims: from made-up runs, each verdict at least once; the page in a browser."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Any

import polars as pl
import pytest

from helpers.browser import browser, needs_browser
from maurice_datasets.trials.plan import read_plan
from maurice_datasets.trials.rows import TYPES, RowStore
from maurice_datasets.trials.statistics import Interval
from maurice_datasets.trials.table import with_settings
from maurice_viz.plots.material import Material
from maurice_viz.reports import trials_report
from maurice_viz.reports.claims import CLAIMS, NOT, REPRODUCED, UNDECIDED, UNTESTABLE, below, between, said

CLAIM = {one.name: one for one in CLAIMS}


def material(*rows: dict[str, Any]) -> Material:
    made = Material(Path("trials"))
    filled = [{"settings": "{}", "arena": one.get("seed", 0) % 2} | one for one in rows]
    held = pl.DataFrame([{name: one.get(name) for name in TYPES} for one in filled], schema=TYPES)
    made.__dict__["rows"] = with_settings(held)
    return made


def tracking(losses: dict[int, int], runs: int = 40, **more: Any) -> list[dict[str, Any]]:
    """Return runs of position tracking, so many of which were lost with each count."""
    named = {"part": "position-tracking", "session": "tracking", "error_m": 0.1, "distance_m": 20.0}
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


def test_an_interval_decides_as_far_as_it_goes() -> None:
    assert between(Interval(9, 7, 11, 5), 6, 13.5) == REPRODUCED
    assert between(Interval(9, 5, 11, 5), 6, 13.5) == UNDECIDED
    assert between(Interval(20, 15, 25, 5), 6, 13.5) == NOT
    assert between(Interval(3, 1, 5, 5), 6, 13.5) == NOT
    assert below(Interval(-2, -3, -1, 5), 0) == REPRODUCED
    assert below(Interval(-2, -3, 1, 5), 0) == UNDECIDED
    assert below(Interval(2, 0, 3, 5), 0) == NOT


def test_a_figure_is_said_with_its_interval_and_runs() -> None:
    assert said(Interval(0.59, 0.52, 0.65, 20), "", 1, 2) == "0.59 (0.52 to 0.65, 20 runs)"
    assert said(Interval(0.5, 0.25, 0.75, 8), "%", 100, 0) == "50 % (25 to 75, 8 runs)"


@pytest.mark.parametrize(
    ("name", "rows", "verdict"),
    [
        ("Critical count", tracking({100: 40, 2000: 0, 60_000: 0}), REPRODUCED),
        ("Critical count", tracking({100: 0, 2000: 0, 60_000: 0}), NOT),
        ("Critical count", tracking({100: 3}), UNTESTABLE),
        ("Critical count", tracking({100: 0, 2000: 0}, lost=None), UNTESTABLE),
        ("Error and count", tracking({100: 0, 2000: 0}), REPRODUCED),
        ("Error and count", tracking({100: 0}) + tracking({2000: 0}, error_m=1.0), NOT),
        ("Error and count", tracking({100: 40, 2000: 40}), UNTESTABLE),
        ("Error and distance", tracking({2000: 0}, error_m=0.18), REPRODUCED),
        ("Error and distance", tracking({2000: 0}, error_m=1.8), NOT),
        ("Error and distance", tracking({100: 0}), UNTESTABLE),
        ("100 particles", tracking({100: 0}, before_loss_m=30.0), NOT),
        ("100 particles", tracking({100: 40}, before_loss_m=14.0), REPRODUCED),
        ("100 particles", tracking({100: 39}, before_loss_m=14.0), UNDECIDED),
        ("100 particles", tracking({100: 0}, lost=None), UNTESTABLE),
        ("Impoverishment", tracking({100: 40}, failure="impoverishment"), REPRODUCED),
        ("Impoverishment", tracking({100: 40}, failure="other"), NOT),
        ("Impoverishment", tracking({100: 0}), UNTESTABLE),
        ("Above 2,000", tracking({5000: 40}, failure="motion"), REPRODUCED),
        ("Above 2,000", tracking({5000: 40}, failure="other"), NOT),
        ("Above 2,000", tracking({5000: 0}), UNTESTABLE),
        ("Confidence", tracking({5000: 0}, confidence_end=0.97), UNTESTABLE),
        ("Edges", pairs("edges", "feature", {"color": 0.5, "edges": 0.2}), REPRODUCED),
        ("Edges", pairs("edges", "feature", {"color": 0.2, "edges": 0.5}), NOT),
        ("Edges", pairs("edges", "feature", {"color": 0.2}), UNTESTABLE),
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
    found = CLAIM[name].check(material(*rows))
    assert found.verdict == verdict, found.ours
    assert "nan" not in found.ours


def test_variants_of_one_label_are_compared_whatever_they_set() -> None:
    values = {"plain L1": ('{"sensor.noise": 1}', 0.5), "thesis": ('{"preset": "thesis"}', 0.2)}
    rows = [
        one | {"settings": settings}
        for label, (settings, error) in values.items()
        for one in pairs("tailoring", "label", {label: error})
    ]
    found = CLAIM["Noise floor and relevance"].check(material(*rows))
    assert found.verdict == REPRODUCED, found.ours


def test_fresh_particles_are_compared_with_none() -> None:
    def ends(strategy: str, right: bool) -> list[dict[str, Any]]:
        told = json.dumps({"recovery.strategy": strategy})
        named = {"part": "recovery", "settings": told, "right_at_end": right}
        return [{**named, "seed": seed} for seed in range(20)]

    claim = CLAIM["Sensor-aided sampling"]
    assert claim.check(material(*ends("none", False), *ends("sensor", True))).verdict == REPRODUCED
    assert claim.check(material(*ends("none", True), *ends("sensor", True))).verdict == NOT
    assert claim.check(material(*ends("none", False))).verdict == UNTESTABLE


@pytest.mark.slow
@needs_browser
def test_the_page_has_no_errors_and_fits_a_phone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store = RowStore.begin(tmp_path / "out", read_plan("thesis"), resume=False)
    store.add([one | {"variant": one["particles"], "settings": "{}"} for one in tracking({100: 3, 2000: 0})])
    claims = tuple(one for one in CLAIMS if one.name != "Match quality")  # simulates a drive
    monkeypatch.setattr(trials_report, "CLAIMS", claims)
    monkeypatch.setattr(trials_report, "drawings", lambda material, progress: [])
    page = tmp_path / "trials.html"
    page.write_text(trials_report.page_of(Material(tmp_path / "out")))
    with browser(tmp_path / "profile") as shown:
        for domain in ("Runtime", "Log"):
            shown.call(f"{domain}.enable")
        for width in (400, 1600):
            shown.open(page.as_uri(), width=width, height=800)
            told = list(shown.events_until(time.monotonic() + 1))
            assert not [one for one in told if one["method"].startswith(("Runtime.exception", "Log.entry"))]
            assert shown.value("document.documentElement.scrollWidth") <= width
