"""A robot behind rosbridge, in this process: lists its topics, then sends what is scripted."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from .live_peers import PICTURE

CAMERA = {"/odom": "nav_msgs/Odometry", "/image/compressed": "sensor_msgs/CompressedImage"}


@contextmanager
def rosbridge(serve: Callable[[Any], None], offered: list[Any] | None = None) -> Iterator[str]:
    """Serve whoever connects; yield the address."""
    from websockets.sync.server import serve as serve_websocket

    with serve_websocket(serve, "127.0.0.1", 0, subprotocols=offered) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        try:
            yield f"ws://127.0.0.1:{server.socket.getsockname()[1]}"
        finally:
            server.shutdown()
            thread.join(10)


def after_subscribing(
    send: Callable[[Any], None], topics: Mapping[str, str] = CAMERA
) -> Callable[[Any], None]:
    """Tell the first who connects the topics, and send once these are subscribed to; others wait."""
    served = threading.Event()

    def serve(connection: Any) -> None:
        if served.is_set():
            return
        served.set()
        wanted = set()
        for text in connection:
            request = json.loads(text)
            if request["op"] == "call_service":
                values = {"topics": [*topics], "types": [*topics.values()]}
                answer = {"op": "service_response", "id": request["id"], "values": values}
                connection.send(json.dumps(answer))
            else:
                wanted.add(request["topic"])
            if wanted == {*topics}:
                break
        send(connection)

    return serve


def stamped(t_s: float) -> dict[str, Any]:
    return {"stamp": {"secs": int(t_s), "nsecs": round(t_s % 1 * 1e9)}, "frame_id": "odom"}


def odometry(t_s: float, x_m: float) -> str:
    pose = {"position": {"x": x_m, "y": 1, "z": 0}, "orientation": {"x": 0, "y": 0, "z": 0, "w": 1}}
    message = {"header": stamped(t_s), "child_frame_id": "base", "pose": {"pose": pose, "covariance": []}}
    return json.dumps({"op": "publish", "topic": "/odom", "msg": message})


def compressed(t_s: float) -> str:
    message = {"header": stamped(t_s), "format": "jpeg", "data": PICTURE}
    return json.dumps({"op": "publish", "topic": "/image/compressed", "msg": message})
