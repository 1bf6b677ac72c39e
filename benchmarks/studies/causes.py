"""How often a diagnosis is right: planted causes by the first cause that is named (docs/diagnose.md).

    python -m benchmarks.studies.causes -o out/causes            # the judged set; goes on where it stopped
    python -m benchmarks.studies.causes -o out/causes --write    # and the table goes into docs/diagnose.md
    python -m benchmarks.studies.causes --set develop --kinds motion lighting --show    # while tuning
    python -m benchmarks.studies.causes --without-truth --drives 6 --write    # the diagnosis has no truth

Nothing was tuned on the drives of the judged set; one of its worlds is seen nowhere else. A planted run
counts only where the cause did harm: the run is lost with it, and the same filter is not lost without it.
"""

from __future__ import annotations

import argparse
import itertools
import json
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import joblib

from maurice_datasets.trials.statistics import rate
from maurice_mcl.reasons.causes import CAUSES, UNKNOWN, Failure
from maurice_mcl.reasons.diagnosis import DiagnosisBuilder
from maurice_mcl.reasons.second_opinion import SecondOpinion

from .planted.places import SETS
from .planted.planting import PLACES, planted
from .planted.ways import HEALTHY, WAYS

DOCS = Path(__file__).parents[2] / "docs" / "diagnose.md"
MARK, MARK_WITHOUT = "planted causes", "planted causes, without truth"
NONE = "none"
DRIVES = 20  # of each kind in which the cause did harm
MOST_TRIED = 3
Row = dict[str, Any]


def main() -> None:
    asked = asked_of("causes", __doc__ or "", list(WAYS), "docs/diagnose.md")
    cv2.setNumThreads(1)
    file = asked.output / f"{asked.set}{'-without-truth' if asked.without_truth else ''}.jsonl"
    if asked.anew and file.exists():
        file.unlink()
    rows = known(file)
    while jobs := jobs_of(rows, asked.kinds, asked.drives):
        for row in made(asked.set, jobs, asked.jobs, asked.without_truth):
            rows.append(row)
            keep(file, row)
            if asked.show:
                print(said(row), flush=True)
    chosen = [row for kind in asked.kinds for row in first_of(rows, kind, asked.drives)]
    about = suspicions(chosen) if asked.without_truth else notes(chosen)
    text = "\n".join([*table(chosen), "", *about])
    print(text)
    if asked.write:
        write(text, mark=MARK_WITHOUT if asked.without_truth else MARK)


def asked_of(name: str, about: str, kinds: Sequence[str], page: str) -> argparse.Namespace:
    """Read the command line of a study of planted kinds."""
    parser = argparse.ArgumentParser(prog=f"python -m benchmarks.studies.{name}", description=about)
    parser.add_argument("-o", "--output", type=Path, default=Path("out") / name.replace("_", "-"))
    parser.add_argument("--set", choices=SETS, default="unseen")
    parser.add_argument("--kinds", nargs="*", choices=kinds, default=list(kinds), metavar="KIND")
    parser.add_argument("--drives", type=int, default=DRIVES, help="of each kind that count")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--anew", action="store_true", help="diagnose again what was diagnosed before")
    parser.add_argument("--show", action="store_true", help="print every diagnosis with its evidence")
    parser.add_argument("--without-truth", action="store_true", help="keep the truth from the diagnosis")
    parser.add_argument("--write", action="store_true", help=f"put the table into {page}")
    return parser.parse_args()


def jobs_of(rows: Sequence[Row], kinds: Iterable[str], drives: int) -> list[tuple[str, int]]:
    """Return the runs to make next, those of one world and drive after another: rendering is shared.

    Where a cause did no harm another number is tried, up to `MOST_TRIED` for one drive.
    """
    jobs = []
    for kind in kinds:
        tried = {row["number"] for row in rows if row["planted"] == kind}
        missing = drives - len([row for row in rows if row["planted"] == kind and row["named"]])
        numbers = (number for number in range(MOST_TRIED * drives) if number not in tried)
        jobs += [(kind, number) for number in itertools.islice(numbers, max(missing, 0))]
    return sorted(jobs, key=lambda job: (job[1] % PLACES, job[1]))


def first_of(rows: Iterable[Row], kind: str, drives: int) -> list[Row]:
    """Return the rows of a kind up to its last drive that counts, in the order of their numbers."""
    of_kind = sorted((row for row in rows if row["planted"] == kind), key=lambda row: int(row["number"]))
    counted = [at for at, row in enumerate(of_kind) if row["named"]][:drives]
    return of_kind[: counted[-1] + 1] if len(counted) == drives else of_kind


def made(
    which: str, jobs: Sequence[tuple[str, int]], workers: int, without_truth: bool = False
) -> Iterator[Row]:
    """Diagnose all runs, each as soon as a process is free: pictures of the last drives are kept in each."""
    parallel = joblib.Parallel(workers, return_as="generator_unordered", batch_size=1)
    row = joblib.delayed(diagnosed)
    yield from parallel(row(which, kind, number, without_truth) for kind, number in jobs)


def diagnosed(which: str, kind: str, number: int, without_truth: bool = False) -> Row:
    """Make one run and diagnose it; without truth with the second opinion that a replay has."""
    cv2.setNumThreads(1)
    world, arena = SETS[which].place_of(number)
    row: Row = {"planted": kind, "number": number, "world": Path(world).stem, "arena": arena}
    run = planted(kind, number, which)
    if run is None:
        return row | {"named": None, "way": "", "discarded": 0}
    builder = DiagnosisBuilder(run.localizer)
    second = SecondOpinion.beside(run.localizer) if without_truth else None
    for moment, record in run.steps():
        if second is None:
            builder.add(moment, record)
        else:
            builder.add(replace(moment, truth=None), second.added_to(record))
    row |= {"way": run.planting.way, "since": run.planting.since, "lost": run.outcome.lost_from}
    return row | {"discarded": run.discarded} | named(builder.result())


def named(failures: Sequence[Failure]) -> Row:
    """Return what a diagnosis says first, as part of a row."""
    if not failures:
        return {"named": NONE}
    first = failures[0]
    row: Row = {"named": first.kind, "first": first.first, "at": first.episode.onset}
    row |= {"evidence": {name: str(value) for name, value in first.evidence.items()}}
    return row | {"also": list(first.also), "later": [failure.kind for failure in failures[1:]]}


def said(row: Row) -> str:
    """Return one diagnosis in a line."""
    right = "ok   " if row["named"] in (row["planted"], _right(row["planted"])) else "WRONG"
    where = f"{row['planted']} {row['number']} ({row['world']} {row['arena']}; {row['way']})"
    when = (
        f"since {row.get('since')}, lost from {row.get('lost')}; says {row.get('first')} to {row.get('at')}"
    )
    return f"{right} {where}: {row['named']} {row.get('also', '')} [{when}] {row.get('evidence', '')}"


def _right(kind: str) -> str:
    return NONE if kind == HEALTHY else kind


def table(rows: Sequence[Row]) -> list[str]:
    """Return the confusion matrix: planted causes down, named causes across."""
    kinds = list(dict.fromkeys(row["planted"] for row in rows))
    named = [NONE, *(kind for kind in kinds if kind != HEALTHY), *CAUSES]
    named = [name for name in dict.fromkeys(named) if any(row["named"] == name for row in rows)]
    lines = [f"| planted \\ named | runs | {' | '.join(_short(name) for name in named)} | right |"]
    lines.append(f"|---|{'---:|' * (len(named) + 1)}---|")
    for kind in kinds:
        some = [row for row in rows if row["planted"] == kind and row["named"]]
        counts = Counter(row["named"] for row in some)
        cells = [_cell(counts[name], name == _right(kind)) for name in named]
        right = rate(counts[_right(kind)], len(some))
        share = f"{right.value:.0%} [{right.low:.0%}, {right.high:.0%}]" if some else "-"
        lines.append(f"| {kind} | {len(some)} | {' | '.join(cells)} | {share} |")
    return lines


def _short(kind: str) -> str:
    return kind.replace("_", " ")


def _cell(count: int, right: bool) -> str:
    return f"**{count}**" if right else str(count or "")


def notes(rows: Sequence[Row]) -> list[str]:
    """Return what was left out."""
    missing = Counter(row["planted"] for row in rows if row["named"] is None)
    sick = [row for row in rows if row["planted"] != HEALTHY and row["named"]]
    well = [row for row in rows if row["planted"] == HEALTHY and row["named"]]
    right = rate(sum(row["named"] == row["planted"] for row in sick), len(sick))
    left = sum(row["discarded"] for row in rows)
    share = f"{right.value:.1%} [{right.low:.1%}, {right.high:.1%}] of {right.count} runs"
    lines = [
        f"All planted causes together: {share}; and {len(well)} healthy ones. {left} further runs were",
        "discarded, as the cause did no harm in them, or not the harm that is its own.",
    ]
    if missing:
        without = ", ".join(f"{count} of {kind}" for kind, count in missing.items())
        lines.append(f"No drive that was tried did harm for {without}.")
    return lines


def suspicions(rows: Sequence[Row]) -> list[str]:
    """Return how often a cause was named without truth, and how often that was wrong."""
    sick = [row for row in rows if row["planted"] != HEALTHY and row["named"]]
    well = [row for row in rows if row["planted"] == HEALTHY and row["named"]]
    noticed = [row for row in sick if row["named"] != NONE]
    causes = [row for row in noticed if row["named"] != UNKNOWN]
    wrong = sum(row["named"] != row["planted"] for row in causes)
    share = rate(wrong, len(causes))
    of_these = f": {share.value:.0%} [{share.low:.0%}, {share.high:.0%}]" if causes else ""
    doubted = sum(row["named"] != NONE for row in well)
    return [
        f"Of {len(sick)} runs that failed {len(noticed)} were doubted without truth; a cause was named in",
        f"{len(causes)}, and was wrong in {wrong} of these{of_these}. Of {len(well)} healthy runs {doubted} "
        "were doubted.",
    ]


def known(file: Path) -> list[Row]:
    """Return the rows that were made before."""
    if not file.is_file():
        return []
    return [json.loads(line) for line in file.read_text(encoding="utf-8").splitlines()]


def keep(file: Path, row: Mapping[str, Any]) -> None:
    """Add a row to a file."""
    file.parent.mkdir(parents=True, exist_ok=True)
    with file.open("a", encoding="utf-8") as out:
        out.write(json.dumps(row) + "\n")


def write(text: str, docs: Path = DOCS, mark: str = MARK) -> None:
    """Put the table between its marks in the docs, `<!-- planted causes -->` and `<!-- end -->`."""
    page = docs.read_text(encoding="utf-8")
    marked = re.compile(rf"(<!-- {mark} -->\n).*?(<!-- end -->)", re.DOTALL)
    docs.write_text(marked.sub(lambda found: f"{found[1]}\n{text}\n\n{found[2]}", page), encoding="utf-8")


if __name__ == "__main__":
    main()
