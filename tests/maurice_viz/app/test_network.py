"""`--feature onnx:FILE.onnx`: a network's descriptors as a picture channel."""

from __future__ import annotations

import numpy as np
import pytest

import maurice_viz as mv
from helpers import onnx_files as onnx
from helpers.commands import process
from helpers.small_session import write_small_session, write_small_survey
from maurice_loaders import InputError, open_run
from maurice_mcl.sensor.descriptors.network import Network


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    folder = tmp_path_factory.mktemp("network")
    write_small_survey(folder)
    (folder / "Small-Net.onnx").write_bytes(onnx.small_network())
    return write_small_session(folder)


@pytest.fixture
def network(drive):
    return f"onnx:{drive.parent}/Small-Net.onnx"


def test_it_localizes_and_its_run_is_saved_and_verified_in_another_process(drive, network, tmp_path):
    filters = [mv.Filter(network, seed=1), mv.Filter("robust", feature=network), mv.Filter("color")]
    scores = mv.compare(drive, filters=filters, save_run=tmp_path / "kept")
    assert [run.label for run in scores.runs] == ["Small-Net", "robust", "color"]
    assert max(run.score.error_mean_m for run in scores.runs[:2]) < 0.25
    saved = open_run(tmp_path / "kept" / "Small-Net").configuration.values()
    assert saved["sensor.weights"] == {"small_net": 1.0}
    assert saved["sensor.channels"][0].startswith(f"{network}@")
    assert 0 < saved["sensor.scales"]["small_net"] < 0.5
    found = process("verify", tmp_path / "kept" / "robust")
    assert "the same, all 14 steps" in found.stdout


def test_it_is_tried_over_seeds_as_it_is_replayed(drive, network):
    asked = mv.Filter(network, particles=60)
    runs = mv.trials(drive, filters=[asked, "color"], seeds=1).runs
    assert runs["label"].to_list() == ["Small-Net", "color"]
    assert runs["error_mean_m"][0] == mv.replay(drive, filter=asked).runs[0].score.error_mean_m


def test_it_is_given_beside_other_channels(drive, network):
    both = mv.Filter("color", channels=[network], settings={"sensor.distances": {"small_net": "l2"}})
    weights = both.configuration().parameters.sensor.weights
    assert weights == {"color": 1.0, "small_net": 1.0}
    assert mv.replay(drive, filter=both).runs[0].label == "color"
    with pytest.raises(
        InputError, match="for small_net, expected one of cosine, l1, l2: it has numbers below"
    ):
        mv.replay(drive, filter=both.set(settings={"sensor.distances": {"small_net": "hellinger"}}))


def test_pictures_are_measured_once_wherever_the_file_is(drive, network, tmp_path, monkeypatch):
    counted = []
    describe = Network.describe
    monkeypatch.setattr(Network, "describe", lambda self, image: counted.append(1) or describe(self, image))
    monkeypatch.setenv("MAURICE_CACHE", str(tmp_path / "cache"))
    first = mv.replay(drive, filter=mv.Filter(network))
    assert len(counted) > 160
    counted.clear()
    moved = tmp_path / "moved.onnx"
    moved.write_bytes(onnx.small_network())
    again = mv.replay(drive, filter=mv.Filter(network))
    assert len(counted) == 0
    assert again.runs[0].score == first.runs[0].score
    moved.with_suffix(".toml").write_text("std = 1")
    mv.replay(drive, filter=mv.Filter(f"onnx:{moved}"))
    assert len(counted) > 160, "another table is another network"


def test_the_command_says_in_one_line_what_is_wrong(drive, tmp_path):
    (tmp_path / "odd.onnx").write_text("no network")
    for file, said in (("odd.onnx", "is no ONNX file"), ("gone.onnx", "cannot be read: No such file")):
        found = process(drive, "--feature", f"onnx:{tmp_path / file}", "-o", "none", expect=1)
        (line,) = found.stderr.splitlines()
        assert said in line
    found = process(drive, "--feature", "onyx", "-o", "none", expect=2)
    assert "no feature called 'onyx'" in found.stderr


def test_a_library_is_checked_by_it(drive, network):
    check = mv.check_library(drive.parent / "survey.log", feature=network)
    assert check.telling.score > check.telling.blind
    shown = process("library", "check", drive.parent / "survey.log", "--feature", network)
    assert "left out, found again" in shown.stdout
    assert np.isfinite(check.similarity.retrieved_right)
