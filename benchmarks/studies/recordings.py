"""What features find in real pictures, and how filters do on real drives, for docs/real-recordings.md.

The sets are a user's own: each a folder with `survey` and `drive`, recordings with true poses, or with a
table `poses.csv` of its pictures, whose column `part` says survey or drive; without one, stops go in turn.
Both ways are measured: the survey as library and the drive looked up in it, and swapped. Where a drive has no
odometry some is made of its truth, in three draws. The drives are the sample; draws of one are alike.

Run: make recordings RECORDINGS=DIR, or python -m benchmarks.studies.recordings DIR [-o OUT] [--seeds N]; it
goes on where it stopped.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import polars as pl

import maurice_viz as mv
from maurice_datasets.trials.engine import run_plan
from maurice_datasets.trials.plan import Part, Plan, SessionSpec, Variant, Variants
from maurice_datasets.trials.recognition import PlaceRecognition
from maurice_datasets.trials.rows import read_rows
from maurice_loaders.errors import InputError
from maurice_loaders.formats.registry import open_session

FEATURES = ("color", "blended", "best", "verified")
FILTERS = {
    "`robust`": {"preset": "robust"},
    "`robust`, `verified`": {"preset": "robust", "feature": "verified"},
    "`precise`": {"preset": "precise"},
}
STARTS = {"known start": "", "anywhere": "anywhere"}  # as a plan has them
DRAWS = 3  # of made odometry
WAYS = {"": ("survey", "drive"), " swapped": ("drive", "survey")}
EVERY = "1cm,0.6deg"  # every picture is a reference


@dataclass(frozen=True, slots=True)
class Way:
    """A library, and the drives that are looked up in it and driven over it."""

    name: str
    library: Path
    drive: Path
    draws: tuple[Path, ...]  # session logs


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.studies.recordings", description=__doc__)
    parser.add_argument("sets", type=Path, help="a folder of sets")
    parser.add_argument("-o", type=Path, default=Path("out/trials/recordings"), dest="folder")
    parser.add_argument("--seeds", type=int, default=1, help="of the filter on each draw")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    asked = parser.parse_args()
    try:
        ways = [way for path in sorted(asked.sets.iterdir()) for way in ways_of(path, asked.folder / "sets")]
        print("\n".join(recall_table(ways)), "\n", flush=True)
        plan = plan_of(ways, asked.seeds)
        run_plan(plan, asked.folder / "runs", workers=asked.workers, resume=True, progress=_progress)
        print("\n".join(error_table(read_rows(asked.folder / "runs"))))
    except InputError as problem:
        sys.exit(str(problem))


def ways_of(path: Path, folder: Path) -> Iterator[Way]:
    """Yield both ways of a set, with its libraries and logs in a folder; nothing for what is no set."""
    parts = parts_of(path, folder / path.name)
    for suffix, (survey, drive) in WAYS.items() if parts else ():
        library = folder / path.name / f"library of {survey}"
        if not library.exists():
            mv.build_library(parts[survey], library, every=EVERY)
        yield Way(path.name + suffix, library, parts[drive], _draws(parts[drive], folder / path.name, drive))


def parts_of(path: Path, folder: Path) -> dict[str, Path]:
    """Return the recordings of a set by name: its two folders, or those that its table is split into."""
    given = {name: path / name for name in ("survey", "drive")}
    if all(part.exists() for part in given.values()):
        return given
    if not (path / "poses.csv").is_file():
        return {}
    with (path / "poses.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    parts = {name: folder / name for name in given}
    stops: dict[tuple[str, str], int] = {}
    for name, part in parts.items():
        (part / "images").mkdir(parents=True, exist_ok=True)
        with (part / "poses.csv").open("w") as stream:
            print("time_s,image,x_m,y_m,heading_rad", file=stream)
            for number, row in enumerate(rows):
                stop = stops.setdefault((row["x_m"], row["y_m"]), len(stops))
                if row.get("part", ("survey", "drive")[stop % 2]) == name:
                    print(_line(number, row, path, part), file=stream)
    return parts


def _line(number: int, row: dict[str, str], path: Path, part: Path) -> str:
    """Return a row of a part's table, whose picture is linked to."""
    picture = part / "images" / Path(row["image"]).name
    if not picture.exists():
        picture.symlink_to((path / row["image"]).resolve())
    heading = row.get("heading_rad") or str(np.radians(float(row["heading_deg"])))
    time_s = row.get("time_s") or str(number)
    return f"{time_s},images/{picture.name},{row['x_m']},{row['y_m']},{heading}"


def _draws(drive: Path, folder: Path, name: str) -> tuple[Path, ...]:
    """Return a drive as session logs that begin at their first true pose, with measured odometry or draws."""
    measured = any(len(moment.frame.motions) for moment in open_session(drive).moments())
    logs = []
    for draw in range(1 if measured else DRAWS):
        log = folder / f"{name} {draw}" / "session.log"
        if not log.exists():
            reading = mv.Reading() if measured else mv.Reading(odometry_from_truth=True, odometry_seed=draw)
            mv.convert(drive, log.parent, reading=reading)
            first = next(moment.truth for moment in open_session(log).moments() if moment.truth is not None)
            header, _, records = log.read_text().partition("\n")
            begun = json.dumps({**json.loads(header), "start": first.tolist()})
            log.write_text(f"{begun}\n{records}")
        logs.append(log)
    return tuple(logs)


def recall_table(ways: Sequence[Way]) -> Iterator[str]:
    """Yield recall at 1 and 5 in % and the area under precision over recall, a line for each way."""
    titles = ("", "references", "pictures", *(f"`{feature}`" for feature in FEATURES))
    yield f"| {' | '.join(titles)} |"
    yield f"|{'---|' * len(titles)}"
    for way in ways:
        checks = [mv.check_library(way.library, feature=feature, drive=way.drive) for feature in FEATURES]
        figures = [_recall(check.found) for check in checks if check.found is not None]
        pictures = checks[0].found.right if checks[0].found else 0
        yield f"| {' | '.join((way.name, str(checks[0].library.size), str(pictures), *figures))} |"


def _recall(found: PlaceRecognition) -> str:
    first = found.ways[0]
    return f"{100 * first.recall[1].value:.0f}, {100 * first.recall[5].value:.0f}, {first.area.value:.2f}"


def plan_of(ways: Sequence[Way], seeds: int) -> Plan:
    """Return the plan of all filters over all draws, from the known start and from anywhere."""
    if not ways:
        raise InputError(None, "found no set, expected folders with survey and drive, or with a poses.csv")
    listed = Variants(listed=tuple(Variant(label, dict(settings)) for label, settings in FILTERS.items()))
    parts = tuple(Part(name, name, _sessions(ways, start), listed, seeds) for name, start in STARTS.items())
    return Plan("recordings", "Filters on real recordings", parts)


def _sessions(ways: Sequence[Way], start: str) -> tuple[SessionSpec, ...]:
    return tuple(
        SessionSpec(f"{way.name}: {draw}", path=str(log), library=str(way.library), start=start)
        for way in ways
        for draw, log in enumerate(way.draws)
    )


def error_table(rows: pl.DataFrame) -> Iterator[str]:
    """Yield mean errors in m and, in %, updates that are wrong and confident, by way and start."""
    for problem, count in rows["error"].drop_nulls().value_counts().iter_rows():
        yield f"{count} runs failed: {problem}"
    rows = rows.filter(pl.col("error").is_null()).with_columns(pl.col("session").str.split(": ").list.first())
    titles = (
        "",
        "nearest reference",
        *(f"{name}: {label}" for name in ("known", "anywhere") for label in FILTERS),
    )
    yield f"| {' | '.join(titles)} |"
    yield f"|{'---|' * len(titles)}"
    for (way,), of_way in rows.group_by("session", maintain_order=True):
        cells = [str(way), f"{of_way['oracle_m'].mean():.2f}"]
        for (_, _), runs in of_way.group_by("part", "label", maintain_order=True):
            cells.append(_errors(runs))
        yield f"| {' | '.join(cells)} |"


def _errors(runs: pl.DataFrame) -> str:
    wrong = 100 * float(np.mean(runs["wrong_confident"].to_numpy()))
    return f"{float(np.mean(runs['error_mean_m'].to_numpy())):.2f} ({wrong:.0f})"


def _progress(done: int, total: int) -> None:
    print(f"\r{done:,} of {total:,} runs", end="" if done < total else "\n", file=sys.stderr, flush=True)


if __name__ == "__main__":
    main()
