"""Trials from Python: filters on the same drives and seeds, with their differences."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import polars as pl
import pytest

import maurice_viz as mv
from helpers.small_session import write_small_session, write_small_survey
from maurice_loaders import InputError
from maurice_viz.errors import OptionError


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("trials")
    write_small_survey(folder)
    return write_small_session(folder)


class Still:
    """A motion model that a script holds: no other process could import it."""

    def __init__(self, noise_m: float) -> None:
        self.noise_m = noise_m

    def move(self, poses, motion, noise):
        way = np.column_stack([np.full(len(poses), motion.forward_m), np.zeros(len(poses))])
        moved = poses[:, :2] + way + self.noise_m * noise[:, :2]
        return np.column_stack([moved, poses[:, 2] + motion.turn_rad])


def ascending(weights, n, rng):
    return np.sort(rng.choice(len(weights), n, p=weights))


def test_every_run_is_that_of_a_replay_also_with_parts_of_ones_own_in_other_processes(drive: Path) -> None:
    few = mv.Filter(particles=60)
    filters = [few, few.set(motion=Still(0.02)), few.set(resampler=ascending)]
    result = mv.trials(drive, filters=filters, seeds=2, workers=2)
    assert result.runs["label"].to_list() == [
        label for label in ("blended", "Still", "ascending") for _ in range(2)
    ]
    for asked, errors_m in zip(filters, result.runs["error_mean_m"].reshape((3, 2)), strict=True):
        alone = [mv.replay(drive, filter=asked.set(seed=seed)).runs[0].score for seed in range(2)]
        assert errors_m.to_list() == [score.error_mean_m for score in alone]


def test_a_folder_keeps_them_and_more_seeds_are_added(drive: Path, tmp_path: Path) -> None:
    asked = {"filters": [mv.Filter(particles=50), mv.Filter(particles=60)], "to": tmp_path / "kept"}
    first = mv.trials(drive, seeds=1, **asked)
    assert "2 runs of particles 50, particles 60" in repr(first)
    more = mv.trials(drive, seeds=3, **asked)
    assert more.runs.filter(seed=0).drop("took_s").equals(first.runs.drop("took_s"))
    with pytest.raises(InputError, match="differs in more than more seeds"):
        mv.trials(drive, seeds=3, filters="color", to=tmp_path / "kept")


def test_pairs_of_each_with_each(drive: Path) -> None:
    filters = [mv.Filter(particles=n) for n in (50, 60, 70)]
    result = mv.trials(drive, filters=filters, seeds=4)
    pairs = result.paired(against="each")
    names = [f"particles {n}" for n in (50, 60, 70)]
    assert pairs.select("label", "against_label").rows() == [
        (names[1], names[0]),
        (names[2], names[0]),
        (names[2], names[1]),
    ]
    means = dict(result.mean().select("label", "mean").rows())
    for label, against, difference, p, adjusted in pairs.select(
        "label", "against_label", "difference", "p", "p_holm"
    ).rows():
        assert difference == pytest.approx(means[label] - means[against])
        assert p <= adjusted <= 1
    assert pairs["p_holm"].min() == pytest.approx(min(3 * pairs["p"].min(), 1))
    assert result.paired()["against_label"].to_list() == [names[0]] * 2
    assert not ((pairs["low"] > 0) & (pairs["p"] > 0.05)).any()
    with pytest.raises(InputError, match="metric"):
        result.mean("speed")
    with pytest.raises(InputError, match="expected two or more to compare"):
        mv.TrialsResult(result.runs.filter(label=names[0])).paired()
    with pytest.raises(InputError, match="against"):
        result.paired(against="best")


def test_several_drives_are_the_sample(drive: Path, tmp_path: Path) -> None:
    folder = tmp_path / "other"
    folder.mkdir()
    write_small_survey(folder)
    other = write_small_session(folder, updates=12)
    result = mv.trials([drive, other], filters=["color", "edges"], seeds=2)
    assert result.mean()["drives"].to_list() == [2, 2]
    assert result.runs["session"].n_unique() == 2


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ({"seeds": 0}, "seeds: found 0"),
        ({"filters": []}, "found no filter"),
        ({"filters": mv.Filter(seed=3)}, "seeds from 0 on"),
        ({"filters": mv.Filter(start="truth")}, "start: found 'truth'"),
        ({"filters": ["color", mv.Filter(start="global")]}, "different starts"),
        ({"library": "nowhere"}, "nowhere: found no such library"),
    ],
)
def test_what_cannot_be_tried_is_one_line(drive: Path, asked: dict[str, object], message: str) -> None:
    with pytest.raises((InputError, OptionError), match=message) as problem:
        mv.trials(drive, **asked)
    assert "\n" not in str(problem.value)


def test_options_of_reading_reach_every_run(drive: Path) -> None:
    usual = mv.trials(drive, filters=mv.Filter(particles=50), seeds=1).runs
    turned = mv.trials(drive, filters=mv.Filter(particles=50), seeds=1, reading=mv.Reading(turn_scale=-1.0))
    assert turned.runs["error_mean_m"][0] != usual["error_mean_m"][0]
    assert isinstance(turned.runs, pl.DataFrame)
