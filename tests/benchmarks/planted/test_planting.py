"""Planted causes: what is planted is there and nothing else is, it does harm, and only then does it count."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.studies.planted import drives
from benchmarks.studies.planted.drives import drive, frozen, gap, odometry_changed, plain_drive
from benchmarks.studies.planted.harm import is_harm, localizer_of, outcome_of, steps_of
from benchmarks.studies.planted.laser_ways import LASER_WAYS
from benchmarks.studies.planted.places import SETS, Ground, ground_of, part_of, twin_of
from benchmarks.studies.planted.planting import Planted, planting_of
from benchmarks.studies.planted.ways import HEALTHY, SEEING, WAYS, Planting
from benchmarks.studies.remedies import write_planted
from helpers.small_room import write_small_room
from maurice_datasets.tasks import FITTING, TEST
from maurice_loaders import open_library, open_session
from maurice_mcl.reasons.causes import CAUSES, OUT_OF_PLANE, UNKNOWN
from maurice_mcl.scoring.batch import compared_once


@pytest.fixture(scope="module")
def ground(tmp_path_factory: pytest.TempPathFactory) -> Ground:
    return ground_of(str(write_small_room(tmp_path_factory.mktemp("planted"))), 1)


def run(kind: str, planting: Planting) -> Planted:
    localizer = localizer_of(planting)
    compared = compared_once(localizer.sensor, planting.session.moments())
    known = planting.session.info.start is not None
    outcome = outcome_of(steps_of(localizer, planting, compared, 0), start_known=known)
    return Planted(kind, 0, planting, localizer, compared, outcome, 0)


def test_every_kind_of_cause_is_planted_and_no_seed_is_in_both_sets() -> None:
    flat = {OUT_OF_PLANE}  # which the simulated robot cannot leave
    assert {*WAYS} | {*LASER_WAYS} == {*CAUSES} - {UNKNOWN} - flat | {HEALTHY}
    assert SETS["unseen"].first in TEST
    assert SETS["develop"].first in FITTING
    assert not {*SETS["unseen"].places} & {*SETS["develop"].places}


def test_a_drive_that_was_kept_before_a_frame_had_another_field_is_driven_again(
    ground: Ground, monkeypatch: pytest.MonkeyPatch
) -> None:
    held = drive(ground, 1)
    monkeypatch.setattr(drives, "_rendered", lambda *_: pytest.fail("driven again"))
    assert len(drive(ground, 1).all_moments) == len(held.all_moments)
    monkeypatch.setattr(drives, "KEPT", ("Frame", "step"))
    with pytest.raises(pytest.fail.Exception, match="driven again"):
        drive(ground, 1)


@pytest.mark.parametrize(("kind", "number"), [("left_map", 1), ("healthy", 0)])
def test_a_cause_does_the_harm_that_is_its_own(ground: Ground, kind: str, number: int) -> None:
    made = run(kind, planting_of(kind, number, ground, 1))
    assert is_harm(kind, made.planting, made.outcome)
    others = [other for other in ("numeric", "resampling", HEALTHY) if other != kind]
    assert not any(is_harm(other, made.planting, made.outcome) for other in others)


def test_a_cause_changes_nothing_before_it(ground: Ground) -> None:
    planting = planting_of("left_map", 0, ground, 1)
    for before, moment in zip(plain_drive(ground, 1).moments(), planting.session.moments(), strict=True):
        same = np.array_equal(before.frame.motions, moment.frame.motions)
        assert same or moment.frame.step >= planting.since
        assert not (same and moment.frame.step == planting.since)


def test_the_log_does_not_tell_what_was_planted(ground: Ground) -> None:
    session = planting_of("motion", 0, ground, 1).session
    assert not any(moment.events for moment in session.moments())
    assert not session.info.notes


def test_a_gap_leaves_out_pictures_and_odometry_but_not_the_time(ground: Ground) -> None:
    held = plain_drive(ground, 1)
    cut = gap(held, 10, 5).all_moments
    assert [moment.frame.step for moment in cut] == list(range(1, len(held.all_moments) - 4))
    assert cut[9].frame.time_s == held.all_moments[14].frame.time_s
    assert cut[9].frame.motions is held.all_moments[14].frame.motions


def test_a_stuck_camera_repeats_the_last_good_picture(ground: Ground) -> None:
    images = [moment.frame.image for moment in frozen(plain_drive(ground, 1), 10, 4).moments()]
    assert all(np.array_equal(images[k], images[8]) for k in range(9, 13))
    assert not np.array_equal(images[13], images[8])


def test_odometry_is_changed_in_a_copy(ground: Ground) -> None:
    held = plain_drive(ground, 1)
    before = held.all_moments[4].frame.motions.copy()
    changed = odometry_changed(held, lambda motions: motions * 0, range(5, 6))
    assert not changed.all_moments[4].frame.motions.any()
    assert np.array_equal(held.all_moments[4].frame.motions, before)


def test_both_halves_of_a_twin_score_the_same(ground: Ground) -> None:
    planting = planting_of("ambiguity", 0, ground, 1)
    localizer = localizer_of(planting)
    image = planting.session.all_moments[0].frame.image
    cost = localizer.sensor.compare(localizer.sensor.measure(image)).cost
    size = ground.library.size
    assert np.allclose(cost[:size], cost[size:])
    assert twin_of(ground.library).arena.size_m[0] > 2 * ground.library.arena.size_m[0]


def test_a_part_of_a_library_keeps_its_references(ground: Ground) -> None:
    kept = np.arange(ground.library.size) % 3 == 0
    part = part_of(ground.library, kept)
    assert part.size == kept.sum() == len(part.pictures)
    for name, index in part.index.items():
        assert np.array_equal(index.references, ground.library.index[name].references[kept])


def test_a_planted_run_as_files(ground: Ground, tmp_path: Path) -> None:
    made = run("left_map", planting_of("left_map", 0, ground, 1))
    log = write_planted(made, tmp_path / "run")
    session, library = open_session(log), open_library(tmp_path / "run" / "library")
    assert library.size == ground.library.size
    assert session.info.start is not None
    first, again = made.planting.session.all_moments[20], list(session.moments())[20]
    assert np.allclose(again.frame.motions, first.frame.motions, atol=1e-6)
    assert again.truth is not None
    assert first.truth is not None
    assert np.allclose(again.truth, first.truth, atol=1e-6)
    assert not any(moment.events for moment in open_session(log).moments())


def test_the_motion_model_of_a_planted_run_is_in_the_header_of_its_session(
    ground: Ground, tmp_path: Path
) -> None:
    planting = replace(planting_of("left_map", 0, ground, 1), settings=SEEING)
    log = write_planted(replace(run("left_map", planting), planting=planting), tmp_path / "run")
    assert open_session(log).info.motion == SEEING["motion"]
