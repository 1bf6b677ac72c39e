"""Kept descriptors are those that would be measured, to the last bit, or are measured again."""

from __future__ import annotations

import sqlite3
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import maurice_loaders as ml
import maurice_mcl as mcl
from maurice_loaders.libraries import measured as module
from maurice_loaders.libraries.measured import CHEAP, FILE, SWITCH, MeasuredPictures, known_descriptors
from maurice_mcl.sensor.ahead import compared_ahead
from maurice_mcl.sensor.ahead import measured as measure
from maurice_mcl.sensor.descriptors.registry import CHANNELS
from maurice_mcl.values import F64, Frame

RNG = np.random.default_rng(2)
IMAGES = [RNG.integers(0, 256, (24, 32, 3), dtype=np.uint8) for _ in range(5)]


@pytest.fixture(autouse=True)
def _closed(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Close every file that a test opens: some versions of Python warn of those that are not."""
    opened: list[sqlite3.Connection] = []
    connect = sqlite3.connect

    def noted(*words: Any, **options: Any) -> sqlite3.Connection:
        opened.append(connect(*words, **options))
        return opened[-1]

    monkeypatch.setattr(sqlite3, "connect", noted)
    yield
    for one in opened:
        one.close()


def filled(file: Path, **options: int) -> MeasuredPictures:
    known = MeasuredPictures(file, **options)
    for image in IMAGES:
        measure(image, CHANNELS, known)
    known.flush()
    return known


def test_what_is_found_is_what_is_measured(tmp_path: Path) -> None:
    known = filled(tmp_path / FILE)
    for image in IMAGES:
        found = known.find(image.copy(), CHANNELS)
        assert set(found) == set(CHANNELS)
        for name, descriptor in found.items():
            assert descriptor.dtype == np.float32
            assert np.array_equal(descriptor, CHANNELS[name].describe(image))
    assert known.find(np.zeros_like(IMAGES[0]), CHANNELS) == {}
    assert known.find(IMAGES[0].reshape(32, 24, 3), CHANNELS) == {}


def test_a_second_replay_measures_nothing(
    small_session: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MAURICE_CACHE", str(tmp_path / "cache"))
    library = ml.open_library(small_session.parent / "survey.log")
    sensor = mcl.make_localizer(library, feature="blended").sensor
    session, asked = ml.open_session(small_session), []
    without = [pictures for _, pictures in compared_ahead([sensor], session.moments())]
    first = [pictures for _, pictures in compared_ahead([sensor], session.moments(), known_descriptors())]
    monkeypatch.setattr(type(CHANNELS["edges"]), "describe", lambda self, image: asked.append(1))
    monkeypatch.setattr(type(CHANNELS["color"]), "describe", lambda self, image: asked.append(1))
    second = [pictures for _, pictures in compared_ahead([sensor], session.moments(), known_descriptors())]
    assert not asked
    assert len(without) == len(first) == len(second) == 14
    for pictures in zip(without, first, second, strict=True):
        bits = [one[0].comparison.distances.tobytes() for one in pictures]
        assert bits[0] == bits[1] == bits[2]


class Brightness:
    """A pose sensor whose readings can be kept."""

    checksum = b"one"
    asked = 0

    def read(self, frame: Frame) -> float | None:
        self.asked += 1
        return float(frame.image.mean()) if frame.image.any() else None

    def to_numbers(self, reading: float | None) -> F64:
        return np.array([] if reading is None else [reading])

    def of_numbers(self, numbers: F64, frame: Frame) -> float | None:
        return float(numbers[0]) if len(numbers) else None


def test_a_pose_sensor_reads_a_picture_once(tmp_path: Path) -> None:
    known, sensor = MeasuredPictures(tmp_path / FILE), Brightness()
    images = [*IMAGES, np.zeros_like(IMAGES[0])]
    for asked in (len(images), len(images)):
        for image in images:
            seen = Frame(1, 0.0, np.zeros((0, 3)), image.copy(), "")
            assert known.reading(sensor, seen) == (float(image.mean()) if image.any() else None)
        known.flush()
        assert sensor.asked == asked
    sensor.checksum = b"other"
    known.reading(sensor, Frame(1, 0.0, np.zeros((0, 3)), IMAGES[0], ""))
    assert sensor.asked == len(images) + 1
    known.flush()


def test_another_channel_code_or_parameter_is_another_descriptor(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    known = filled(tmp_path / FILE)
    assert len({module.channel_checksum(name) for name in CHANNELS}) == len(CHANNELS)
    monkeypatch.setattr(type(CHANNELS["chromaticity"]), "parameters", lambda self: {"changed": 1})
    assert set(CHANNELS) - set(known.find(IMAGES[0], CHANNELS)) == {"chromaticity"}


def test_nothing_is_kept_where_measuring_is_as_cheap_as_a_checksum(tmp_path: Path) -> None:
    known = MeasuredPictures(tmp_path / FILE)
    for image in IMAGES:
        measure(image, CHEAP, known)
    known.flush()
    assert not (tmp_path / FILE).exists()


def _flipped(file: Path) -> None:
    data = bytearray(file.read_bytes())
    for at in range(8192, len(data), 997):
        data[at] ^= 0xFF
    file.write_bytes(data)


DAMAGED = {
    "no database": lambda file: file.write_bytes(b"no database" * 1000),
    "empty": lambda file: file.write_bytes(b""),
    "cut": lambda file: file.write_bytes(file.read_bytes()[: file.stat().st_size // 2]),
    "flipped bits": _flipped,
}


@pytest.mark.parametrize("damage", DAMAGED)
def test_damage_is_measured_again(damage: str, tmp_path: Path) -> None:
    file = tmp_path / FILE
    filled(file)
    DAMAGED[damage](file)
    known = MeasuredPictures(file)
    for _ in range(2):
        for image in IMAGES:
            for name, descriptor in measure(image, CHANNELS, known)[0].items():
                assert np.array_equal(descriptor, CHANNELS[name].describe(image))
        known.flush()
    if damage != "flipped bits":  # some of these rows may be beyond repair, and are measured each time
        assert all(len(known.find(image, CHANNELS)) == len(CHANNELS) for image in IMAGES)


def test_a_row_that_is_damaged_is_not_used(tmp_path: Path) -> None:
    known = filled(tmp_path / FILE)
    with sqlite3.connect(tmp_path / FILE) as db:
        db.execute("UPDATE kept SET held = zeroblob(length(held))")
    db.close()
    assert known.find(IMAGES[0], CHANNELS) == {}


def test_its_size_is_bounded_and_the_oldest_go_first(tmp_path: Path) -> None:
    known, most = MeasuredPictures(tmp_path / FILE, most_bytes=100_000), []
    for value in range(200):
        image = np.full((4, 4, 3), value, np.uint8)
        known.keep(image, {"edges": np.full(1000, value, np.float32)})
        known.flush()
        most.append((tmp_path / FILE).stat().st_size)
        assert "edges" in known.find(image, ["edges"])
    assert max(most) < 120_000
    assert known.find(np.full((4, 4, 3), 0, np.uint8), ["edges"]) == {}


KEEP = """
import sys
from pathlib import Path
import numpy as np
from maurice_loaders.libraries.measured import MeasuredPictures
for value in range(40):
    known = MeasuredPictures(Path(sys.argv[1]))
    known.keep(np.full((4, 4, 3), value, np.uint8), {"edges": np.full(84, value, np.float32)})
    known.flush()
"""


def test_processes_share_the_file(tmp_path: Path) -> None:
    words = [sys.executable, "-c", KEEP, str(tmp_path / FILE)]
    others = [subprocess.Popen(words, stderr=subprocess.PIPE) for _ in range(2)]
    assert [other.communicate(timeout=60)[1] for other in others] == [b"", b""]
    known = MeasuredPictures(tmp_path / FILE)
    for value in range(40):
        assert known.find(np.full((4, 4, 3), value, np.uint8), ["edges"])["edges"].mean() == value
    known.flush()


def test_it_can_be_switched_off_and_need_not_be_writable(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(SWITCH, "0")
    assert known_descriptors() is None
    (tmp_path / "file").write_bytes(b"")
    known = filled(tmp_path / "file" / FILE)  # no folder can be there
    assert known.find(IMAGES[0], CHANNELS) == {}
