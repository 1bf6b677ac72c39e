"""A CMUcam2 on a serial line: a camera that answers on the other end of a real pseudo-terminal."""

from __future__ import annotations

from itertools import islice
from pathlib import Path

import numpy as np
import pytest

from helpers.cmucam_peer import SCENE, answer_to, camera, frame_packet, histogram_packet
from maurice_loaders.errors import FieldError, InputError
from maurice_loaders.formats.registry import open_session
from maurice_loaders.live import cmucam
from maurice_loaders.live import source as live_source_module
from maurice_loaders.live.session import ListenOptions, LiveRecorder, LiveSession
from maurice_loaders.live.source import Patience, is_live, live_source
from maurice_mcl.sensor.descriptors.histograms import camera_histogram
from maurice_mcl.values.arrays import U8
from maurice_mcl.values.session import Moment


@pytest.fixture(autouse=True)
def _quick(monkeypatch: pytest.MonkeyPatch) -> None:
    for module, name, value in (
        (live_source_module, "POLL_S", 0.02),
        (live_source_module, "LONGEST_WAIT_S", 0.1),
        (cmucam, "QUIET_S", 0.05),
        (cmucam, "ANSWER_S", 0.4),
        (cmucam, "SETTLE_S", 0.02),
    ):
        monkeypatch.setattr(module, name, value)


def gone_through(
    address: str, count: int, recorder: LiveRecorder | None = None
) -> tuple[LiveSession, list[Moment]]:
    listen = ListenOptions(keep_up=False, patience=Patience(1.0))
    with LiveSession(live_source(Path(address)), listen, recorder) as session:
        return session, list(islice(session.moments(), count))


def doubled(scene: U8) -> U8:
    return np.repeat(scene, 2, axis=1)


@pytest.mark.parametrize("portion", [7, 1000])
def test_frames_are_asked_for_and_recorded_whatever_the_portions(tmp_path: Path, portion: int) -> None:
    asked: list[str] = []
    with camera(lambda command: asked.append(command) or answer_to(command), portion) as address:
        session, moments = gone_through(address, 3, LiveRecorder(tmp_path))
    assert all(np.array_equal(moment.frame.image, doubled(SCENE)) for moment in moments)
    assert list(dict.fromkeys(asked)) == ["RS", "GV", cmucam.FIXED, "SF"]
    assert session.info.robot == "CMUcam2 v1.00 c6"
    times = [moment.frame.time_s for moment in moments]
    assert times == sorted(times)
    assert session.problem_count == 0
    recorded = next(open_session(tmp_path).moments())
    assert np.array_equal(recorded.frame.image, doubled(SCENE))


def test_histograms_of_the_camera_are_those_of_its_frames() -> None:
    smooth = np.linspace(16, 239, 1024, dtype=np.uint8).reshape(32, 32, 1) + np.zeros((1, 1, 3), np.uint8)

    def answer(command: str) -> bytes:
        if command.startswith("GH"):
            return b"ACK\r" + histogram_packet(smooth) + b":"
        return answer_to(command)

    with camera(answer) as address:
        _, moments = gone_through(f"{address}?histograms&baud=38400", 2)
    of_frame, of_packet = (camera_histogram(image) for image in (smooth, moments[0].frame.image))
    assert np.abs(of_frame - of_packet).max() <= 1.5  # of 256: both round
    assert of_packet.sum() == pytest.approx(of_frame.sum(), abs=1e-3)


def test_noise_on_the_line_and_refusals_are_counted_and_the_next_frame_is_read() -> None:
    spoilt = iter(
        [
            b"NCK\r:",
            b"\xff\x00garbage" + answer_to("SF"),  # still readable
            b"ACK\r" + frame_packet(SCENE)[:200] + b"\r:",  # cut
            answer_to("SF").replace(b"ACK", b"A?K", 1),
        ]
    )

    def answer(command: str) -> bytes:
        return next(spoilt, answer_to(command)) if command == "SF" else answer_to(command)

    with camera(answer) as address:
        session, moments = gone_through(address, 3)
    assert all(np.array_equal(moment.frame.image, doubled(SCENE)) for moment in moments)
    told = [str(problem) for problem in session.problems]
    assert len(told) == 3
    assert "found NCK, expected ACK to SF" in told[0]
    assert "bytes without its end (03)" in told[1]
    assert "expected ACK to SF" in told[2]


def test_a_camera_that_is_plugged_in_again_goes_on(tmp_path: Path) -> None:
    link, asked = tmp_path / "ttyUSB0", 0

    def until_third(command: str) -> bytes | None:
        nonlocal asked
        asked += command == "SF"
        return None if asked == 3 else answer_to(command)

    said: list[str] = []
    with camera(until_third) as first:
        link.symlink_to(first.removeprefix("cmucam://"))
        listen = ListenOptions(keep_up=False, patience=Patience(10))
        with LiveSession(live_source(f"cmucam://{link}"), listen, say=said.append) as session:
            moments = session.moments()
            before = list(islice(moments, 2))
            link.unlink()
            with camera() as second:
                link.symlink_to(second.removeprefix("cmucam://"))
                after = list(islice(moments, 1))
    assert len(before) == 2
    assert after[0].events[0].startswith("gap: the source was away for")
    assert any("was unplugged; trying again" in text for text in said)


SILENT = {
    "nothing": (lambda command: b"", "found no answer, expected ACK to RS"),
    "another rate": (lambda command: b"\xf8\x00\x80" * 4, "found 12 bytes"),
    "refusals": (lambda command: b"NCK\r:", "found NCK, expected ACK to RS"),
    "an echo": (lambda command: command.encode(), "found 2 bytes ('RS')"),
}


@pytest.mark.parametrize("name", SILENT)
def test_a_line_without_a_camera_is_told_at_once_in_one_line(name: str) -> None:
    answer, why = SILENT[name]
    with camera(answer) as address, pytest.raises(InputError) as told:
        gone_through(address, 1)
    text = str(told.value)
    assert text.startswith(f"{address}: {why}")
    assert text.endswith("is it a CMUcam2, is it on, and are its jumpers set to 115200 baud?")
    assert "\n" not in text


def test_a_camera_that_falls_silent_ends_with_patience() -> None:
    asked = 0

    def two_frames(command: str) -> bytes:
        nonlocal asked
        asked += command == "SF"
        return answer_to(command) if asked <= 2 else b""

    with camera(two_frames) as address:
        session, moments = gone_through(address, 3)
    assert len(moments) == 2
    assert "found no answer, expected ACK to SF" in str(session.problems[0])
    assert session.ended == f"{address} was away for 1 s"


def test_what_is_no_camera_is_refused(tmp_path: Path) -> None:
    assert is_live("cmucam:///dev/ttyUSB0")
    assert live_source(Path("cmucam:///dev/ttyUSB0")).name == "cmucam:///dev/ttyUSB0"
    for query in ("baud=100", "bauds=9600", "histograms=1"):
        with pytest.raises(InputError, match=r"\?.*, expected baud=RATE of 1200, .* histograms"):
            live_source(f"cmucam:///dev/ttyUSB0?{query}")
    (tmp_path / "file").write_bytes(b"")
    with pytest.raises(InputError, match="is no serial line, expected one like /dev/ttyUSB0"):
        gone_through(f"cmucam://{tmp_path}/file", 1)
    with pytest.raises(InputError, match="No such file or directory"):
        gone_through(f"cmucam://{tmp_path}/nothing", 1)


@pytest.mark.parametrize("answer", [b"", b"H 1 2 3", b"H " + b"0 " * 28, b"H " + b"999 " * 28])
def test_a_packet_that_is_no_histogram_is_refused(answer: bytes) -> None:
    with pytest.raises(FieldError, match="expected H and 28 counts up to 255"):
        cmucam.read_histogram(answer)
