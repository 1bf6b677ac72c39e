"""The results table: every task and tier of docs/evaluation.md on unseen arenas, with intervals.

Arena seeds 1000 to 1009, a separate drive seed for every drive; nothing was fitted on any of them, and one
configuration serves all tiers. Errors are inches: mean over drives with a 95 percent bootstrap interval, by
arena, then drive. Rates have Wilson intervals. Beside every error stands its ratio to the nearest-node
oracle's on the same drives, which always knows the nearest reference.

Run: make results (hours for 300 drives per tier; it goes on where it stopped, and prints what there is).
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import cv2
import numpy as np
from results_table import ARENAS, TIERS, Case, show

import maurice_datasets as md
import maurice_loaders as ml
import maurice_mcl as mcl
from maurice_datasets.render.conditions import LightChange
from maurice_datasets.sessions import simulated_session
from maurice_datasets.simulation import SimulationPlan
from maurice_datasets.surveys import cached_survey
from maurice_datasets.tasks import GENERATOR, TASKS, for_testing
from maurice_loaders.files import cache_root
from maurice_mcl.analysis.metrics import RunScore, Scorer, score_step
from maurice_mcl.config.build import build_localizer
from maurice_mcl.config.parameters import Layer, configure
from maurice_mcl.sensor.descriptors.registry import FEATURES
from maurice_mcl.sensor.references import nearest_reference
from maurice_mcl.session import SessionInfo
from maurice_viz.playback import FilterRun, run_together

INCH_M = 0.0254
KIDNAP_AT, KIDNAP_UPDATES = 30, 60
DRIVES_AT_ONCE = 5


COLOR = {"sensor.weights": dict(FEATURES["color"])}
EDGES = {"sensor.weights": dict(FEATURES["edges"])}
BLENDED = {"sensor.weights": dict(FEATURES["blended"])}
MISJUDGED = "best, 1,000, motion constants +30 %"
ROBUST = dict(mcl.PRESETS["robust"])
FILTERS: Mapping[str, Mapping[str, Any]] = {
    "thesis": mcl.PRESETS["thesis"],
    "thesis, blended": {**mcl.PRESETS["thesis"], "sensor.weights": {"color": 1.0, "edges": 1.0}},
    "thesis, plain L1": {**mcl.PRESETS["thesis"], "sensor.distances": {"color": "l1"}},
    "refined": mcl.PRESETS["refined"],
    "color": COLOR,
    "color, surveyed references only": {**COLOR, "references.interpolation.virtual": False},
    "edges": EDGES,
    "blended": BLENDED,
    "best, 1,000, surveyed references only": {
        **ROBUST,
        "particles": 1000,
        "recovery.strategy": "none",
        "references.interpolation.virtual": False,
    },
    "best, 1,000": {**ROBUST, "particles": 1000, "recovery.strategy": "none"},
    MISJUDGED: {**ROBUST, "particles": 1000, "recovery.strategy": "none"},
    "robust, 1,000": {**ROBUST, "particles": 1000},
    "robust, 100": {**ROBUST, "particles": 100},
    "robust, 5,000": {**ROBUST, "particles": 5000},
    "no sensor": {**COLOR, "sensor.sharpness": 0.0},
    "shuffled": COLOR,
}
TRACKING = tuple(name for name in FILTERS if name != "robust, 5,000")
CASES = (
    *(Case(name, "tracking", tier) for tier in TIERS for name in TRACKING),
    *(Case("robust, 5,000", "global", tier) for tier in TIERS),
    *(Case("robust, 1,000", "kidnapped", tier) for tier in TIERS),
    *(Case("best, 1,000", "tracking", "nominal", light) for light in (1.3, 0.73)),
)


def plan_of(case: Case, drive: int) -> SimulationPlan:
    """Return the session of a case's drive; one arena in ten drives."""
    kidnapped = case.task == "kidnapped"
    plan = SimulationPlan(
        TASKS[case.task],
        tier=case.tier,
        arena_seed=for_testing(1000 + drive % ARENAS),
        seed=for_testing(1000 + drive),
        lights=() if case.light == 1 else (LightChange("dim", 1, amount=case.light),),
    )
    return replace(plan, updates=KIDNAP_UPDATES, kidnap_at=KIDNAP_AT) if kidnapped else plan


@dataclass(frozen=True)
class Kept:
    """A session's moments, held for all the filters that are to see them."""

    info: SessionInfo
    all_moments: Sequence[mcl.Moment]

    def moments(self) -> Iterator[mcl.Moment]:
        return iter(self.all_moments)


def misjudged(motion: Mapping[str, Any]) -> dict[str, Any]:
    """Return motion constants that are all 30 percent too large, as of a robot that was badly calibrated."""
    return {
        key: misjudged(value) if isinstance(value, Mapping) else value * 1.3 if key != "model" else value
        for key, value in motion.items()
    }


@lru_cache(2)
def library_of(world_name: str, arena_seed: int, tier: str) -> mcl.Library:
    world = md.load_world(world_name, arena_seed, tier)
    return ml.open_library(cached_survey(world, arena_seed, lambda done, total, what: None) / "survey.log")


def measure(cases: Sequence[Case], drive: int) -> Iterator[tuple[Case, dict[str, Any]]]:
    """Run all cases that share a session on one drive."""
    plan = plan_of(cases[0], drive)
    simulated, library = simulated_session(plan), library_of(plan.world, plan.arena_seed, plan.tier)
    session = Kept(simulated.info, list(simulated.moments()))
    nearest = nearest_reference(library.poses, library.arena)
    order = np.random.default_rng(drive).permutation(library.size)
    runs = []
    for case in cases:
        parameters = configure([Layer(case.name, FILTERS[case.name])]).parameters
        if case.name == MISJUDGED:
            parameters = replace(parameters, motion=misjudged(session.info.motion))
        used = replace(library, poses=library.poses[order]) if case.name == "shuffled" else library
        shared = None if case.name == "shuffled" else nearest
        localizer = build_localizer(used, session, parameters, reference=shared)
        runs.append(FilterRun(case.name, localizer, session.info.start))
    yield from zip(cases, scored(runs, session, library, cases[0].task), strict=True)


def scored(runs: Sequence[FilterRun], session: Kept, library: mcl.Library, task: str) -> list[dict[str, Any]]:
    """Run filters side by side and score each."""
    scorers = {run.label: Scorer() for run in runs}
    localized: dict[str, list[bool]] = {run.label: [] for run in runs}
    oracle = []
    for moment, records in run_together(runs, session.moments()):
        assert moment.truth is not None
        oracle.append(np.linalg.norm(library.poses[:, :2] - moment.truth[:2], axis=1).min())
        for label, record in records.items():
            scorers[label].add(record.estimate, moment.truth, moment.frame.motions)
            localized[label].append(bool(score_step(record.estimate, moment.truth).localized))
    since = KIDNAP_AT if task == "kidnapped" else 0
    return [
        row_of(scorers[run.label].result(), localized[run.label][since:], float(np.mean(oracle[3:])))
        for run in runs
    ]


def row_of(score: RunScore, localized: Sequence[bool], oracle_m: float) -> dict[str, Any]:
    """Return one run's figures, lengths in inches, angles in degrees."""
    return {
        "error": (score.position_error_mean_m or 0.0) / INCH_M,
        "heading": float(np.degrees(score.heading_error_mean_rad or 0.0)),
        "lost": bool(score.lost),
        "right": bool(score.right_at_end),
        "wrong": score.wrong_confident_share,
        "took": first_of(localized),
        "oracle": oracle_m / INCH_M,
    }


def first_of(localized: Sequence[bool]) -> int | None:
    """Return how many pictures until localized in at least four of the five updates that start there."""
    for k in range(len(localized) - 4):
        if localized[k] and sum(localized[k : k + 5]) >= 4:
            return k + 1
    return None


def frozen() -> str:
    """Return a hash of every configuration in the table."""
    values = {name: configure([Layer(name, layer)]).values() for name, layer in FILTERS.items()}
    return hashlib.sha256(json.dumps(values, sort_keys=True, default=dict).encode()).hexdigest()[:12]


PAIRS = (
    ("thesis, blended", "thesis"),
    ("blended", "color"),
    ("blended", "edges"),
    ("thesis, plain L1", "thesis"),
    ("refined", "thesis"),
    ("color", "thesis"),
    ("color", "color, surveyed references only"),
    ("best, 1,000", "blended"),
    ("best, 1,000", "best, 1,000, surveyed references only"),
    (MISJUDGED, "best, 1,000"),
    ("robust, 1,000", "best, 1,000"),
)


def measured_on(asked: tuple[Sequence[Case], int]) -> tuple[int, list[tuple[Case, dict[str, Any]]]]:
    """Run some cases on one drive, in a process of its own."""
    return asked[1], list(measure(*asked))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--drives", type=int, default=300)
    parser.add_argument("--workers", type=int, default=os.cpu_count(), help="processes at once")
    parser.add_argument("--only", default="", metavar="TEXT", help="only cases whose key contains it")
    parser.add_argument("--show", action="store_true", help="only print what there is")
    arguments = parser.parse_args()
    kept = cache_root() / "results" / f"{GENERATOR}-{frozen()}.jsonl"
    kept.parent.mkdir(parents=True, exist_ok=True)
    lines = kept.read_text(encoding="utf-8").splitlines() if kept.exists() else []
    known = {(entry["case"], entry["drive"]): entry["result"] for entry in map(json.loads, lines)}
    together: dict[tuple[str, str, float], list[Case]] = {}
    for case in CASES:
        together.setdefault((case.task, case.tier, case.light), []).append(case)
    wanted = []
    for drive in range(0 if arguments.show else arguments.drives):
        for cases in together.values():
            asked = [case for case in cases if arguments.only in case.key]
            missing = [case for case in asked if (case.key, drive) not in known]
            if missing:
                wanted.append((missing, drive))
    # Drives of one arena in a row: a worker lights it and reads its library once. A hundred drives at a time.
    wanted.sort(key=lambda work: (work[1] // 100, work[0][0].tier, work[1] % ARENAS))
    with ProcessPoolExecutor(arguments.workers, initializer=cv2.setNumThreads, initargs=(1,)) as pool:
        for drive, found in pool.map(measured_on, wanted, chunksize=DRIVES_AT_ONCE):
            known |= {(case.key, drive): result for case, result in found}
            with kept.open("a", encoding="utf-8") as file:
                for case, result in found:
                    file.write(json.dumps({"case": case.key, "drive": drive, "result": result}) + "\n")
    print(f"configurations {frozen()}, generator {GENERATOR}")
    show(CASES, PAIRS, known)


if __name__ == "__main__":
    main()
