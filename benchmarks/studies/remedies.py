"""How often a proposed remedy works: planted failures, what `what-if --remedy` proposes, other seeds.

    python -m benchmarks.studies.remedies -o out/remedies           # the judged set; goes on where it stopped
    python -m benchmarks.studies.remedies -o out/remedies --write    # and the table goes into docs/what-if.md

Every planted run (`planted/`) is written as files, replayed and saved as a user would. Where it is not lost
any more (its pictures are JPEG now), it does not count.
"""

from __future__ import annotations

import argparse
import json
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import cv2
import joblib

import maurice_viz as mv
from maurice_datasets.trials.drives import RenderedSession
from maurice_datasets.trials.statistics import rate
from maurice_loaders.errors import InputError
from maurice_loaders.export.session import convert_to_log
from maurice_loaders.libraries.files import save_library
from maurice_viz.app.branch import open_branch
from maurice_viz.app.remedies import candidates
from maurice_viz.errors import OptionError

from .planted.places import SETS
from .planted.planting import Planted, planted
from .planted.ways import HEALTHY, WAYS

DOCS = Path(__file__).parents[2] / "docs" / "what-if.md"
SEEDS, FRESH = range(1, 13), range(1001, 1013)
SLOW = ("particles x16", "particles x64")  # take most of the time, and are left out here
WORKS = 0.8  # share of the seeds that are localized at the end
LIBRARY, MOTION = "library", "motion"  # the motion model is in the header of a session
Row = dict[str, Any]


def main() -> None:
    asked = _asked()
    file = asked.output / f"remedies-{asked.set}.jsonl"
    file.parent.mkdir(parents=True, exist_ok=True)
    rows = [json.loads(line) for line in file.read_text().splitlines()] if file.is_file() else []
    done = {(row["planted"], row["number"]) for row in rows}
    jobs = [(kind, number) for number in range(asked.drives) for kind in asked.kinds]
    left = [job for job in jobs if job not in done]
    parallel = joblib.Parallel(asked.jobs, return_as="generator_unordered", batch_size=1)
    for row in parallel(joblib.delayed(judged)(asked.set, *job) for job in left):
        rows.append(row)
        with file.open("a") as out:
            out.write(json.dumps(row) + "\n")
        print(json.dumps(row), flush=True)
    chosen = [row for row in rows if (row["planted"], row["number"]) in jobs]
    text = "\n".join([*table(chosen), "", *notes(chosen)])
    print(text)
    if asked.write:
        page = DOCS.read_text()
        marked = re.compile(r"(<!-- planted remedies -->\n).*?(<!-- end -->)", re.DOTALL)
        DOCS.write_text(marked.sub(lambda found: f"{found[1]}\n{text}\n\n{found[2]}", page))


def _asked() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.studies.remedies", description=__doc__)
    parser.add_argument("-o", "--output", type=Path, default=Path("out/remedies"))
    parser.add_argument("--set", choices=SETS, default="unseen")
    kinds = [kind for kind in WAYS if kind != HEALTHY]
    parser.add_argument("--kinds", nargs="*", choices=kinds, default=kinds, metavar="KIND")
    parser.add_argument("--drives", type=int, default=4, help="of each kind")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--write", action="store_true", help="put the table into docs/what-if.md")
    return parser.parse_args()


def judged(which: str, kind: str, number: int) -> Row:
    """Let a remedy be proposed for one planted run, and apply it with other seeds."""
    cv2.setNumThreads(1)
    world, arena = SETS[which].place_of(number)
    row: Row = {"planted": kind, "number": number, "world": Path(world).stem, "arena": arena}
    run = planted(kind, number, which)
    if run is None:
        return row | {"outcome": "no harm"}
    with TemporaryDirectory() as folder:
        where, saved = Path(folder) / "planted", Path(folder) / "run"
        try:
            session = write_planted(run, where)
            own = {key: value for key, value in run.planting.settings.items() if key != MOTION}
            mv.replay(
                session,
                where / LIBRARY,
                filter=mv.Filter(settings=own, seed=run.localizer.seed),
                save_run=saved,
            )
            possible, _ = candidates(open_branch(saved))
            names = [remedy.name for remedy in possible if remedy.name not in SLOW]
            tried = mv.remedies(saved, seeds=SEEDS, names=names)
        except (InputError, OptionError) as problem:
            return row | {"way": run.planting.way, "outcome": "left out", "why": str(problem)}
        was, best = tried.as_it_was.localized.value, tried.proposed
        row |= {"way": run.planting.way, "from": tried.from_step, "as_it_was": was}
        if best is None:
            top = tried.tried[0]
            tops = {"best": top.name, "best_share": top.localized.value, "verdict": top.verdict}
            return row | {"outcome": "nothing proposed"} | tops
        row |= {"outcome": "proposed", "proposed": best.name, "with_seeds": best.localized.value}
        after = mv.remedies(saved, tried.from_step, seeds=FRESH, names=[best.name]).tried[0]
        whole = mv.remedies(saved, 0, seeds=FRESH, names=[best.name]).tried[0]
        return row | {"fresh": after.localized.value, "whole_drive": whole.localized.value}


def write_planted(run: Planted, folder: Path) -> Path:
    """Write session and library of a planted run, without events that tell the cause; return the session."""
    planting, file = run.planting, folder / "session.log"
    folder.mkdir()
    library = replace(planting.library, pictures=(None,) * planting.library.size)
    save_library(library, folder / LIBRARY)
    motion = planting.settings.get(MOTION, planting.session.info.motion)
    info = replace(planting.session.info, arena=library.arena, survey=folder / LIBRARY, motion=motion)
    moments = tuple(replace(moment, events=()) for moment in planting.session.moments())
    for _ in convert_to_log(RenderedSession(info, moments), file, kind="jpeg"):
        pass
    return file


def table(rows: Sequence[Row]) -> list[str]:
    """Return a line for each kind of cause, and one for all."""
    head = "| planted cause | failures | localized as it was | proposed | works with other seeds |"
    lines = [f"{head} works over the whole drive | what |", "|---|---:|---:|---:|---|---|---|"]
    for kind in dict.fromkeys(row["planted"] for row in rows):
        lines.append(_line(kind.replace("_", " "), [row for row in rows if row["planted"] == kind]))
    return [*lines, _line("**all**", rows)]


def _line(name: str, rows: Sequence[Row]) -> str:
    judged_ones = [row for row in rows if row["outcome"] in ("proposed", "nothing proposed")]
    some = [row for row in rows if row["outcome"] == "proposed"]
    lucky = sum(row["as_it_was"] >= WORKS for row in judged_ones)
    names = Counter(row["proposed"] for row in some).most_common(3)
    listed = ", ".join(f"{what} ({count})" if count > 1 else what for what, count in names)
    shares = " | ".join(_share(some, which) for which in ("fresh", "whole_drive"))
    counts = f"{len(judged_ones)} | {lucky} | {len(some)}"
    return f"| {name} | {counts} | {shares} | {listed} |"


def notes(rows: Sequence[Row]) -> list[str]:
    """Return how many proposals work, failure by failure: runs of one failure are not independent."""
    judged_ones = [row for row in rows if row["outcome"] in ("proposed", "nothing proposed")]
    some = [row for row in judged_ones if row["outcome"] == "proposed"]
    got = f"{len(some)} of {len(judged_ones)} failures got a proposal."
    lines = [f"{got} It works in at least {WORKS:.0%} of the other seeds:", ""]
    hard = [row for row in some if row["as_it_was"] < WORKS]
    for name, ones in (("all proposals", some), ("those for failures that other noise does not end", hard)):
        for where, which in (("from the branch on", "fresh"), ("over the whole drive", "whole_drive")):
            interval = rate(sum(row[which] >= WORKS for row in ones), len(ones))
            share = f"{interval.value:.0%} [{interval.low:.0%}, {interval.high:.0%}]" if ones else "-"
            lines.append(f"* {name}, {where}: {share} of {len(ones)}")
    left = Counter(row["outcome"] for row in rows if row not in judged_ones)
    return [*lines, *(f"* not judged, {why}: {count}" for why, count in left.items())]


def _share(rows: Sequence[Row], which: str) -> str:
    if not rows:
        return "-"
    count = len(FRESH) * len(rows)
    interval = rate(round(sum(row[which] for row in rows) * len(FRESH)), count)
    return f"{interval.value:.0%} of {count} runs"


if __name__ == "__main__":
    main()
