"""Trajectory errors against independent code: the command `evo_ape` of evo (Grupp 2017)."""

import json
import os
import subprocess
import sys
import zipfile
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest

from maurice_mcl.analysis.metrics import FIRST_SCORED, Scorer
from maurice_mcl.config.build import build_localizer
from maurice_mcl.config.parameters import of_feature
from maurice_mcl.filter.localizer import run

EVO_APE = Path(sys.executable).parent / "evo_ape"


def _write_tum(path, times, poses):
    """Write poses in the plane as TUM trajectories have them: time, position, quaternion."""
    half = poses[:, 2] / 2
    zeros = np.zeros((len(poses), 3))
    rows = np.column_stack([times, poses[:, :2], zeros, np.sin(half), np.cos(half)])
    np.savetxt(path, rows, fmt="%.17g")


def _evo(folder, relation):
    """Run the command, unaligned; give what it says of all errors together, and each error."""
    kept = folder / f"{relation}.zip"
    command = [EVO_APE, "tum", "truth.tum", "estimate.tum", "-r", relation, "--save_results", kept]
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
    scorer, steps, times, estimates, truths = Scorer(), [], [], [], []
    for moment, record in run(localizer, world.drive, None):
        steps.append(scorer.add(record.estimate, moment.truth, moment.frame.motions))
        times.append(moment.frame.time_s)
        estimates.append(record.estimate.pose)
        truths.append(moment.truth)
    _write_tum(folder / "estimate.tum", times, np.array(estimates))
    _write_tum(folder / "truth.tum", times, np.array(truths))
    return folder, steps, scorer.result()


@pytest.mark.parametrize("relation", ["trans_part", "angle_deg"])
def test_errors_are_what_evo_finds(scored, relation):
    folder, steps, whole = scored
    if relation == "trans_part":
        ours = np.array([step.position_error_m for step in steps])
        mean, median = whole.position_error_mean_m, whole.position_error_median_m
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
