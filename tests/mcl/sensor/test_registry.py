"""Channels that other packages bring along: small packages in a folder, found as installed ones are."""

from __future__ import annotations

import subprocess
import sys
from importlib.metadata import EntryPoint, entry_points

import cv2
import numpy as np
import pytest

from maurice_mcl.sensor.ahead import measured
from maurice_mcl.sensor.descriptors.registry import CHANNELS, GROUP, OURS, describe, load_channels, reduced

MEAN = """
import numpy as np

class Mean:
    name = "mean"
    distance = "l1"
    unit = "gray levels"
    def describe(self, image):
        return image.mean(axis=(0, 1)).astype(np.float32)
    def parameters(self):
        return {"feature": "mean"}
"""


def _package(folder, name, source, value):
    """Lay out an installed package: its module, and the metadata that names its entry point."""
    (folder / f"{name}.py").write_text(source)
    info = folder / f"{name}-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[{GROUP}]\nmine = {value}\n")


def _found(folder, monkeypatch):
    monkeypatch.syspath_prepend(folder)
    return load_channels(entry_points(group=GROUP))


def _channels(folder, monkeypatch):
    found = _found(folder, monkeypatch)
    assert found.broken == ()
    return found.channels


def test_ours_have_names_of_their_own():
    names = [channel.name for channel in OURS]
    assert len(set(names)) == len(names)
    assert set(names) <= set(CHANNELS)
    assert list(load_channels([]).channels) == [channel.name for channel in OURS]


@pytest.mark.parametrize(
    ("size", "expected"),
    [
        ((144, 176), (144, 176)),
        ((300, 1919), (300, 1919)),
        ((1080, 1920), (540, 960)),
        ((1920, 1080), (960, 540)),
        ((2160, 3840), (540, 960)),
        ((1, 4000), (1, 1000)),
    ],
)
def test_large_pictures_are_reduced_until_any_further_is_too_far(size, expected):
    image = np.random.default_rng(1).integers(0, 256, (*size, 3), np.uint8)
    small = reduced(image)
    assert small.shape == (*expected, 3)
    assert (small is image) == (size == expected)
    assert reduced(small) is small
    assert np.abs(small.mean(axis=(0, 1)) - image.mean(axis=(0, 1))).max() < 1


def test_a_large_picture_measures_as_the_same_picture_of_a_smaller_camera():
    small = cv2.GaussianBlur(np.random.default_rng(1).integers(0, 256, (540, 960, 3), np.uint8), (0, 0), 3)
    large = np.repeat(np.repeat(small, 4, axis=0), 4, axis=1)
    names = [channel.name for channel in OURS]
    expected, found = (measured(image, names)[0] for image in (small, large))
    assert all(np.array_equal(found[name], expected[name]) for name in names)


def test_channels_are_found_once(tmp_path, monkeypatch):
    _package(tmp_path, "mean_channel", MEAN, "mean_channel:Mean")
    channels = _channels(tmp_path, monkeypatch)
    image = np.full((4, 5, 3), (1, 2, 3), np.uint8)
    assert channels["mean"].describe(image).tolist() == [1, 2, 3]
    assert [name for name in channels if name != "mean"] == [c.name for c in OURS]
    made = MEAN + "\ndef make():\n    channel = Mean()\n    channel.name = 'made'\n    return channel\n"
    _package(tmp_path, "making_channel", made, "making_channel:make")
    assert "made" in _channels(tmp_path, monkeypatch)
    (tmp_path / "mean_twice.py").write_text(MEAN)
    monkeypatch.syspath_prepend(tmp_path)
    points = [EntryPoint(name, "mean_twice:Mean", GROUP) for name in "ab"]
    found = load_channels(points)
    assert "mean" in found.channels
    assert "there is a channel 'mean' already" in found.broken[0]


def test_it_is_used_by_name_wherever_channels_are(tmp_path):
    """In a process of its own, because the channels in force are looked up at import."""
    _package(tmp_path, "mean_channel", MEAN, "mean_channel:Mean")
    program = """
import numpy as np
from maurice_mcl.values.map import Arena
from maurice_mcl.values.library import ChannelIndex, Library
from maurice_mcl.sensor.references import nearest_reference
from maurice_mcl.sensor.model import SensorModel, SensorParameters
poses = np.array([[0.5, 0.5, 0.0], [1.5, 0.5, 0.0]])
references = np.array([[10, 20, 30], [40, 50, 60]], np.float32)
index = ChannelIndex(references, np.zeros(3, np.float32), references.max(axis=0))
arena = Arena((0.0, 0.0, 2.0, 1.0), np.zeros((0, 4)))
library = Library("two", poses, (None, None), {"mean": index}, arena)
parameters = SensorParameters({"mean": 1.0}, scales={"mean": 1.0})
model = SensorModel(library, nearest_reference(poses, arena), parameters)
print(model.compare(model.measure(np.full((4, 4, 3), (41, 50, 60), np.uint8))).best(1))
"""
    done = subprocess.run(
        [sys.executable, "-c", program],
        env={"PYTHONPATH": str(tmp_path), "PATH": ""},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stderr == ""
    assert done.stdout.strip() == "[1]"


BROKEN = {
    "cannot be imported": ("import nothing_of_that_name", "Mean"),
    "has no such class": (MEAN, "Median"),
    "raises when called": (
        "class Mean:\n    def __init__(self):\n        raise OSError('no camera')",
        "Mean",
    ),
    "needs arguments": ("class Mean:\n    def __init__(self, size):\n        self.size = size", "Mean"),
    "makes no channel": ("class Mean:\n    name = 'mean'", "Mean"),
    "has a name that is no word": (MEAN.replace('"mean"', "7", 1), "Mean"),
    "has a name of two words": (MEAN.replace('"mean"', '"my mean"', 1), "Mean"),
    "has no such distance": (MEAN.replace('"l1"', '"manhattan"', 1), "Mean"),
    "has parameters that are no JSON": (MEAN.replace('{"feature": "mean"}', "{1, 2}"), "Mean"),
    "raises a text of several lines": ("raise ValueError('one\\ntwo')", "Mean"),
    "takes a name of ours": (MEAN.replace('"mean"', '"color"', 1), "Mean"),
}


@pytest.mark.parametrize("fault", BROKEN)
def test_a_broken_one_is_left_out_and_says_whose_it_is(tmp_path, monkeypatch, fault):
    source, made = BROKEN[fault]
    module = "broken_" + fault.replace(" ", "_")
    _package(tmp_path, module, source, f"{module}:{made}")
    (tmp_path / "good").mkdir()
    _package(tmp_path / "good", f"good_{module}", MEAN.replace('"mean"', '"good"', 1), f"good_{module}:Mean")
    monkeypatch.syspath_prepend(tmp_path / "good")
    found = _found(tmp_path, monkeypatch)
    assert list(found.channels) == [*(channel.name for channel in OURS), "good"]
    (line,) = found.broken
    assert line.startswith(f"channel of entry point {module}:{made} left out: ")
    assert "\n" not in line


class _Giving:
    name = "giving"
    distance = "l1"

    def __init__(self, found):
        self.found = found

    def describe(self, image):
        return self.found


WRONG = {
    "list, expected float32 of one dimension": [1.0],
    "float64 \\(3,\\), expected float32": np.ones(3),
    "float32 \\(1, 3\\), expected float32": np.ones((1, 3), np.float32),
    "4 numbers after 3": np.ones(4, np.float32),
    "a negative or no finite number": np.array([1, np.nan, 1], np.float32),
    "a negative or no finite": np.array([1, -1, 1], np.float32),
}


@pytest.mark.parametrize("message", WRONG)
def test_what_a_channel_gives_is_checked_where_libraries_are_built(message):
    with pytest.raises(ValueError, match=f"^channel 'giving' gave {message}"):
        describe(_Giving(WRONG[message]), np.zeros((2, 2, 3), np.uint8), 3)


def test_what_is_right_passes_and_what_is_raised_is_named():
    good = np.ones(3, np.float32)
    assert describe(_Giving(good), np.zeros((2, 2, 3), np.uint8)) is good
    with pytest.raises(ValueError, match="channel 'giving' raised AttributeError"):
        describe(type("Bad", (), {"name": "giving"})(), np.zeros((2, 2, 3), np.uint8))
