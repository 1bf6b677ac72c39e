"""Branches of a saved run, and remedies for one that is lost, as a person asks for them."""

from __future__ import annotations

import json
import shutil
from collections import defaultdict
from dataclasses import replace

import numpy as np
import pytest
from rerun.chunk import RrdReader

import maurice_viz as mv
from helpers import expect_facts
from helpers.commands import failure, maurice, run
from helpers.small_session import write_small_session, write_small_survey
from maurice_datasets.sessions import write_simulation
from maurice_datasets.simulation import SimulationPlan
from maurice_datasets.tasks import TASKS
from maurice_datasets.trials.statistics import rate
from maurice_loaders import InputError
from maurice_viz.app.branch import BranchChange, open_branch
from maurice_viz.app.remedies import BETTER, UNCLEAR, WORSE, Remedy, SeedResults, compared_with_first
from maurice_viz.errors import OptionError


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A session, a run of it, and one that begins at a wrong place, `lost`."""
    folder = tmp_path_factory.mktemp("what-if")
    write_small_survey(folder)
    session = write_small_session(folder, updates=24)
    mv.replay(session, filter=mv.Filter("robust", particles=200, seed=3), save_run=folder / "kept")
    settings = {"recovery.strategy": "none"}
    mv.replay(
        session,
        filter=mv.Filter("color", particles=200, start="0.4,1.8,180", settings=settings),
        save_run=folder / "lost",
    )
    return folder


@pytest.mark.parametrize("step", [0, 7, 22])
def test_a_branch_that_changes_nothing_is_the_run(folder, step):
    found = mv.what_if(folder / "kept", step)
    assert found.same
    expect_facts(found.line, "Nothing changed", "bit for bit", "step 24")
    assert found.before == found.after
    assert found.parted_at is None


def test_a_branch_of_a_laser_checks_places_by_the_scans_before_it(tmp_path):
    plan = SimulationPlan(TASKS["kidnapped"], world="office", arena_seed=2, seed=3, updates=24, laser=True)
    written = write_simulation(tmp_path / "off", plan)
    mv.replay(written.session, filter="laser", save_run=tmp_path / "run")
    carried = next(event.step for event in mv.events(tmp_path / "run", kinds=["kidnapped"]).runs[0].events)
    for step in range(carried - 1, carried + 3):
        assert mv.what_if(tmp_path / "run", step).same


def test_the_same_settings_given_again_change_nothing(folder):
    settings = {"recovery.strategy": "threshold", "resampling.scheme": "systematic"}
    assert mv.what_if(folder / "kept", 7, filter=mv.Filter(settings=settings, particles=200), seed=3).same


def test_noise_differs_only_from_the_branch_on(folder):
    found = mv.what_if(folder / "kept", 7, seed=4)
    assert found.same_until == 7
    assert found.differs.field.startswith("particles.")


def test_a_strategy_that_never_acts_leaves_the_run_as_it_is(folder):
    never = {"recovery.strategy": "sensor", "recovery.sensor.evidence": -1e6}
    found = mv.what_if(folder / "lost", 7, filter=mv.Filter(settings=never))
    assert found.same
    always = mv.what_if(folder / "lost", 7, filter=mv.Filter(settings={"recovery.strategy": "always"}))
    assert (always.same_until, always.differs.field) == (7, "events")


def test_a_branch_that_finds_itself_parts_from_the_lost_run(folder):
    settings = {"recovery.strategy": "mixture"}
    found = mv.what_if(
        folder / "lost",
        3,
        filter=mv.Filter(settings=settings),
        output=mv.Output(detail="light", to=folder / "out.rrd"),
    )
    assert 3 < found.parted_at < 15
    assert found.after.error_mean_m < found.before.error_mean_m
    assert f"the estimates part at step {found.parted_at}" in found.line
    assert found.scores.rrd == folder / "out.rrd"
    batches = _texts(found.scores.rrd)
    assert "'branch'" in batches["/what_happened"]
    assert "'parted'" in batches["/what_happened"]
    assert f"They part at step {found.parted_at}." in batches["/compare/result"]


def test_a_branch_may_compare_pictures_by_other_channels(folder):
    """Its diagnosis looks at the steps before the branch with its own sensor model."""
    found = mv.what_if(folder / "lost", 3, filter="robust")
    assert found.same_until == 3
    assert found.change == ("preset robust",)
    assert found.after.error_mean_m < found.before.error_mean_m


def test_the_command_prints_when_they_part_and_json(folder):
    args = ("what-if", folder / "lost", "--from", "3", "--particles", "800", "-o", "none")
    out, err = maurice(*args)
    expect_facts(out, "step 3", "800 particles", "number of particles differs at step 4")
    assert "the belief after step 3 is resampled to 800 particles" in err
    found = json.loads(maurice(*args, "--json")[0])
    assert found["what_if"]["same_until"] == 3
    assert [one["label"] for one in found["runs"]] == ["color", "particles 800"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--from", "24"], "--from: found 24, expected a step from 0 to 23"),
        (["--from", "3", "--set", "radii.lost_m=1"], "radii cannot be changed"),
        (["--from", "3", "--set", "no.such=1"], "no.such is not known"),
        (["--remedy", "--feature", "color"], "--remedy chooses what to change"),
    ],
)
def test_options_that_make_no_sense_are_refused(folder, words, message):
    shown = " ".join(run("what-if", folder / "kept", *words, expect=2).stderr.replace("│", " ").split())
    assert message in shown


def test_a_session_is_answered_with_the_command_that_saves_a_run_of_it(small_session):
    said = failure("what-if", small_session, "--from", 4)
    assert f"maurice-replay {small_session} -o none --save-run my-run" in said


def test_a_run_whose_session_is_gone_is_one_line(folder, tmp_path):
    for name in ("survey.log", "session.log", "kept"):
        (shutil.copytree if name == "kept" else shutil.copy)(folder / name, tmp_path / name)
    (tmp_path / "session.log").write_text((folder / "session.log").read_text() + "\n")
    manifest = tmp_path / "kept" / "manifest.json"
    manifest.write_text(manifest.read_text().replace(str(folder), str(tmp_path)))
    assert "was changed after the run was made" in failure("what-if", tmp_path / "kept", "--from", "3")


def test_without_a_step_the_branch_is_before_the_loss(folder):
    assert mv.what_if(folder / "lost", seed=4).from_step == 0  # it was never localized
    with pytest.raises(OptionError, match="never lost"):
        mv.what_if(folder / "kept", seed=4)


def _texts(recording):
    """Return all that each entity of a recording holds, as text."""
    found = defaultdict(str)
    for chunk in RrdReader(recording).stream():
        found[str(chunk.entity_path)] += str(chunk.to_record_batch().to_pydict())
    return found


REMEDIES = ("recovery mixture", "roughening 0.2", "recovery expansion")


def test_a_remedy_that_is_proposed_works_with_other_seeds(folder):
    found = mv.remedies(folder / "lost", 3, seeds=12, names=REMEDIES)
    assert found.as_it_was.localized.value < 0.5
    assert found.proposed.name == "recovery mixture"
    expect_facts(found.line, "recovery mixture helps", "p < 0.05", "in 1")
    again = mv.remedies(folder / "lost", 3, seeds=range(500, 512), names=["recovery mixture"])
    assert again.tried[0].localized.value >= 0.8
    assert found.tried[0].change.options == ("--set", "recovery.strategy=mixture")


def test_the_command_says_where_nothing_helps(folder):
    with pytest.raises(InputError, match="expected at least 10"):
        mv.remedies(folder / "lost", 20, seeds=2)
    nothing = mv.remedies(folder / "lost", 3, seeds=3, names=["roughening 0.2"])
    assert nothing.proposed is None
    expect_facts(nothing.line, "Nothing tried helps", "p < 0.05", "0 of 3")


def test_all_that_is_possible_is_tried_in_a_table_of_80_columns(folder, monkeypatch):
    from maurice_viz.cli.shared import console

    monkeypatch.setattr(console.results, "width", 80)
    out = maurice("what-if", folder / "lost", "--from", "3", "--remedy", "--seeds", "2")[0]
    for name in ("as it was", "recovery mixture", "particles x16", "feature edges", "preset robust"):
        assert name in out
    assert max(map(len, out.splitlines())) <= 80


def _tried(*hits):
    remedies = [Remedy(str(number), BranchChange()) for number in range(len(hits))]
    results = [SeedResults(one, np.where(one, 0.1, 2.0)) for one in hits]
    return compared_with_first(remedies, results)


def test_a_remedy_is_better_only_beyond_doubt():
    never, always, some = np.zeros(20, bool), np.ones(20, bool), np.arange(20) < 3
    was, better, same, luck = _tried(never, always, never, some)
    assert (better.verdict, same.verdict, luck.verdict) == (BETTER, UNCLEAR, UNCLEAR)
    assert was.localized == replace(rate(0, 20), drives=1)  # seeds of one drive
    assert _tried(always, never)[1].verdict == WORSE


def test_by_chance_alone_hardly_any_set_of_remedies_holds_a_better_one():
    rng = np.random.default_rng(0)
    sets = [_tried(*(rng.random((11, 20)) < 0.5))[1:] for _ in range(40)]
    found = sum(any(one.verdict != UNCLEAR for one in some) for some in sets)
    assert found <= 40 * (0.05 + 4 * np.sqrt(0.05 * 0.95 / 40))


def test_a_branch_with_another_feature_gets_new_scales_and_keeps_chosen_ones(folder, monkeypatch):
    """Where the library fitted the run's scales, they are its own channels'."""
    import maurice_mcl.library.left_out as left_out

    monkeypatch.setattr(left_out, "FITTED_SPACING_M", 0.1)  # so that half a meter is far apart
    session = folder / "session.log"
    for name, settings in {"fitted": {}, "chosen": {"sensor.scales": {"edges": 0.1}}}.items():
        mv.replay(session, filter=mv.Filter("edges", particles=50, settings=settings), save_run=folder / name)
        point = open_branch(folder / name)
        assert point.run.configuration.parameters.sensor.scales
        branch = point.localizer_with(BranchChange(feature="color"))
        kept = point.run.configuration.parameters.sensor.scales
        assert ("edges" in branch.sensor.parameters.scales) == (name == "chosen"), kept
