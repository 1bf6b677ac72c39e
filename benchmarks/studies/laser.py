"""A laser on recorded drives: tracking, found from anywhere, found again after it was carried off.

The drives are a user's own: logs with scans, odometry and corrected poses (CARMEN's, or bags with a truth).
Maps are made of their scans: of all, or of the first half of a drive, and then its second half is driven.
The corrected poses were made of the same scans, so the numbers flatter every filter alike. One configuration
serves all drives. The drives are the sample: intervals are over logs, and over the runs of a single one.

Run: make laser LOGS=DIR, or python -m benchmarks.studies.laser DIR [-o OUT] [--seeds N] [--workers N]; it
goes on where it stopped.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from maurice_datasets.trials.engine import run_plan
from maurice_datasets.trials.plan import Part, Plan, SessionSpec, Variant, Variants, reading_text
from maurice_datasets.trials.rows import read_rows
from maurice_datasets.trials.statistics import Clusters, mean, share
from maurice_loaders.errors import InputError
from maurice_loaders.formats.registry import open_session
from maurice_loaders.reading.options import Reading
from maurice_mcl.config.parameters import ALPHAS
from maurice_mcl.values.arrays import F64, Bool

STARTS, TRACKED = 20, 3  # runs a log: from anywhere and carried off, and of whole drives
RIGHT_M, RIGHT_RAD = 0.5, np.radians(20)
AFTER = (1, 2, 3, 5)  # scans
WITHIN = 3  # scans in which a robot should be found
CARRIED_AT, CARRIED_FOR = 10, 25  # update at which the robot is elsewhere, and updates in all
LEFT = 0.5  # of the beams end in mapped space: with less, the robot has left the mapped part
LOST_M = 0.9
ENDINGS = ("*.log.gz", "*.log", "*.bag", "*.mcap", "*.clf", "*.clf.gz")

OURS: Mapping[str, Any] = {"preset": "laser"}
NAV2: Mapping[str, Any] = {"preset": "amcl"}
# AMCL as tuned for logs whose scans are 0.7 to 1 m apart
TUNED: Mapping[str, Any] = {
    "preset": "amcl",
    "sensor.laser.model": "likelihood_field_prob",
    "motion": {"model": "odometry", **dict.fromkeys(ALPHAS, 0.02)},
}
FILTERS = {"laser": OURS, "amcl, Nav2's defaults": NAV2, "amcl, prob, alphas .02": TUNED}


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.studies.laser", description=__doc__)
    parser.add_argument("logs", type=Path, nargs="+", help="recordings, or folders of them")
    parser.add_argument("-o", type=Path, default=Path("out/trials/laser"), dest="folder")
    parser.add_argument("--seeds", type=int, help="fewer runs")
    parser.add_argument("--workers", type=int, default=2)
    asked = parser.parse_args()
    try:
        plan = plan_of(list(_files(asked.logs))).with_seeds(asked.seeds)
        run_plan(plan, asked.folder, workers=asked.workers, resume=True, progress=_progress)
        rows = read_rows(asked.folder)
    except InputError as problem:
        sys.exit(str(problem))
    for error, count in rows["error"].drop_nulls().value_counts().iter_rows():
        print(f"{count} runs failed: {error}")
    print("\n".join(table(rows.filter(pl.col("error").is_null()))))


def plan_of(logs: Sequence[Path]) -> Plan:
    """Return the plan over some logs. InputError for none."""
    if not logs:
        raise InputError(None, f"found no log, expected {', '.join(ENDINGS)} with scans and true poses")
    anywhere: dict[str, Any] = {"start": "anywhere", "stretch": max(AFTER)}
    carried: dict[str, Any] = {"stretch": CARRIED_FOR, "kidnap_at": CARRIED_AT}
    kinds: list[tuple[str, dict[str, Any], int, int]] = [
        ("tracking", {}, 2000, TRACKED),
        ("anywhere", anywhere, 5000, STARTS),
        ("carried off", carried, 5000, STARTS),
    ]
    parts = [
        _part(name, logs, mapped, how, particles, seeds)
        for mapped in ("all", "first half")
        for name, how, particles, seeds in kinds
    ]
    return Plan("laser", "A laser on recorded drives", tuple(parts))


def _part(
    name: str, logs: Sequence[Path], mapped: str, how: Mapping[str, Any], particles: int, seeds: int
) -> Part:
    sessions = tuple(
        SessionSpec(_name(log), path=str(log), mapped=mapped, reading=_reading(log), **how) for log in logs
    )
    listed = tuple(
        Variant(label, {**settings, "particles": particles, "resampling.kld.most": particles})
        for label, settings in FILTERS.items()
    )
    return Part(
        f"{name}, map of {mapped}", f"{name}, map of {mapped}", sessions, Variants(listed=listed), seeds
    )


def _files(given: Sequence[Path]) -> Iterator[Path]:
    """Yield the recordings among files, and in folders at any depth: bags of ROS 2 are folders themselves."""
    for path in given:
        bags = {about.parent for about in path.rglob("metadata.yaml")} if path.is_dir() else {path}
        files = {file for end in ENDINGS for file in path.rglob(end) if file.parent not in bags}
        yield from sorted(bags | files)


def _name(log: Path) -> str:
    return log.name.split(".")[0].removesuffix("-corrected")


def _reading(log: Path) -> str:
    """Return how a log is read: where its odometry is its truth some is made, with noise."""
    repeats = any("odometry_from_truth" in remark for remark in open_session(log).remarks)
    return reading_text(Reading(odometry_from_truth=repeats))


def _progress(done: int, total: int) -> None:
    print(f"\r{done:,} of {total:,} runs", end="" if done < total else "\n", file=sys.stderr, flush=True)


def table(rows: pl.DataFrame) -> Iterator[str]:
    """Yield one table as lines of Markdown: a line for each filter and what it did, a column for each log."""
    logs = rows["session"].unique().sort().to_list()
    yield f"| {' | '.join(('', *logs, f'all {len(logs)}', 'also'))} |"
    yield f"|{'---|' * (len(logs) + 3)}"
    for label in FILTERS:
        for (part,), of_part in rows.filter(pl.col("label") == label).group_by("part", maintain_order=True):
            measure, title = MEASURES[str(part).split(",")[0]]
            by_log = [of_part.filter(pl.col("session") == log) for log in logs]
            cells = [measure(of_log)[0] if len(of_log) else "-" for of_log in by_log]
            yield f"| {' | '.join((f'`{label}`, {part}: {title}', *cells, *measure(of_part)))} |"


def _tracking(rows: pl.DataFrame) -> tuple[str, str]:
    """Return the mean error where the map is known; the share of updates lost, and off the mapped part."""
    off, turned, mapped = (_lists(rows, name) for name in ("error_m", "heading_error_rad", "mapped"))
    known = [share >= LEFT for share in mapped]
    known_off = [o[k] for o, k in zip(off, known, strict=True)]
    errors, lost = [float(o.mean()) for o in known_off], np.concatenate(known_off) > LOST_M
    left = 1 - np.concatenate(known).mean()
    median = np.degrees(np.median(np.concatenate([t[k] for t, k in zip(turned, known, strict=True)])))
    figure = mean(np.array(errors), _clusters(rows))
    also = (
        f"lost {100 * lost.mean():.1f} %, heading {median:.2f} deg, left the mapped part {100 * left:.0f} %"
    )
    return _text(figure.text(1, 3), rows), also


def _anywhere(rows: pl.DataFrame) -> tuple[str, str]:
    """Return how often a robot that began anywhere is right at the third scan; and after each of some."""
    right = _right(rows)
    also = ", ".join(f"{100 * np.mean([flags[k - 1] for flags in right]):.0f}" for k in AFTER)
    flags = np.array([flags[WITHIN - 1] for flags in right])
    return _rate(flags, rows), f"after {', '.join(map(str, AFTER))} scans: {also} %"


def _carried(rows: pl.DataFrame) -> tuple[str, str]:
    """Return how often a robot that was carried off is right within three scans; and at the end."""
    after = [flags[CARRIED_AT - 1 :] for flags in _right(rows)]
    found, end = (
        np.array([flags[part].any() for flags in after]) for part in (slice(WITHIN), slice(-1, None))
    )
    first = [int(flags.argmax()) + 1 if flags.any() else CARRIED_FOR for flags in after]
    return _rate(
        found, rows
    ), f"median {np.median(first):.0f} scans; right at the end {100 * end.mean():.0f} %"


Measure = Callable[[pl.DataFrame], tuple[str, str]]
MEASURES: Mapping[str, tuple[Measure, str]] = {
    "tracking": (_tracking, "mean position error (m) where half of the beams end in mapped space"),
    "anywhere": (_anywhere, f"right (0.5 m, 20 degrees) at scan {WITHIN} (%)"),
    "carried off": (_carried, f"right again within {WITHIN} scans (%)"),
}


def _lists(rows: pl.DataFrame, name: str) -> list[F64]:
    return [np.array(values, np.float64) for values in rows[name].to_list()]


def _right(rows: pl.DataFrame) -> list[Bool]:
    """Return for each run which of its updates are right."""
    both = zip(_lists(rows, "error_m"), _lists(rows, "heading_error_rad"), strict=True)
    return [(off_m < RIGHT_M) & (off_rad < RIGHT_RAD) for off_m, off_rad in both]


def _clusters(rows: pl.DataFrame) -> Clusters:
    """Return which runs are alike: those of a log; of a single log every run counts."""
    return Clusters.of(rows["session"].to_list(), rows["session"].to_list(), rows["seed"].to_list())


def _rate(flags: Bool, rows: pl.DataFrame) -> str:
    return _text(share(flags, _clusters(rows)).text(100, 0), rows)


def _text(figure: str, rows: pl.DataFrame) -> str:
    """Leave the interval of a single log out: it is of its runs, and tells nothing of other logs."""
    return figure if rows["session"].n_unique() > 1 else figure.split(" (")[0]


if __name__ == "__main__":
    main()
