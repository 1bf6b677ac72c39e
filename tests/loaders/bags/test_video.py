"""Video in bags: every codec gives the pictures that went in, in whatever order they are asked for."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import av
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from helpers import bags as making
from helpers.bags import BEGIN_NS, Said
from maurice_loaders.bags import video as bag_video
from maurice_loaders.errors import InputError, PictureError
from maurice_loaders.formats.registry import open_recording, open_session
from maurice_loaders.reading.options import Reading

PICTURES = 24
GROUP = 8  # pictures from one key frame to the next
ENCODERS: dict[str, tuple[str, dict[str, str]]] = {
    "h264": ("libx264", {"tune": "zerolatency"}),
    "h265": ("libx265", {"tune": "zerolatency", "x265-params": "log-level=none"}),
    "vp9": ("libvpx-vp9", {"deadline": "realtime", "lag-in-frames": "0"}),
    "av1": ("libsvtav1", {"preset": "10", "svtav1-params": "pred-struct=1:lookahead=0"}),
}


def shade(number: int) -> int:
    return 20 + 9 * number


def colored(number: int) -> np.ndarray:
    """A picture of one color, its red brighter than in the one before."""
    return np.full((48, 64, 3), (shade(number), 100, 40), np.uint8)


def packed(
    kind: str, count: int = PICTURES, group: int = GROUP, between: int = 0, **more: str
) -> list[tuple[int, bytes]]:
    """Pictures as a stream, each brighter than the one before: number of the picture and its part."""
    encoder, options = ENCODERS[kind]
    codec = av.CodecContext.create(encoder, "w")
    assert isinstance(codec, av.video.codeccontext.VideoCodecContext)
    codec.width, codec.height, codec.pix_fmt, codec.time_base = 64, 48, "yuv420p", Fraction(1, 10)
    codec.gop_size, codec.max_b_frames = group, between
    codec.options = {**({} if between else options), **more}
    parts = []
    for number in range(count):
        frame = av.VideoFrame.from_ndarray(colored(number), format="rgb24")
        frame.pts = number
        parts += codec.encode(frame)
    parts += codec.encode(None)
    return [(part.pts or 0, bytes(part)) for part in parts]


def message(data: bytes, form: str) -> Any:
    return SimpleNamespace(data=data, format=form)


def readers(parts: Sequence[tuple[int, bytes]], form: str) -> dict[int, Callable[[], Any]]:
    """What reads each picture, by its number."""
    video = bag_video.VideoStream()
    found = {number: video.add(message(data, form), 0.1 * k) for k, (number, data) in enumerate(parts)}
    return {number: part.read for number, part in found.items() if part is not None}


def red(image: np.ndarray) -> float:
    """How red a picture is, all of whose other colors are as they went in."""
    assert (image.shape, image.dtype) == ((48, 64, 3), np.uint8)
    r, g, b = image.mean(axis=(0, 1))
    assert (g, b) == (pytest.approx(100, abs=5), pytest.approx(40, abs=5))
    return float(r)


def is_picture(image: np.ndarray, number: int) -> bool:
    return red(image) == pytest.approx(shade(number), abs=5)


@pytest.mark.parametrize("kind", ENCODERS)
@pytest.mark.parametrize("order", ["forward", "backward", "some", "twice"])
def test_pictures_are_what_went_in_whatever_the_order(kind: str, order: str) -> None:
    found = readers(packed(kind), kind)
    assert sorted(found) == list(range(PICTURES))
    asked = {
        "forward": range(PICTURES),
        "backward": range(PICTURES - 1, -1, -1),
        "some": range(3, PICTURES, 5),
        "twice": [number // 2 for number in range(2 * PICTURES)],
    }[order]
    for number in asked:
        assert is_picture(found[number](), number), number


def test_pictures_that_build_upon_later_ones() -> None:
    """Such a stream has its parts in another order than its pictures."""
    parts = packed("h264", between=3)
    assert [number for number, _ in parts] != sorted(number for number, _ in parts)
    for number, read in readers(parts, "h264").items():
        assert is_picture(read(), number)
    video = bag_video.VideoStream()
    found = [video.add(message(data, "h264"), 0.1 * number) for number, data in parts]
    assert not any(part is None or part.note for part in found)  # nothing is missing


def test_what_describes_the_stream_may_stand_in_its_first_part_alone() -> None:
    parts = packed("h264", **{"x264-params": "repeat-headers=1"})
    described = [
        (n, b"".join(unit for unit in units(data) if n == 0 or not describes(unit))) for n, data in parts
    ]
    assert len(described[GROUP][1]) < len(parts[GROUP][1])
    found = readers(described, "h264")
    for number in (GROUP + 2, 2, 2 * GROUP):
        assert is_picture(found[number](), number)


def units(data: bytes) -> list[bytes]:
    return [b"\0\0\0\1" + unit for unit in data.replace(b"\0\0\0\1", b"\0\0\1").split(b"\0\0\1")[1:]]


def describes(unit: bytes) -> bool:
    return unit[4] & 0x1F in (7, 8)  # H.264's sequence and picture parameter sets


@pytest.mark.parametrize("kind", ENCODERS)
def test_what_comes_before_the_first_key_frame_is_left_out(kind: str) -> None:
    parts = packed(kind)[3:]
    video = bag_video.VideoStream()
    found = [video.add(message(data, kind), 0.1 * number) for number, data in parts]
    assert [part is None for part in found] == [number < GROUP for number, _ in parts]
    first, *others = [part for part in found if part]
    assert is_picture(first.read(), GROUP)
    assert first.note == f"video: {GROUP - 3} pictures before the first key frame left out"
    assert not any(part.note for part in others)


@pytest.mark.parametrize("kind", ENCODERS)
def test_a_part_that_is_missing_is_told_of_until_the_next_key_frame(kind: str) -> None:
    """No decoder says so of all codecs, and what builds upon it may look like anything."""
    parts = packed(kind)
    video = bag_video.VideoStream()
    lost = (2 * GROUP - 1, GROUP + 3, GROUP + 5)  # the first of them just before a key frame
    found = {n: video.add(message(data, kind), 0.1 * n) for n, data in parts if n not in lost}
    notes = {number: part.note for number, part in found.items() if part and part.note}
    told = "video: nothing for 0.20 s; pictures may be wrong until the next key frame"
    assert notes == {GROUP + 4: told}


def test_a_camera_that_changes_its_rate_is_told_of_once_a_key_frame() -> None:
    parts = packed("h264")
    video = bag_video.VideoStream()
    times = np.cumsum([0.1] * 10 + [0.3] * (PICTURES - 10))
    found = [video.add(message(data, "h264"), t) for (_, data), t in zip(parts, times, strict=True)]
    assert [number for number, part in enumerate(found) if part and part.note] == [10]


def test_broken_parts_are_said_and_what_follows_the_next_key_frame_is_sound(
    capfd: pytest.CaptureFixture[str],
) -> None:
    parts = packed("h264")
    broken = [(n, data if n != 2 else data[:5] + b"\xff" * 40) for n, data in parts]
    found = readers(broken, "h264")
    for number in (2, 4, 3):  # what builds upon it cannot be told either
        with pytest.raises(PictureError, match="broken video"):
            found[number]()
    assert is_picture(found[1](), 1)
    assert is_picture(found[GROUP](), GROUP)
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("data", [b"", b"\0\0\0\1", b"hello", bytes(1000)])
@pytest.mark.parametrize("kind", ENCODERS)
def test_nonsense_is_no_video(kind: str, data: bytes) -> None:
    video = bag_video.VideoStream()
    for _ in range(3):
        part = video.add(message(data, kind), 0.0)
        if part is not None:
            with pytest.raises(PictureError):
                part.read()


def test_streams_without_key_frames_say_so_and_do_not_fill_memory() -> None:
    (_, other) = packed("h264")[1]
    video = bag_video.VideoStream()
    assert [video.add(message(other, "h264"), 0.1 * k) for k in range(bag_video.MOST_WAITED)] == [
        None
    ] * bag_video.MOST_WAITED
    with pytest.raises(PictureError, match=f"no key frame in {bag_video.MOST_WAITED} parts"):
        video.add(message(other, "h264"), 100.0)
    (_, key), (_, other), *_ = packed("h264")
    video = bag_video.VideoStream()
    video.add(message(key, "h264"), 0.0)
    for _ in range(bag_video.MOST_BUILT - 1):
        video.add(message(other, "h264"), 0.0)
    with pytest.raises(PictureError, match=f"without a key frame for {bag_video.MOST_BUILT} pictures"):
        video.add(message(other, "h264"), 0.0)
    video.add(message(key, "h264"), 0.0)
    with pytest.raises(PictureError, match="without a key frame for 1 picture of"):
        video.add(message(other + bytes(bag_video.MOST_BYTES), "h264"), 0.0)


@pytest.mark.parametrize("kind", ENCODERS)
def test_key_frames_are_told_as_the_encoder_meant_them(kind: str) -> None:
    codec = bag_video.codec_of(message(b"", kind)) or ""
    assert [bag_video.is_key(codec, data) for _, data in packed(kind)] == [
        k % GROUP == 0 for k in range(PICTURES)
    ]


@given(data=st.binary(max_size=60), codec=st.sampled_from(sorted(bag_video.KEYS)))
def test_no_bytes_do_harm(data: bytes, codec: str) -> None:
    assert bag_video.is_key(codec, data) in (True, False)
    assert bag_video.is_key(codec, b"\x12\x00" + data) in (True, False)


@pytest.mark.parametrize(
    ("fields", "codec"),
    [
        ({"format": "h264"}, "h264"),
        ({"format": "H265"}, "hevc"),
        ({"format": "vp9"}, "vp9"),
        ({"format": "av1"}, "av1"),
        ({"encoding": "libx264"}, "h264"),
        ({"encoding": "hevc_nvenc"}, "hevc"),
        ({"encoding": "h264;yuv420p;bgr8;bgr8"}, "h264"),
        ({"format": "bgr8; jpeg compressed bgr8"}, None),
        ({"format": "png"}, None),
        ({"encoding": "rgb8"}, None),
        ({"encoding": "yuv422"}, None),
        ({}, None),
    ],
)
def test_codecs_by_what_names_them(fields: dict[str, str], codec: str | None) -> None:
    assert bag_video.codec_of(SimpleNamespace(**fields)) == codec


def bag(folder: Path, kind: str, parts: Sequence[tuple[int, bytes]]) -> Path:
    """A drive whose camera gives H.264, as messages of one of three types in MCAP."""
    said = []
    for number, data in parts:
        t_ns = BEGIN_NS + number * 10**8
        time = {"sec": t_ns // 10**9, "nsec": t_ns % 10**9}
        header = {"stamp": {"sec": time["sec"], "nanosec": time["nsec"]}, "frame_id": "camera"}
        encoded = making.base64.b64encode(data).decode()
        packet = {"width": 64, "height": 48, "pts": number, "flags": 0, "is_bigendian": False}
        fields: dict[str, Any] = {
            "foxglove.CompressedVideo": {"timestamp": time, "frame_id": "camera", "format": "h264"},
            "sensor_msgs/msg/CompressedImage": {"header": header, "format": "h264"},
            KINDS[2]: packet | {"header": header, "encoding": "h264;yuv420p;bgr8;bgr8"},
        }[kind]
        said.append(Said("/cam/video", kind, t_ns, fields | {"data": encoded}))
    poses = [one for one in making.foxglove_drive(PICTURES) if "mage" not in one.type]
    return making.write_json_mcap(folder / "a.mcap", sorted([*said, *poses], key=lambda one: one.log_ns))


KINDS = (
    "foxglove.CompressedVideo",
    "sensor_msgs/msg/CompressedImage",
    "ffmpeg_image_transport_msgs/msg/FFMPEGPacket",
)


@pytest.mark.parametrize("kind", KINDS)
def test_a_bag_of_video_is_a_session_and_two_readings_at_once_do_not_meet(kind: str, tmp_path: Path) -> None:
    session = open_session(bag(tmp_path, kind, packed("h264")))
    assert len(list(session.moments())) == PICTURES
    for number, (one, other) in enumerate(zip(session.moments(), session.moments(), strict=True)):
        assert is_picture(one.frame.image, number)
        assert is_picture(other.frame.image, number)


def test_a_recording_that_began_in_the_middle_says_so(tmp_path: Path) -> None:
    session = open_session(bag(tmp_path, KINDS[0], packed("h264")[3:]))
    first = next(session.moments())
    assert is_picture(first.frame.image, GROUP)
    assert f"video: {GROUP - 3} pictures before the first key frame left out" in first.events


@pytest.mark.parametrize("kind", KINDS)
def test_without_the_extra_it_is_said(kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = bag(tmp_path, kind, packed("h264"))
    monkeypatch.setattr(bag_video.importlib.util, "find_spec", lambda name: None if name == "av" else name)
    with pytest.raises(InputError, match=r"pip install 'maurice-replay\[video\]'"):
        list(open_session(path, Reading(image_topic="/cam/video")).moments())
    if "Image" not in kind:
        assert "/cam/video is video; decoding it needs an extra" in open_recording(path).info.notes[0]
