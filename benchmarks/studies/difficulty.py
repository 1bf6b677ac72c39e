"""How hard is the simulated arena? Retrieval, the thesis's filter and two controls, on fitting drives.

For each tier, arena seed = seed = 1, 2, 3, ...: position tracking of 120 updates in `two-rooms`. Retrieval by
raw color (the thesis's distance): the rank of the reference nearest to the truth, the 5th and 95th percentile
of all qualities, the gap from the best to the fifth, and how much better references in the same room are.
Then the thesis's filter (the preset, 2,000 particles) with color and with edges blended in, without a sensor,
and with the references' poses shuffled, which must both do worse.

Run: make studies STUDIES=difficulty (a quarter of an hour for 20 drives per tier; it goes on where it
stopped).
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

import maurice_loaders as ml
import maurice_mcl as mcl
from maurice_datasets.sessions import write_simulation
from maurice_datasets.simulation import SimulationPlan
from maurice_datasets.tasks import GENERATOR, TASKS, TIERS
from maurice_datasets.trials.statistics import mean
from maurice_datasets.worlds.world import inside
from maurice_loaders.files.writing import cache_root
from maurice_mcl.values.arrays import F64, Bool
from maurice_mcl.values.map import Arena

from .lost_drives import for_fitting

INCH_M = 0.0254


@dataclass(frozen=True)
class Result:
    """One drive, inches and shares."""

    rank: float
    low: float
    high: float
    top_five: float
    room_step: float
    oracle: float
    color: float
    color_lost: bool
    blended: float
    blended_lost: bool
    no_sensor: float
    shuffled: float


def rooms_of(arena: Arena, points: F64) -> F64:
    """Return the number of the room (K,) that each point (K, 2) is in; -1 for none."""
    rooms = np.full(len(points), -1.0)
    for number, room in enumerate(arena.rooms):
        rooms[inside(room.polygon, points)] = number
    return rooms


def nearest_entry(localizer: mcl.Localizer, truth: F64) -> int:
    library = localizer.library
    local = np.array([[*(truth[:2] - library.origin), truth[2]]], np.float32)
    return int(localizer.reference.entries(local, library.origin)[0])


def thesis_filter(library: mcl.Library, channels: Sequence[str], sharpness: float) -> mcl.Localizer:
    """Return the preset "thesis" with channels at equal weights; sharpness 0 makes it blind."""
    own = {"sensor.weights": dict.fromkeys(channels, 1.0), "sensor.sharpness": sharpness}
    return mcl.make_localizer(library, preset="thesis", settings=own)


def tracked(
    session: mcl.Session, library: mcl.Library, channels: Sequence[str], sharpness: float = 1.0
) -> tuple[float, bool]:
    localizer = thesis_filter(library, channels, sharpness)
    score = mcl.score(mcl.run(localizer, session))
    return (score.error_mean_m or 0.0) / INCH_M, bool(score.lost)


def retrieval(session: mcl.Session, library: mcl.Library) -> dict[str, float]:
    localizer = thesis_filter(library, ["color"], 1.0)
    rooms = rooms_of(library.arena, library.poses[:, :2])
    rows = []
    for moment, record in mcl.run(localizer, session):
        assert moment.truth is not None
        quality = record.sighting.comparison.quality.astype(np.float64)
        entry = nearest_entry(localizer, moment.truth)
        best = np.sort(quality)[::-1]
        same: Bool = rooms == rooms_of(library.arena, moment.truth[None, :2])[0]
        distance_m = np.linalg.norm(library.poses[:, :2] - moment.truth[:2], axis=1).min()
        rows.append(
            [
                float((quality > quality[entry]).sum() + 1),
                *np.percentile(quality, (5, 95)),
                best[0] - best[4],
                quality[same].mean() - quality[~same].mean() if same.any() else np.nan,
                distance_m / INCH_M,
            ]
        )
    middle = np.nanmedian(rows, axis=0)
    names = ("rank", "low", "high", "top_five", "room_step")
    return dict(zip(names, middle[:5].tolist(), strict=True)) | {"oracle": float(np.mean(rows, axis=0)[5])}


def measure(tier: str, seed: int) -> Result:
    folder = cache_root() / "difficulty" / f"{GENERATOR}-{tier}-{for_fitting(seed)}"
    if not folder.exists():
        write_simulation(folder, SimulationPlan(TASKS["tracking"], tier=tier, arena_seed=seed, seed=seed))
    session = ml.open_session(folder / "session.log")
    assert session.info.survey is not None
    library = ml.open_library(session.info.survey)
    order = np.random.default_rng(seed).permutation(library.size)
    color, color_lost = tracked(session, library, ["color"])
    blended, blended_lost = tracked(session, library, ["color", "edges"])
    return Result(
        **retrieval(session, library),
        color=color,
        color_lost=color_lost,
        blended=blended,
        blended_lost=blended_lost,
        no_sensor=tracked(session, library, ["color"], 0.0)[0],
        shuffled=tracked(session, replace(library, poses=library.poses[order]), ["color"])[0],
    )


def results(tier: str, drives: int, kept: Path) -> Iterator[Result]:
    """Return the results of a tier, measuring those that are not kept yet."""
    lines = kept.read_text(encoding="utf-8").splitlines() if kept.exists() else []
    known = {entry["key"]: entry["result"] for entry in map(json.loads, lines)}
    for seed in range(1, drives + 1):
        key = f"{GENERATOR} {tier} {seed} preset"
        if key not in known:
            known[key] = asdict(measure(tier, seed))
            with kept.open("a", encoding="utf-8") as file:
                file.write(json.dumps({"key": key, "result": known[key]}) + "\n")
        yield Result(**known[key])


def interval(values: list[float]) -> str:
    """Return the mean with its interval of 95 percent over drives, each in an arena of its own."""
    return mean(np.array(values)).text()


def row(tier: str, found: list[Result]) -> str:
    ranks = [r.rank for r in found]
    low, high = np.mean([r.low for r in found]), np.mean([r.high for r in found])
    return (
        f"| {tier} | {np.median(ranks):g} ({min(ranks):g} to {max(ranks):g}) | {low:.2f} to {high:.2f} "
        f"| {np.mean([r.top_five for r in found]):.3f} | {np.mean([r.room_step for r in found]):.2f} "
        f"| {interval([r.color for r in found])}, {sum(r.color_lost for r in found)} "
        f"| {interval([r.blended for r in found])}, {sum(r.blended_lost for r in found)} "
        f"| {np.mean([r.no_sensor for r in found]):.1f} | {np.mean([r.shuffled for r in found]):.1f} "
        f"| {np.mean([r.oracle for r in found]):.1f} |"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--drives", type=int, default=20)
    drives = parser.parse_args().drives
    kept = cache_root() / "difficulty" / "results.jsonl"
    kept.parent.mkdir(parents=True, exist_ok=True)
    print(f"{drives} drives per tier; errors are inches, then how many drives were lost")
    print("| tier | rank | qualities | best to fifth | same room", end=" ")
    print("| color | blended | no sensor | shuffled | oracle |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    for tier in TIERS:
        print(row(tier, list(results(tier, drives, kept))), flush=True)


if __name__ == "__main__":
    main()
