"""docs/trials.md names the plans that come along."""

from __future__ import annotations

from pathlib import Path

from maurice_datasets.trials.plan import shipped_plans

DOCS = Path(__file__).parents[3] / "docs"


def test_every_shipped_plan_is_named() -> None:
    text = (DOCS / "trials.md").read_text()
    assert [name for name in shipped_plans() if f"`{name}`" not in text] == []
