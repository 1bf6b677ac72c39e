"""A robot behind a Foxglove bridge, as a process of its own: drives on a circle until it is ended.

    python foxglove_bridge.py PORT HOW COUNT

HOW is what it speaks: cdr, json, cdr-tf, proto, proto-raw, proto-tf, proto-video, proto-timeless.

Prints the port when it listens; drives when somebody has subscribed, COUNT pictures, then waits.
"""

import base64
import json
import math
import sys
import time
from collections.abc import Callable
from fractions import Fraction
from functools import cache

import av
import cv2
import foxglove
import foxglove.messages as fox
import numpy as np
from rosbags.typesys import Stores, get_typestore

STORE = get_typestore(Stores.LATEST)
TYPES = STORE.types
STEP, TURN = 0.05, 0.1
HEAD = "std_msgs/msg/Header"
Say = Callable[[int, int], bytes]  # time in ns and number of the step


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


def cdr_transforms(t_ns: int, number: int) -> bytes:
    """The robot in odom, and odom in map a quarter turn to the right."""
    x, y, heading = pose_at(number)
    links = [
        cdr_link(t_ns, "map", "odom", (0, 0, -math.pi / 2)),
        cdr_link(t_ns, "odom", "base_link", (x, y, heading)),
    ]
    message = TYPES["tf2_msgs/msg/TFMessage"](transforms=links)
    return bytes(STORE.serialize_cdr(message, "tf2_msgs/msg/TFMessage"))


def cdr_link(t_ns: int, parent: str, child: str, pose: tuple[float, float, float]) -> object:
    kinds = {name: TYPES[f"geometry_msgs/msg/{name}"] for name in ("Quaternion", "Vector3", "Transform")}
    turned = kinds["Quaternion"](x=0.0, y=0.0, z=math.sin(pose[2] / 2), w=math.cos(pose[2] / 2))
    moved = kinds["Transform"](translation=kinds["Vector3"](x=pose[0], y=pose[1], z=0.0), rotation=turned)
    head = TYPES[HEAD](stamp=TYPES["builtin_interfaces/msg/Time"](**stamp(t_ns)), frame_id=parent)
    kind = TYPES["geometry_msgs/msg/TransformStamped"]
    return kind(header=head, child_frame_id=child, transform=moved)


def when(t_ns: int) -> fox.Timestamp:
    return fox.Timestamp(t_ns // 10**9, t_ns % 10**9)


def place(number: int) -> tuple[fox.Vector3, fox.Quaternion]:
    x, y, heading = pose_at(number)
    return fox.Vector3(x=x, y=y, z=0), fox.Quaternion(
        x=0, y=0, z=math.sin(heading / 2), w=math.cos(heading / 2)
    )


def proto_pose(t_ns: int, number: int) -> bytes:
    at, turned = place(number)
    pose = fox.Pose(position=at, orientation=turned)
    return fox.PoseInFrame(timestamp=when(t_ns), frame_id="odom", pose=pose).encode()


def proto_odometry(t_ns: int, number: int) -> bytes:
    at, turned = place(number)
    pose = fox.Pose(position=at, orientation=turned)
    names = {"frame_id": "odom", "body_frame_id": "base_link"}
    return fox.Odometry(timestamp=when(t_ns), pose=pose, **names).encode()


def proto_transforms(t_ns: int, number: int) -> bytes:
    at, turned = place(number)
    names = {"parent_frame_id": "odom", "child_frame_id": "base_link"}
    link = fox.FrameTransform(timestamp=when(t_ns), translation=at, rotation=turned, **names)
    return fox.FrameTransforms(transforms=[link]).encode()


def proto_picture(t_ns: int, number: int) -> bytes:
    data = picture(number)
    return fox.CompressedImage(timestamp=when(t_ns), frame_id="camera", format="jpeg", data=data).encode()


def proto_raw_picture(t_ns: int, number: int) -> bytes:
    pixels = cv2.imdecode(np.frombuffer(picture(number), np.uint8), cv2.IMREAD_COLOR)
    size = {"width": 32, "height": 24, "step": 96, "encoding": "bgr8"}
    return fox.RawImage(timestamp=when(t_ns), frame_id="camera", data=pixels.tobytes(), **size).encode()


@cache
def encoder(rear: bool) -> av.VideoCodecContext:
    """What packs one camera's pictures, most of which build upon others."""
    del rear
    made = av.CodecContext.create("libx264", "w")
    made.width, made.height, made.pix_fmt, made.time_base = 32, 24, "yuv444p", Fraction(1, 20)
    made.gop_size, made.options = 8, {"tune": "zerolatency", "crf": "1"}
    return made


def proto_video(t_ns: int, number: int) -> bytes:
    pixels = cv2.imdecode(np.frombuffer(picture(number), np.uint8), cv2.IMREAD_COLOR)
    frame = av.VideoFrame.from_ndarray(pixels, format="bgr24")
    frame.pts = number
    (data,) = encoder(number >= 100).encode(frame)
    said = {"frame_id": "camera", "format": "h264", "data": bytes(data)}
    return fox.CompressedVideo(timestamp=when(t_ns), **said).encode()


def untimed(say: Say) -> Say:
    return lambda t_ns, number: say(0, number)


def jsonschema(kind: str) -> foxglove.Schema:
    return foxglove.Schema(name=kind, encoding="jsonschema", data=b"{}")


POSE, CAMERA = ("/odom", "/camera/image")
TF = "/tf"
CDR_CAMERA = (CAMERA, "cdr", definition("sensor_msgs/msg/CompressedImage"), cdr_picture)
PROTO_CAMERA = (CAMERA, "protobuf", fox.CompressedImage.get_schema(), proto_picture)
SPEAKS = {  # topic, encoding, schema and what is said: where it is, and what it sees
    "cdr": [(POSE, "cdr", definition("nav_msgs/msg/Odometry"), cdr_odometry), CDR_CAMERA],
    "cdr-tf": [(TF, "cdr", definition("tf2_msgs/msg/TFMessage"), cdr_transforms), CDR_CAMERA],
    "json": [
        (POSE, "json", jsonschema("foxglove.PoseInFrame"), json_pose),
        (CAMERA, "json", jsonschema("foxglove.CompressedImage"), json_picture),
    ],
    "proto": [(POSE, "protobuf", fox.PoseInFrame.get_schema(), proto_pose), PROTO_CAMERA],
    "proto-raw": [
        (POSE, "protobuf", fox.Odometry.get_schema(), proto_odometry),
        (CAMERA, "protobuf", fox.RawImage.get_schema(), proto_raw_picture),
    ],
    "proto-tf": [(TF, "protobuf", fox.FrameTransforms.get_schema(), proto_transforms), PROTO_CAMERA],
    "proto-video": [
        (POSE, "protobuf", fox.PoseInFrame.get_schema(), proto_pose),
        (CAMERA, "protobuf", fox.CompressedVideo.get_schema(), proto_video),
    ],
    "proto-timeless": [
        (POSE, "protobuf", fox.PoseInFrame.get_schema(), untimed(proto_pose)),
        (CAMERA, "protobuf", fox.CompressedImage.get_schema(), untimed(proto_picture)),
    ],
}


def main() -> None:
    port, how, count = int(sys.argv[1]), sys.argv[2], int(sys.argv[3])
    channels, says = [], []
    for topic, encoding, schema, say in SPEAKS[how]:
        channels.append(foxglove.Channel(topic, schema=schema, message_encoding=encoding))
        says.append(say)
    camera = SPEAKS[how][1]
    rear = foxglove.Channel("/rear/image", schema=camera[2], message_encoding=camera[1])
    server = foxglove.start_server(name="robot", host="127.0.0.1", port=port)
    print(server.port, flush=True)
    begin_ns = time.time_ns()
    while not all(channel.has_sinks() for channel in channels):
        if how.endswith("-tf"):  # a robot that stands still says where it is all the same
            channels[0].log(says[0](begin_ns, 0), log_time=begin_ns)
        time.sleep(0.02)
    for number in range(count):
        t_ns = begin_ns + number * 50_000_000
        for channel, say in zip(channels, says, strict=True):
            channel.log(say(t_ns, number), log_time=t_ns)
        rear.log(says[1](t_ns, 100 + number), log_time=t_ns)
        time.sleep(0.01)
    time.sleep(600)


if __name__ == "__main__":
    main()
