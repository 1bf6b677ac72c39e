"""The results table as text: means and rates with intervals, and filters paired drive by drive."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

ARENAS = 10
TIERS = ("nominal", "dim", "hard")
TITLES = "filter, particles", "task", "tier", "drives", "error (in)", "of the oracle's", "heading (deg)"
RATES = "lost %", "right at the end %", "pictures to localize, %", "wrong and confident %"
Known = Mapping[tuple[str, int], dict[str, Any]]  # results by case and drive


@dataclass(frozen=True)
class Case:
    """One row of the table: a filter, a task, a tier."""

    name: str
    task: str
    tier: str
    light: float = 1.0  # of the session against the survey
    shuffled: bool = False

    @property
    def key(self) -> str:
        return f"{self.name}|{self.task}|{self.tier}|{self.light:g}"


def interval(values: np.ndarray, arenas: np.ndarray) -> tuple[float, float, float]:
    """Return the mean and its 95 percent interval, drawing arenas and then drives with replacement."""
    rng = np.random.default_rng(0)
    groups = [values[arenas == a] for a in np.unique(arenas)]
    means = []
    for _ in range(2000):
        chosen = rng.integers(len(groups), size=len(groups))
        drawn = [groups[k][rng.integers(len(groups[k]), size=len(groups[k]))] for k in chosen]
        means.append(np.concatenate(drawn).mean())
    low, high = np.percentile(means, (2.5, 97.5))
    return float(values.mean()), float(low), float(high)


def wilson(hits: int, count: int, z: float = 1.96) -> str:
    """Return a rate with its Wilson interval, in percent."""
    p = hits / count
    middle = (p + z * z / (2 * count)) / (1 + z * z / count)
    reach = z * np.sqrt(p * (1 - p) / count + z * z / (4 * count * count)) / (1 + z * z / count)
    return f"{100 * p:.0f} [{100 * max(middle - reach, 0):.0f}, {100 * (middle + reach):.0f}]"


def row(case: Case, found: Mapping[int, dict[str, Any]]) -> str:
    """Return one line of the table, of one case's results by drive."""
    drives = np.array(sorted(found))
    results, arenas = [found[d] for d in drives], drives % ARENAS
    oracle = np.array([r["oracle"] for r in results])
    mean, low, high = interval(np.array([r["error"] for r in results]), arenas)
    took = np.array([np.inf if r["took"] is None else r["took"] for r in results])
    middle = np.median(took)
    found_rate = wilson(int(np.isfinite(took).sum()), len(took))
    wrong = 100 * np.mean([r["wrong"] for r in results])
    light = "" if case.light == 1 else f", light {case.light - 1:+.0%}"
    return (
        f"| {case.name}{light} | {case.task} | {case.tier} | {len(results)} "
        f"| {mean:.1f} [{low:.1f}, {high:.1f}] "
        f"| {mean / oracle.mean():.2f} [{low / oracle.mean():.2f}, {high / oracle.mean():.2f}] "
        f"| {np.mean([r['heading'] for r in results]):.1f} "
        f"| {wilson(sum(r['lost'] for r in results), len(results))} "
        f"| {wilson(sum(r['right'] for r in results), len(results))} "
        f"| {'-' if case.task == 'tracking' else f'{middle:g}, {found_rate}'} "
        f"| {wrong:.1f} |"
    )


def paired(known: Known, first: str, second: str, tier: str) -> str:
    """Print by how much the first filter's error differs from the second's, drive by drive."""
    a, b = (Case(name, "tracking", tier).key for name in (first, second))
    drives = np.array(sorted({d for key, d in known if key == a} & {d for key, d in known if key == b}))
    if not len(drives):
        return ""
    apart = np.array([known[(a, d)]["error"] - known[(b, d)]["error"] for d in drives])
    mean, low, high = interval(apart, drives % ARENAS)
    return f"{mean:+.1f} [{low:+.1f}, {high:+.1f}]"


def show(cases: Sequence[Case], pairs: Sequence[tuple[str, str]], known: Known) -> None:
    """Print one row per measured case, then the pairs."""
    print(f"| {' | '.join((*TITLES, *RATES))} |")
    print("|" + "---|" * (len(TITLES) + len(RATES)))
    for case in cases:
        found = {drive: result for (key, drive), result in known.items() if key == case.key}
        if found:
            print(row(case, found))
    print("\nerror of the first less the second on the same drives (in)\n")
    print("| | nominal | dim | hard |\n|---|---|---|---|")
    for first, second in pairs:
        cells = [paired(known, first, second, tier) for tier in TIERS]
        print(f"| {first} against {second} | {' | '.join(cells)} |")
