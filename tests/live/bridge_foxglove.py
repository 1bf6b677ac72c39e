"""A robot behind a Foxglove bridge, as a process of its own: drives on a circle until it is ended.

    python bridge_foxglove.py PORT cdr|json COUNT

Prints the port when it listens; drives when somebody has subscribed, COUNT pictures, then waits.
"""

import base64
import json
import math
import sys
import time

import cv2
import foxglove
import numpy as np
from rosbags.typesys import Stores, get_typestore

STORE = get_typestore(Stores.LATEST)
TYPES = STORE.types
STEP, TURN = 0.05, 0.1
HEAD = "std_msgs/msg/Header"


def picture(number: int) -> bytes:
    image = np.full((24, 32, 3), (number * 7) % 256, np.uint8)
    image[:, number % 32] = 255
    return cv2.imencode(".jpg", image)[1].tobytes()


def pose_at(number: int) -> tuple[float, float, float]:
    """Where it is after so many steps of STEP forward and TURN to the left."""
    x = y = heading = 0.0
    for _ in range(number):
        x, y, heading = x + STEP * math.cos(heading), y + STEP * math.sin(heading), heading + TURN
    return x, y, heading


def definition(kind: str) -> foxglove.Schema:
    text, _ = STORE.generate_msgdef(kind, ros_version=2)
    return foxglove.Schema(name=kind, encoding="ros2msg", data=text.encode())


def stamp(t_ns: int) -> dict[str, int]:
    return {"sec": t_ns // 10**9, "nanosec": t_ns % 10**9}


def cdr_header(t_ns: int) -> object:
    return TYPES[HEAD](stamp=TYPES["builtin_interfaces/msg/Time"](**stamp(t_ns)), frame_id="odom")


def cdr_odometry(t_ns: int, number: int) -> bytes:
    x, y, heading = pose_at(number)
    kinds = {name: TYPES[f"geometry_msgs/msg/{name}"] for name in ("Point", "Quaternion", "Pose", "Vector3")}
    turned = kinds["Quaternion"](x=0.0, y=0.0, z=math.sin(heading / 2), w=math.cos(heading / 2))
    pose = kinds["Pose"](position=kinds["Point"](x=x, y=y, z=0.0), orientation=turned)
    zero = kinds["Vector3"](x=0.0, y=0.0, z=0.0)
    twist = TYPES["geometry_msgs/msg/Twist"](linear=zero, angular=zero)
    message = TYPES["nav_msgs/msg/Odometry"](
        header=cdr_header(t_ns),
        child_frame_id="base_link",
        pose=TYPES["geometry_msgs/msg/PoseWithCovariance"](pose=pose, covariance=np.zeros(36)),
        twist=TYPES["geometry_msgs/msg/TwistWithCovariance"](twist=twist, covariance=np.zeros(36)),
    )
    return bytes(STORE.serialize_cdr(message, "nav_msgs/msg/Odometry"))


def cdr_picture(t_ns: int, number: int) -> bytes:
    data = np.frombuffer(picture(number), np.uint8)
    kind = "sensor_msgs/msg/CompressedImage"
    return bytes(STORE.serialize_cdr(TYPES[kind](header=cdr_header(t_ns), format="jpeg", data=data), kind))


def json_pose(t_ns: int, number: int) -> bytes:
    x, y, heading = pose_at(number)
    turned = {"x": 0.0, "y": 0.0, "z": math.sin(heading / 2), "w": math.cos(heading / 2)}
    pose = {"position": {"x": x, "y": y, "z": 0.0}, "orientation": turned}
    time_ = {"sec": t_ns // 10**9, "nsec": t_ns % 10**9}
    return json.dumps({"timestamp": time_, "frame_id": "odom", "pose": pose}).encode()


def json_picture(t_ns: int, number: int) -> bytes:
    data = base64.b64encode(picture(number)).decode()
    time_ = {"sec": t_ns // 10**9, "nsec": t_ns % 10**9}
    return json.dumps({"timestamp": time_, "frame_id": "camera", "format": "jpeg", "data": data}).encode()


def channels(encoding: str) -> tuple[foxglove.Channel, foxglove.Channel]:
    if encoding == "cdr":
        kinds = ("nav_msgs/msg/Odometry", "sensor_msgs/msg/CompressedImage")
        schemas = [definition(kind) for kind in kinds]
    else:
        names = ("foxglove.PoseInFrame", "foxglove.CompressedImage")
        schemas = [foxglove.Schema(name=name, encoding="jsonschema", data=b"{}") for name in names]
    odometry, camera = (
        foxglove.Channel(topic, schema=schema, message_encoding=encoding)
        for topic, schema in zip(("/odom", "/camera/image"), schemas, strict=True)
    )
    return odometry, camera


def main() -> None:
    port, encoding, count = int(sys.argv[1]), sys.argv[2], int(sys.argv[3])
    odometry, camera = channels(encoding)
    server = foxglove.start_server(name="robot", host="127.0.0.1", port=port)
    print(server.port, flush=True)
    says = (cdr_odometry, cdr_picture) if encoding == "cdr" else (json_pose, json_picture)
    while not (odometry.has_sinks() and camera.has_sinks()):
        time.sleep(0.02)
    begin_ns = time.time_ns()
    for number in range(count):
        t_ns = begin_ns + number * 50_000_000
        odometry.log(says[0](t_ns, number), log_time=t_ns)
        camera.log(says[1](t_ns, number), log_time=t_ns)
        time.sleep(0.01)
    time.sleep(600)


if __name__ == "__main__":
    main()
