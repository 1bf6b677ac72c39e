"""Five drives on which a localizer goes wrong, each for another reason: the verdict says which."""

from __future__ import annotations

import re

import pytest

import maurice_viz as mv
from maurice_datasets.sessions import simulate, simulation_plan
from maurice_viz.style import UNITS, Scale
from maurice_viz.text.verdict import account, headline

INCHES = Scale(UNITS["in"])
pytestmark = pytest.mark.slow  # five drives and a survey are rendered


@pytest.fixture(scope="module")
def judged(tmp_path_factory):
    folder = tmp_path_factory.mktemp("five")

    def of(task, seed, updates, preset, particles, feature=None, **more):
        paths = simulate(
            simulation_plan(task, seed=seed, updates=updates, **more), to=folder / f"{task}-{seed}"
        )
        scores = mv.replay(paths.session, filter=mv.Filter(preset, particles=particles, feature=feature))
        verdicts = {run.label: run.verdict for run in scores.runs}
        text = " ".join([headline(verdicts, INCHES), *account(verdicts, INCHES)])
        return text, next(iter(verdicts.values()))

    return of


def test_a_kidnapping_says_how_far_the_robot_was_carried(judged):
    line, verdict = judged("kidnapped", 1, 30, "thesis", 400, kidnap_at=12)
    assert len(re.findall(r"carried [\d.]+ in at step 13, unseen by its odometry", line)) == 1
    assert verdict.decisive == 13


def test_a_slip_says_what_odometry_counted_and_what_the_robot_did(judged):
    line, verdict = judged("tracking", 3, 24, "thesis", 400, slip_at="12-15")
    assert re.search(r"slipped at steps 12 to 15: odometry .*[\d.]+ in, .*moved [\d.]+ in", line)
    (cause,) = verdict.incidents
    assert cause.expected > 4 * cause.actual
    assert verdict.decisive == 15


def test_lights_out_says_that_all_references_score_alike(judged):
    line, _ = judged("tracking", 2, 30, "robust", 400, lights="dim:0@10")
    assert re.search(r"dark at step 10 .*\d+ before, \d+ since.*all reference pictures .*alike", line)


def test_two_places_that_look_alike_are_told_with_their_shares(judged):
    line, verdict = judged("global", 6, 14, "robust", 600, feature="edges")
    assert re.search(r"looked alike at step 3: \d+% .*\d+% .*0.8\d and 0.8\d.*0.\d\d", line)
    assert "truth is in the second" in line
    assert "found itself (at step 9" in line
    assert verdict.decisive == 3


def test_sure_and_wrong_says_how_far_off_and_what_became_of_the_particles_at_the_truth(judged):
    line, verdict = judged("global", 5, 40, "thesis", 150)
    assert re.search(r"never localized, sure of a wrong place.*: at step \d+, \d+% .*[\d.]+ in", line)
    assert re.search(r"beyond the motion model at step 8 on carpet .*3.9 sigma of its turn", line)
    assert verdict.decisive == verdict.sure_and_wrong.step
