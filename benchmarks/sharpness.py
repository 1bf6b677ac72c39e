"""How sharp should the likelihood be? Measured on fitting drives, none of which is the demo's.

For each sharpness and feature: the log score (mean log of the probability that a picture alone gives the
truth's own reference, when any reference is as likely before; higher is better), and what the filter then
does with 2,000 particles on the same drives. Seeds 1 to 6 redraw arena, survey and drive; the demo's is 0.
Run: .venv/bin/python benchmarks/sharpness.py (about two minutes the first time).
"""

from __future__ import annotations

import argparse

import numpy as np

from maurice_datasets.maurice import demo_paths
from maurice_loaders.library_store import open_library
from maurice_loaders.session_log import SessionLog
from maurice_mcl.localizer import Localizer, make_localizer, run
from maurice_mcl.metrics import RunScore, Scorer
from maurice_mcl.records import Sighting
from maurice_mcl.typing import F64

SHARPNESS = (1.0, 2.0, 4.0, 8.0, 12.0, 16.0, 24.0, 32.0, 48.0)
INCH_M = 0.0254


def true_entry(localizer: Localizer, truth: F64) -> int:
    library = localizer.library
    local = np.array([[*(truth[:2] - library.origin), truth[2]]], np.float32)
    return int(localizer.reference.entries(local, library.origin)[0])


def log_scores(sighting: Sighting, entry: int) -> F64:
    """Log p(true entry | picture) for every sharpness, with a floor of 1e-6 of probability elsewhere."""
    with np.errstate(divide="ignore"):
        log_quality = np.log(sighting.quality.astype(np.float64))
    logits = np.outer(SHARPNESS, log_quality)
    probability = np.exp(logits - logits.max(axis=1, keepdims=True))
    probability /= probability.sum(axis=1, keepdims=True)
    return np.log(np.maximum(probability[:, entry], 1e-6))


def drive(seed: int, feature: str, sharpness: float) -> tuple[RunScore, F64]:
    paths = demo_paths(seed)
    session = SessionLog(paths.session)
    library = open_library(paths.survey)
    localizer = make_localizer(library, session, feature=feature, sharpness=sharpness)
    scorer, scores = Scorer(), []
    for moment, record in run(localizer, session, session.info.start):
        scorer.add(record.estimate, moment.truth, moment.frame.motions)
        assert moment.truth is not None
        scores.append(log_scores(record.sighting, true_entry(localizer, moment.truth)))
    return scorer.result(), np.mean(scores, axis=0)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--drives", type=int, default=6)
    seeds = range(1, parser.parse_args().drives + 1)
    for feature in ("color", "edges", "blended"):
        print(f"\n{feature}\nsharpness  log score  mean error (in)  lost  localized  wrong and confident")
        for place, sharpness in enumerate(SHARPNESS):
            results = [drive(seed, feature, sharpness) for seed in seeds]
            scores = [score for score, _ in results]
            log_score = np.mean([s[place] for _, s in results])
            error = np.mean([s.position_error_mean_m or np.nan for s in scores]) / INCH_M
            lost = sum(bool(s.lost) for s in scores)
            localized = np.mean([s.localized_share or 0 for s in scores])
            wrong = np.mean([s.wrong_confident_share or 0 for s in scores])
            shares = f"{localized:9.0%}  {wrong:8.1%}"
            print(f"{sharpness:9.0f}  {log_score:9.3f}  {error:15.1f}  {lost:4d}  {shares}")


if __name__ == "__main__":
    main()
