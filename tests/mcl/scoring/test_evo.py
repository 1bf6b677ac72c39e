"""Trajectory errors against independent code: the commands `evo_ape` and `evo_rpe` of evo (Grupp 2017)."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import zipfile
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest

from maurice_mcl.config.build import build_localizer
from maurice_mcl.config.parameters import of_feature
from maurice_mcl.filter.localizer import run
from maurice_mcl.scoring.metrics import FIRST_SCORED, relative_error, score_step, score_table, segment_errors
from maurice_mcl.scoring.table import TableRows

EVO = Path(sys.executable).parent
SEGMENTS_M = (0.3, 1.1)


def _write_tum(path, times, poses):
    """Write poses in the plane as TUM trajectories have them: time, position, quaternion."""
    half = poses[:, 2] / 2
    zeros = np.zeros((len(poses), 3))
    rows = np.column_stack([times, poses[:, :2], zeros, np.sin(half), np.cos(half)])
    np.savetxt(path, rows, fmt="%.17g")


def _evo(folder, relation, command="evo_ape", *options):
    """Run the command, unaligned; give what it says of all errors together, and each error."""
    kept = folder / f"{relation}.zip"
    kept.unlink(missing_ok=True)
    files = ("tum", "truth.tum", "estimate.tum")
    command = [EVO / command, *files, "-r", relation, *options, "--save_results", kept]
    where = os.environ | {"HOME": str(folder), "MPLCONFIGDIR": str(folder), "NO_COLOR": "1"}
    done = subprocess.run(command, cwd=folder, env=where, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    with zipfile.ZipFile(kept) as parts:
        return json.loads(parts.read("stats.json")), np.load(BytesIO(parts.read("error_array.npy")))


@pytest.fixture(scope="module")
def scored(world_at, tmp_path_factory):
    """A run from nowhere, off by little and by much: the folder, our score of every step, and of the run."""
    folder = tmp_path_factory.mktemp("evo")
    world = world_at(updates=40)
    localizer = build_localizer(world.library, world.drive, of_feature("color", 300))
    rows, steps, times, estimates, truths = TableRows(), [], [], [], []
    for moment, record in run(localizer, world.drive, None):
        rows.add(moment, record)
        steps.append(score_step(record.estimate, moment.truth))
        times.append(moment.frame.time_s)
        estimates.append(record.estimate.pose)
        truths.append(moment.truth)
    _write_tum(folder / "estimate.tum", times, np.array(estimates))
    _write_tum(folder / "truth.tum", times, np.array(truths))
    return folder, steps, score_table(rows.table()), np.array(truths), np.array(estimates)


@pytest.mark.parametrize("relation", ["trans_part", "angle_deg"])
def test_errors_are_what_evo_finds(scored, relation):
    folder, steps, whole, _, _ = scored
    if relation == "trans_part":
        ours = np.array([step.error_m for step in steps])
        mean, median = whole.error_mean_m, whole.error_median_m
    else:
        ours = np.degrees([step.heading_error_rad for step in steps])
        mean, median = np.degrees(whole.heading_error_mean_rad), np.degrees(whole.heading_error_median_rad)
    stats, theirs = _evo(folder, relation)
    assert np.ptp(ours) > 0.5
    assert theirs == pytest.approx(ours, abs=1e-6)
    assert stats["mean"] == pytest.approx(ours.mean(), abs=1e-6)
    assert stats["rmse"] == pytest.approx(np.sqrt(np.mean(ours**2)), abs=1e-6)
    assert (mean, median) == pytest.approx(
        (theirs[FIRST_SCORED - 1 :].mean(), np.median(theirs[FIRST_SCORED - 1 :])), abs=1e-6
    )


@pytest.mark.parametrize("segment_m", SEGMENTS_M)
def test_relative_errors_are_what_evo_finds(scored, segment_m):
    folder, _, _, truths, estimates = scored
    ours = segment_errors(truths, estimates, segment_m)
    whole = relative_error(truths, estimates, segment_m)
    assert whole.segments == len(ours) > 3
    options = ("--delta", str(segment_m), "--delta_unit", "m", "--pairs_from_reference")
    stats, theirs = _evo(folder, "trans_part", "evo_rpe", *options)
    assert theirs == pytest.approx(ours[:, 0], abs=1e-6)
    assert [whole.position_mean_m, whole.position_median_m, whole.position_rmse_m] == pytest.approx(
        [stats["mean"], stats["median"], stats["rmse"]], abs=1e-6
    )
    stats, theirs = _evo(folder, "angle_deg", "evo_rpe", *options)
    assert theirs == pytest.approx(np.degrees(ours[:, 1]), abs=1e-5)
    heading = np.degrees([whole.heading_mean_rad, whole.heading_median_rad, whole.heading_rmse_rad])
    assert heading == pytest.approx([stats["mean"], stats["median"], stats["rmse"]], abs=1e-5)
