"""A laser behind a bridge: its scans, placed by the transforms, make the moments of a live session."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np
import pytest

from helpers.rosbridge import compressed, odometry, rosbridge, stamped
from maurice_loaders.bags.source import Message, decode_json
from maurice_loaders.bags.topics import PoseTopic
from maurice_loaders.live import source as live_source_module
from maurice_loaders.live import translation as live_translation
from maurice_loaders.live import websocket as live_websocket
from maurice_loaders.live.session import ListenOptions, LiveSession
from maurice_loaders.live.source import Patience, live_source
from maurice_loaders.live.translation import ChosenTopics, Translator
from maurice_loaders.live.websocket import HEAD, SUBPROTOCOLS
from maurice_loaders.reading.observations import Gate
from maurice_loaders.reading.options import Reading
from maurice_loaders.session_log.records import scan_from_json

pytest.importorskip("websockets")
pytest.importorskip("rosbags")
EVERY = ListenOptions(keep_up=False, patience=Patience(1.0), gate=Gate())
STILL = {"x": 0, "y": 0, "z": 0, "w": 1}


@pytest.fixture(autouse=True)
def _quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live_source_module, "POLL_S", 0.05)
    monkeypatch.setattr(live_source_module, "LONGEST_WAIT_S", 0.2)
    monkeypatch.setattr(live_websocket, "CHOOSE_S", 0.3)


def once(serve: Callable[[Any], None]) -> Callable[[Any], None]:
    """Serve the first connection alone: a client comes back."""
    served = threading.Event()

    def first(connection: Any) -> None:
        if not served.is_set():
            served.set()
            serve(connection)

    return first


def said(topic: str, message: dict[str, Any]) -> str:
    return json.dumps({"op": "publish", "topic": topic, "msg": message})


def scan(t_s: float, ranges: Sequence[float | None] = (1.0, None, 9.0)) -> str:
    angles = {"angle_min": -1.0, "angle_max": 1.0, "angle_increment": 1.0, "time_increment": 0.0}
    reach = {"range_min": 0.1, "range_max": 8.0, "scan_time": 0.1, "intensities": []}
    header = stamped(t_s) | {"frame_id": "laser"}
    return said("/scan", {"header": header, "ranges": list(ranges)} | angles | reach)


def mount(topic: str = "/tf_static", parent: str = "base_link") -> str:
    moved = {"translation": {"x": 0.2, "y": 0, "z": 0}, "rotation": {"x": 1, "y": 0, "z": 0, "w": 0}}
    link = {"header": stamped(0.0) | {"frame_id": parent}, "child_frame_id": "laser", "transform": moved}
    return said(topic, {"transforms": [link]})


def test_scans_of_a_rosbridge_are_placed_upside_down() -> None:
    topics = {"/scan": "sensor_msgs/LaserScan", "/odom": "nav_msgs/Odometry"}
    topics |= {"/tf_static": "tf2_msgs/TFMessage"}

    def serve(connection: Any) -> None:
        wanted = set()
        for text in connection:
            found = json.loads(text)
            if found["op"] == "call_service":
                values = {"topics": [*topics], "types": [*topics.values()]}
                connection.send(json.dumps({"op": "service_response", "id": found["id"], "values": values}))
            else:
                wanted.add(found["topic"])
            if wanted == {*topics}:
                break
        connection.send(mount())
        for number in range(6):
            connection.send(odometry(100 + number, number))
            connection.send(odometry(100.5 + number, number + 0.5))
            connection.send(scan(100.25 + number))

    with rosbridge(once(serve)) as address:
        source = live_source(address, Reading(max_dt_s=0.3))
        with LiveSession(source, EVERY) as session:
            moments = list(session.moments())
    assert "scans from /scan" in session.info.notes[0]
    assert [m.frame.motions.tolist() for m in moments] == [[[0.25, 0, 0]], *[[[1.0, 0, 0]]] * 5]
    assert "laser 0.20 m ahead" in moments[0].events[0]
    assert "upside down" in moments[0].events[0]
    for moment in moments:
        seen = moment.frame.scan
        assert seen is not None
        np.testing.assert_allclose(seen.mount, [0.2, 0, 0])
        np.testing.assert_allclose(seen.angles_rad, [1.0, 0.0, -1.0])
        assert (seen.hits.tolist(), seen.misses.tolist()) == ([True, False, False], [False, False, True])


def test_scans_of_a_foxglove_bridge() -> None:
    def serve(connection: Any) -> None:
        channel = {"id": 7, "topic": "/laser", "encoding": "json", "schemaName": "foxglove.LaserScan"}
        connection.send(json.dumps({"op": "advertise", "channels": [channel | {"schema": ""}]}))
        connection.recv()
        for number in range(3):
            stamp = {"sec": 5 + number, "nsec": 0}
            pose = {"position": {"x": 0.1, "y": 0, "z": 0}, "orientation": STILL}
            message = {"timestamp": stamp, "frame_id": "base_link", "pose": pose, "ranges": [1.0, 2.0]}
            message |= {"start_angle": 0.0, "end_angle": 0.5, "intensities": []}
            connection.send(HEAD.pack(1, 7, (5 + number) * 10**9) + json.dumps(message).encode())

    with (
        rosbridge(once(serve), [SUBPROTOCOLS[0]]) as address,
        LiveSession(live_source(address), EVERY) as session,
    ):
        moments = list(session.moments())
    assert len(moments) == 3
    assert moments[2].frame.scan is not None
    np.testing.assert_allclose(moments[2].frame.scan.mount, [0.1, 0, 0])
    np.testing.assert_allclose(moments[2].frame.scan.angles_rad, [0.0, 0.5])


KINDS = {"/scan": "sensor_msgs/LaserScan", "/odom": "nav_msgs/Odometry", "/tf_static": "tf2_msgs/TFMessage"}
BOTH = ChosenTopics("/image/compressed", PoseTopic("/odom"), transforms=("/tf_static",), scan="/scan")
ALONE = ChosenTopics(None, PoseTopic("/odom"), transforms=("/tf_static",), scan="/scan")


def heard(translator: Translator, topics: ChosenTopics, *messages: str) -> Iterator[dict[str, Any]]:
    for message in map(json.loads, messages):
        decode = partial(decode_json, json.dumps(message["msg"]))
        kind = KINDS.get(message["topic"], "sensor_msgs/CompressedImage")
        one = Message(message["topic"], kind, 5 * 10**9, decode)
        if kind == KINDS["/tf_static"]:
            translator.learn(one)
        yield from translator.take(one, topics)


def test_the_first_scan_waits_for_the_transforms() -> None:
    translator = Translator(0.1)
    before = [odometry(1.0, 0.0), scan(1.05), odometry(1.1, 1.0)]
    assert list(heard(translator, ALONE, *before)) == []
    lines = list(heard(translator, ALONE, mount(), odometry(1.2, 2.0)))
    assert [next(iter(line.keys() - {"t"})) for line in lines] == ["odometry", "event", "scan"]
    np.testing.assert_allclose(scan_from_json(lines[2]["scan"]).mount, [0.2, 0.0, 0.0])
    (moved, again) = heard(translator, ALONE, scan(1.2))
    assert moved["odometry"] == pytest.approx([1.5, 0.0, 0.0])
    assert "scan" in again


def test_without_transforms_it_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live_translation, "LONGEST_S", 0.0)
    lines = list(heard(Translator(0.1), ALONE, odometry(1.0, 0.0), scan(1.0), odometry(1.1, 1.0)))
    assert "no transform from base_link to laser" in lines[0]["event"]
    assert scan_from_json(lines[1]["scan"]).mount.tolist() == [0, 0, 0]


def test_pictures_and_scans_share_the_movement_between_them() -> None:
    messages = [mount(), odometry(1.0, 0.0), scan(1.0), compressed(1.1), odometry(1.1, 1.0)]
    messages += [scan(1.05), odometry(1.2, 3.0), scan(1.2)]  # a scan of before the last picture
    translator = Translator(0.1)
    lines = list(heard(translator, BOTH, *messages))
    assert [next(iter(line.keys() - {"t"})) for line in lines] == [
        *("event", "scan"),
        *("odometry", "image"),
        *("odometry", "scan"),
    ]
    assert [line["odometry"][0] for line in lines if "odometry" in line] == pytest.approx([1.0, 2.0])
    assert not translator.problems


def test_a_scan_that_no_laser_takes_is_left_out() -> None:
    translator = Translator(0.1)
    broken = json.loads(scan(1.0))
    broken["msg"]["angle_increment"] = 0.0
    messages = [mount(), odometry(1.0, 0.0), json.dumps(broken), odometry(1.1, 1.0), scan(1.1)]
    lines = list(heard(translator, ALONE, *messages))
    assert sum("scan" in line for line in lines) == 1
    assert "found a scan that cannot be read (found beams from" in str(translator.problems[0])
