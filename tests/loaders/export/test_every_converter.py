"""Every kind of record survives every converter; what a file cannot hold is counted and named."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

import maurice_viz as mv
from maurice_loaders import InputError, SessionWriter, open_session
from maurice_loaders.errors import ReadingNotes
from maurice_loaders.formats.registry import open_recording
from maurice_loaders.reading.recording import Motion, Note, OdometryPose, Picture, Readings, Scan, TruthPose
from maurice_mcl.values.arrays import U8
from maurice_mcl.values.laser import LaserScan
from maurice_mcl.values.session import Moment, SessionInfo

pytest.importorskip("rosbags")

KINDS = ("motion", "truth", "event", "reading", "scan", "picture")
TARGETS = ("drive.log", "folder", "drive.mcap")


def picture(number: int) -> U8:
    return np.random.default_rng(number).integers(0, 255, (12, 16, 3), dtype=np.uint8)


def a_log(file: Path, kinds: tuple[str, ...]) -> Path:
    """A drive of four pictures with records of these kinds, a row of readings with two names."""
    with SessionWriter(file, SessionInfo(name="drive")) as log:
        for step in range(4):
            t_s = 0.5 * step
            if "motion" in kinds:
                log.odometry(t_s, (0.1, 0.0, 0.1 / 3))
            if "truth" in kinds:
                log.truth(t_s, (0.1 * step, 1 / 3, 0.0))
            if "event" in kinds and step % 2:
                log.event(t_s, f"lights {step}; off")
            if "reading" in kinds:
                log.reading(t_s, {"a name/with é": 0.1 * step, "b": -1 / 3})
            if "scan" in kinds:
                ranges = np.array([1 + step / 3, np.inf, np.nan, 8.0], np.float32)
                log.scan(t_s, LaserScan(ranges, -1.5, 0.75, 0.25, 8.0, np.array([0.25, -0.125, 0.5])))
            if "picture" in kinds:
                log.image(t_s, picture(step))
    return file


def assert_same(before: Moment, after: Moment) -> None:
    assert np.array_equal(before.frame.image, after.frame.image)
    assert np.array_equal(before.frame.motions, after.frame.motions)
    assert dict(before.frame.readings) == dict(after.frame.readings)
    assert before.events == after.events
    assert_same_scan(before.frame.scan, after.frame.scan)
    assert (before.truth is None) == (after.truth is None)
    if before.truth is not None and after.truth is not None:  # a quaternion rounds the heading
        np.testing.assert_allclose(after.truth, before.truth, rtol=0, atol=1e-9)


def assert_same_scan(before: LaserScan | None, after: LaserScan | None) -> None:
    assert (before is None) == (after is None)
    if before is not None and after is not None:
        assert before.ranges_m.tobytes() == after.ranges_m.tobytes()
        np.testing.assert_allclose(after.mount, before.mount, rtol=0, atol=1e-9)
        for name in ("start_rad", "step_rad", "min_m", "max_m"):
            assert getattr(after, name) == pytest.approx(getattr(before, name), abs=1e-7)


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("without", [(), *((kind,) for kind in KINDS), ("picture", "reading"), KINDS[:5]])
def test_every_kind_of_record_survives(target: str, without: tuple[str, ...], tmp_path: Path) -> None:
    kinds = tuple(kind for kind in KINDS if kind not in without)
    log = a_log(tmp_path / "session.log", kinds)
    converted = mv.convert(log, tmp_path / target)
    file, done = converted.file, converted.counts
    assert done.left_out == {}
    counts = {"motion": 4, "truth": 4, "event": 2, "reading": 4, "scan": 4, "picture": 4}
    found = (done.motions, done.truths, done.events, done.readings, done.scans, done.pictures)
    assert found == tuple(counts[kind] if kind in kinds else 0 for kind in KINDS)
    types = {Motion: "motion", TruthPose: "truth", Note: "event", Readings: "reading", Picture: "picture"}
    types |= {OdometryPose: "motion", Scan: "scan"}
    records = list(open_recording(file).records(ReadingNotes(False)))
    assert {types[type(record)] for record in records} - {"picture"} == set(kinds) - {"picture"}
    if {"picture", "reading", "scan"} & set(kinds):
        before, after = (list(open_session(path, min_distance_m=0.0).moments()) for path in (log, file))
        assert len(before) == 4
        for one, other in zip(before, after, strict=True):
            assert_same(one, other)


@dataclass
class Said:
    """What a converter is heard to say."""

    texts: list[str]

    def remark(self, text: str) -> None:
        self.texts.append(text)

    warning = remark

    def progress(self, done: int, total: int, what: str) -> None:
        pass


@pytest.mark.parametrize(
    ("target", "left_out"),
    [
        (
            "drive.log",
            {
                "motions after the last picture": 1,
                "true poses between pictures": 3,
                "events after the last picture": 1,
                "readings that newer ones replace": 3,
                "covered pictures": 1,
                "raw distances of wheels": 1,
            },
        ),
        ("drive.mcap", {"covered pictures": 1, "raw distances of wheels": 1}),
    ],
)
def test_what_has_no_place_in_a_file_is_named(target: str, left_out: dict[str, int], tmp_path: Path) -> None:
    with SessionWriter(tmp_path / "session.log", SessionInfo(name="drive")) as log:
        for step in range(2):
            log.odometry(step, (0.1, 0.0, 0.0), (0.1, 0.1, 0.1, 0.1) if step else None)
            for part in (0.0, 0.5):
                log.truth(step + part, (0.1 * step, 0.0, 0.0))
                log.reading(step + part, {"a": part})
            if step == 0:
                log.image(0.5, picture(0))
                log.image(0.6, picture(1), covered=True)
        log.event(3, "done")
    said = Said([])
    converted = mv.convert(tmp_path / "session.log", tmp_path / target, listener=said)
    file, done = converted.file, converted.counts
    assert done.left_out == left_out
    for what, count in left_out.items():
        assert any(f"{file}: left out: " in text and f"{count} {what}" in text for text in said.texts)


def test_a_saved_run_keeps_events_and_readings_where_a_file_can_hold_them(
    small_session: Path, tmp_path: Path
) -> None:
    lines = small_session.read_text().splitlines(keepends=True)
    changed = [lines[0]]
    for line in lines[1:]:
        at = line.split(",")[0]
        if '"image"' in line:
            changed.append(f'{at}, "reading": {{"ir": 0.1}}}}\n')
            changed.append(f'{at}, "event": "lights off"}}\n')
        changed.append(line)
    session = small_session.with_name("with-readings.log")
    session.write_text("".join(changed))
    kept, said = tmp_path / "kept", Said([])
    mv.replay(
        session,
        filter=mv.Filter(particles=50),
        output=mv.Output(detail="light", to=tmp_path / "a.rrd", save_run=kept),
    )
    files = [tmp_path / f"a.{kind}" for kind in ("tum", "mcap", "csv")]
    mv.export(kept, files, listener=said)
    assert any(text.startswith(f"{files[0]}: left out: ") and "events" in text for text in said.texts)
    assert "lights off" in (tmp_path / "a.csv").read_text()
    records = list(open_recording(tmp_path / "a.mcap").records(ReadingNotes(False)))
    assert next(one.values for one in records if isinstance(one, Readings)) == {"ir": 0.1}
    assert any(isinstance(one, Note) and one.text == "lights off" for one in records)


def test_damaged_readings_in_an_mcap_are_one_line(tmp_path: Path) -> None:
    file = mv.convert(a_log(tmp_path / "session.log", KINDS), tmp_path / "drive.mcap").file
    file.write_bytes(file.read_bytes().replace(b'"b": -0.', b'"b": -x.'))
    with pytest.raises(InputError, match=r"session/readings|checksum|damaged|CRC"):
        list(open_session(file).moments())


def test_a_laser_between_poses_of_its_odometry_replays_from_a_log_to_the_last_bit(tmp_path: Path) -> None:
    """Every scan is kept, and those that are used have the same motions, truth and ranges."""
    lines = []
    for k in range(40):
        odometry, at = f"{0.07 * k} {0.01 * k * k / 40} {0.03 * k}", 0.1 * k
        lines.append(f"ODOM {odometry} 0 0 0 {at:.3f} host {at:.3f}")
        lines.append(f"TRUEPOS {odometry} {odometry} {at:.3f} host {at:.3f}")
        seen = f"181 {' '.join(str(1 + (k * b) % 7) for b in range(181))} {odometry} {odometry}"
        lines.append(f"FLASER {seen} {at + 0.033:.3f} host {at + 0.033:.3f}")
    (tmp_path / "drive.clf").write_text("\n".join(lines))
    said = Said([])
    done = mv.convert(tmp_path / "drive.clf", tmp_path / "drive.log", listener=said).counts
    assert (done.scans, done.truths, done.left_out) == (40, 40, {})
    for options in ({}, {"min_distance_m": 0.0}, {"min_distance_m": 0.5}):
        before, after = (
            list(open_session(tmp_path / name, **options).moments()) for name in ("drive.clf", "drive.log")
        )
        assert len(before) > 3
        for one, other in zip(before, after, strict=True):
            assert_same(one, other)
            assert one.frame.time_s == other.frame.time_s
            assert np.array_equal(one.truth, other.truth)
