"""docs/trials.md lists the columns that rows have."""

from __future__ import annotations

from pathlib import Path

from maurice_datasets.trials.plan import shipped_plans
from maurice_datasets.trials.rows import SCHEMA

DOCS = Path(__file__).parents[3] / "docs"


def test_every_column_is_documented() -> None:
    lines = ["| column | type | meaning |", "|---|---|---|"]
    lines += [f"| `{name}` | {kind} | {what} |" for name, (kind, what) in SCHEMA.items()]
    wanted = "\n".join(lines)
    held = (DOCS / "trials.md").read_text().split("<!-- rows -->")[1].split("<!-- end -->")[0].strip()
    assert held == wanted


def test_every_shipped_plan_is_named() -> None:
    text = (DOCS / "trials.md").read_text()
    assert [name for name in shipped_plans() if f"`{name}`" not in text] == []
