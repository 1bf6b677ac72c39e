"""Does it help to add the references that `library check` asks for? Asked before, and tried by simulation.

    python -m benchmarks.studies.library_doctor [--quick]

On unseen arenas some references are left out of a survey: those in a disc of floor, or three of eight
headings in it. Those that `library check` asks for are taken by the simulated surveyor and added; as a
control, as many at random free places. Drives search globally; errors count where the robot is inside the
disc. The third case leaves nothing out: its references part places that are confused. Differences are paired
by drive, with intervals that draw arenas first. The table is in docs/library.md.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from maurice_datasets.render.camera_session import survey_camera
from maurice_datasets.surveys import LATER, Surveyor, references
from maurice_datasets.trials.drives import Bench, Drive, open_drive, world_of
from maurice_datasets.trials.plan import SessionSpec
from maurice_datasets.trials.statistics import Clusters, Interval, mean
from maurice_mcl.library.advice import AMBIGUITY, LibraryAdvice, advise, headings, without_reference
from maurice_mcl.library.left_out import LeftOutTable
from maurice_mcl.library.quality import DIRECTIONS, SelfSimilarity, free_space, self_similarity_of
from maurice_mcl.scoring.batch import run_batch
from maurice_mcl.sensor.descriptors.registry import CHANNELS, FEATURES
from maurice_mcl.sensor.model import SensorModel, SensorParameters
from maurice_mcl.sensor.references import nearest_reference
from maurice_mcl.values.arrays import F64, Bool
from maurice_mcl.values.geometry import INCH_M
from maurice_mcl.values.library import ChannelIndex, Library

ARENAS, DRIVES, SEEDS, UPDATES = 5, 2, 4, 50
RADIUS_M = 36 * INCH_M  # of the disc
SEARCH = 20  # updates that do not count
REACH_M = 18 * INCH_M  # the survey's spacing
CASES = ("disc", "headings", "confused")
KINDS = ("left out", "asked for", "random")
NEEDED = FEATURES["blended"]


@dataclass(frozen=True)
class Measured:
    """One drive with one library, the mean over seeds; inside the disc, after the search."""

    error_m: float
    correct: float
    ambiguity: float  # of the library there: places that fit a picture
    lacking: float  # share of floor and headings there without a reference


def subset(library: Library, kept: Bool) -> Library:
    index = {name: replace(entry, references=entry.references[kept]) for name, entry in library.index.items()}
    pictures = tuple(entry for entry, keep in zip(library.pictures, kept, strict=True) if keep)
    return replace(library, poses=library.poses[kept], pictures=pictures, index=index)


def with_poses(library: Library, poses: F64, arena: int) -> Library:
    """Return a library with references taken by the simulated surveyor at poses (L, 3)."""
    camera = survey_camera(world_of("two-rooms", arena, "nominal"), arena)
    taken = list(references(poses, camera, Surveyor(), LATER))
    index = {}
    for name in NEEDED:
        entry = library.index[name]
        rows = np.array([CHANNELS[name].describe(picture) for _, picture in taken], np.float32)
        both = np.vstack([entry.references, rows.reshape(-1, entry.references.shape[1])])
        index[name] = ChannelIndex(both, entry.noise_floor, both.max(axis=0))
    joined = np.vstack([library.poses, poses])
    return replace(library, poses=joined, pictures=(None,) * len(joined), index=index)


def checked(library: Library) -> tuple[SelfSimilarity, LibraryAdvice]:
    nearest = nearest_reference(library.poses, library.arena)
    sensor = SensorModel(library, nearest, SensorParameters(dict(NEEDED)))
    similarity = self_similarity_of(LeftOutTable.of(sensor))
    return similarity, advise(library, similarity)


def inside(points: F64, center: F64) -> Bool:
    return np.hypot(*(points[:, :2] - center).T) <= RADIUS_M


def libraries(case: str, full: Library, center: F64, arena: int) -> dict[str, Library]:
    """Return the library of each kind."""
    there = inside(full.poses, center)
    degrees = np.round(np.degrees(full.poses[:, 2])) % 360
    gone = {"disc": there, "headings": there & np.isin(degrees, [0, 45, 90]), "confused": there & False}
    left = subset(full, ~gone[case])
    _, advice = checked(left)
    wanted = [entry for entry in advice.added if (entry.why == AMBIGUITY) == (case == "confused")]
    poses = np.array([entry.pose for entry in wanted])
    grid, free, _ = free_space(left)
    rng, cells = np.random.default_rng(arena), grid.centers()[free.ravel()]
    chosen = cells[rng.choice(len(cells), -(-len(poses) // DIRECTIONS))]
    random = np.column_stack([chosen.repeat(DIRECTIONS, axis=0), np.tile(headings(), len(chosen))])
    libraries_ = {KINDS[0]: left, KINDS[1]: with_poses(left, poses, arena)}
    return libraries_ if case == "confused" else libraries_ | {KINDS[2]: with_poses(left, random, arena)}


def measured(drive: Drive, library: Library, found: SelfSimilarity, center: F64) -> Measured | None:
    """Return the figures of a drive; None for one that does not pass the disc."""
    moments = list(drive.session.moments())
    truths = np.array([moment.truth for moment in moments])
    counts = inside(truths, center) & (np.arange(len(moments)) >= SEARCH)
    if not counts.any():
        return None
    localizer = Bench.of(library).localizer({}).of_session(drive.session)
    runs_ = run_batch(localizer, moments, range(SEEDS), drive.start)
    near = inside(found.places, center)
    grid, free, _ = free_space(library)
    cells = grid.centers()[free.ravel()]
    lacking = without_reference(cells[inside(cells, center)], library.poses, REACH_M)
    return Measured(
        float(np.mean([run.error_m[counts].mean() for run in runs_])),
        float(np.mean([run.is_localized[counts].mean() for run in runs_])),
        float(found.at_places(found.ambiguity)[near].mean()) if near.any() else np.nan,
        float(lacking.mean()),
    )


def runs(arenas: int, drives: int) -> Iterator[tuple[str, str, int, int, Measured, int]]:
    """Yield case, kind, arena, drive, figures, and how many references were added."""
    spec = SessionSpec("doctor", "global", updates=UPDATES, arenas=arenas)
    for arena in range(arenas):
        some = [open_drive(spec, arena + arenas * k) for k in range(drives)]
        full, seed = some[0].bench.library, some[0].arena or 0
        full = replace(full, index={name: full.index[name] for name in NEEDED})
        places = np.array([moment.truth for moment in some[0].session.moments()])
        center = places[UPDATES * 2 // 3, :2]  # where the first drive is late: others may pass, too
        for case in CASES:
            variants = libraries(case, full, center, seed)
            for kind, library in variants.items():
                added, (about, _) = library.size - variants[KINDS[0]].size, checked(library)
                for number, drive in enumerate(some):
                    figures = measured(drive, library, about, center)
                    if figures is not None:
                        yield case, kind, arena, number, figures, added


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true")
    asked = parser.parse_args()
    size = (2, 1) if asked.quick else (ARENAS, DRIVES)
    rows: dict[tuple[str, str], dict[tuple[int, int], tuple[Measured, int]]] = {}
    for case, kind, arena, number, found, added in runs(*size):
        rows.setdefault((case, kind), {})[arena, number] = (found, added)
        print(case, kind, arena, number, found, added, flush=True)
    show(rows)


def show(rows: dict[tuple[str, str], dict[tuple[int, int], tuple[Measured, int]]]) -> None:
    print(
        "| case | library | added | without a reference | places that fit | error (m) | localized | drives |"
    )
    print("|---|---|---|---|---|---|---|---|")
    figures = ("lacking", "ambiguity", "error_m", "correct")
    for (case, kind), found in rows.items():
        values = [column(found, name) for name in figures]
        added = np.mean([entry[1] for entry in found.values()])
        cells = " | ".join(f"{entry.value:.3f} ({entry.low:.3f} to {entry.high:.3f})" for entry in values)
        print(f"| {case} | {kind} | {added:.0f} | {cells} | {len(found)} |")
    for case in CASES:
        for kind in KINDS[1:]:
            before, after = rows.get((case, KINDS[0]), {}), rows.get((case, kind), {})
            for name in figures:
                gained = difference(before, after, name)
                print(f"{case}: {kind} less {KINDS[0]}, {name}: {gained}")


def column(found: dict[tuple[int, int], tuple[Measured, int]], name: str) -> Interval:
    values = np.array([getattr(entry[0], name) for entry in found.values()])
    known = np.isfinite(values)
    return mean(values[known], Clusters.of([key[0] for key in found])[known])


def difference(before: dict, after: dict, name: str) -> str:  # type: ignore[type-arg]
    keys = [key for key in before if key in after]
    pick = partial(getattr)
    values = np.array([pick(after[key][0], name) - pick(before[key][0], name) for key in keys])
    known = np.isfinite(values)
    if not known.any():
        return "-"
    entry = mean(values[known], Clusters.of([key[0] for key in keys])[known])
    return f"{entry.value:+.3f} ({entry.low:+.3f} to {entry.high:+.3f}), {entry.count} drives"


if __name__ == "__main__":
    main()
