"""A robot behind a Foxglove bridge, as a process of its own: drives on a circle until it is ended.

    python foxglove_bridge.py PORT HOW COUNT

HOW is what it speaks: cdr, json, cdr-tf, proto, proto-raw, proto-tf, proto-video, proto-timeless.

Prints the port when it listens; drives when somebody has subscribed, COUNT pictures, then waits.
"""

from __future__ import annotations

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
from bags import Ros  # beside this script

ROS = Ros(2)
STEP, TURN = 0.05, 0.1
Say = Callable[[int, int], bytes]  # time in ns and number of the step


def pixels(number: int) -> np.ndarray:
    image = np.full((24, 32, 3), (number * 7) % 256, np.uint8)
    image[:, number % 32] = 255
    return image


def picture(number: int) -> bytes:
    return cv2.imencode(".jpg", pixels(number))[1].tobytes()


def pose_at(number: int) -> tuple[float, float, float]:
    """Where it is after so many steps of STEP forward and TURN to the left."""
    x = y = heading = 0.0
    for _ in range(number):
        x, y, heading = x + STEP * math.cos(heading), y + STEP * math.sin(heading), heading + TURN
    return x, y, heading


def definition(kind: str) -> foxglove.Schema:
    text, _ = ROS.store.generate_msgdef(kind, ros_version=2)
    return foxglove.Schema(name=kind, encoding="ros2msg", data=text.encode())


def cdr(kind: str, message: object) -> bytes:
    return bytes(ROS.store.serialize_cdr(message, kind))


def cdr_odometry(t_ns: int, number: int) -> bytes:
    return cdr("nav_msgs/msg/Odometry", ROS.odometry(t_ns, pose_at(number)))


def cdr_picture(t_ns: int, number: int) -> bytes:
    return cdr("sensor_msgs/msg/CompressedImage", ROS.compressed(t_ns, pixels(number)))


def cdr_transforms(t_ns: int, number: int) -> bytes:
    """The robot in odom, and odom in map a quarter turn to the right."""
    message = ROS.transforms(t_ns, "map", "odom", (0.0, 0.0, -math.pi / 2))
    message.transforms += ROS.transforms(t_ns, "odom", "base_link", pose_at(number)).transforms
    return cdr("tf2_msgs/msg/TFMessage", message)


def json_stamp(t_ns: int) -> dict[str, int]:
    return {"sec": t_ns // 10**9, "nsec": t_ns % 10**9}


def json_pose(t_ns: int, number: int) -> bytes:
    x, y, heading = pose_at(number)
    turned = {"x": 0.0, "y": 0.0, "z": math.sin(heading / 2), "w": math.cos(heading / 2)}
    pose = {"position": {"x": x, "y": y, "z": 0.0}, "orientation": turned}
    return json.dumps({"timestamp": json_stamp(t_ns), "frame_id": "odom", "pose": pose}).encode()


def json_picture(t_ns: int, number: int) -> bytes:
    data = base64.b64encode(picture(number)).decode()
    return json.dumps(
        {"timestamp": json_stamp(t_ns), "frame_id": "camera", "format": "jpeg", "data": data}
    ).encode()


def when(t_ns: int) -> fox.Timestamp:
    return fox.Timestamp(t_ns // 10**9, t_ns % 10**9)


def place(number: int) -> fox.Pose:
    x, y, heading = pose_at(number)
    turned = fox.Quaternion(x=0, y=0, z=math.sin(heading / 2), w=math.cos(heading / 2))
    return fox.Pose(position=fox.Vector3(x=x, y=y, z=0), orientation=turned)


def proto_pose(t_ns: int, number: int) -> bytes:
    return fox.PoseInFrame(timestamp=when(t_ns), frame_id="odom", pose=place(number)).encode()


def proto_odometry(t_ns: int, number: int) -> bytes:
    names = {"frame_id": "odom", "body_frame_id": "base_link"}
    return fox.Odometry(timestamp=when(t_ns), pose=place(number), **names).encode()


def proto_transforms(t_ns: int, number: int) -> bytes:
    x, y, heading = pose_at(number)
    turned = fox.Quaternion(x=0, y=0, z=math.sin(heading / 2), w=math.cos(heading / 2))
    moved = {"translation": fox.Vector3(x=x, y=y, z=0), "rotation": turned}
    names = {"parent_frame_id": "odom", "child_frame_id": "base_link"}
    return fox.FrameTransforms(
        transforms=[fox.FrameTransform(timestamp=when(t_ns), **moved, **names)]
    ).encode()


def proto_picture(t_ns: int, number: int) -> bytes:
    data = picture(number)
    return fox.CompressedImage(timestamp=when(t_ns), frame_id="camera", format="jpeg", data=data).encode()


def proto_raw_picture(t_ns: int, number: int) -> bytes:
    size = {"width": 32, "height": 24, "step": 96, "encoding": "bgr8"}
    return fox.RawImage(
        timestamp=when(t_ns), frame_id="camera", data=pixels(number).tobytes(), **size
    ).encode()


@cache
def encoder(rear: bool) -> av.VideoCodecContext:
    """What packs one camera's pictures, most of which build upon others."""
    del rear
    made = av.CodecContext.create("libx264", "w")
    made.width, made.height, made.pix_fmt, made.time_base = 32, 24, "yuv444p", Fraction(1, 20)
    made.gop_size, made.options = 8, {"tune": "zerolatency", "crf": "1"}
    return made


def proto_video(t_ns: int, number: int) -> bytes:
    frame = av.VideoFrame.from_ndarray(pixels(number), format="bgr24")
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
ODOM = (POSE, "protobuf", fox.PoseInFrame.get_schema(), proto_pose)
SPEAKS = {  # topic, encoding, schema and what is said: where it is, and what it sees
    "cdr": [(POSE, "cdr", definition("nav_msgs/msg/Odometry"), cdr_odometry), CDR_CAMERA],
    "cdr-tf": [(TF, "cdr", definition("tf2_msgs/msg/TFMessage"), cdr_transforms), CDR_CAMERA],
    "json": [
        (POSE, "json", jsonschema("foxglove.PoseInFrame"), json_pose),
        (CAMERA, "json", jsonschema("foxglove.CompressedImage"), json_picture),
    ],
    "proto": [ODOM, PROTO_CAMERA],
    "proto-raw": [
        (POSE, "protobuf", fox.Odometry.get_schema(), proto_odometry),
        (CAMERA, "protobuf", fox.RawImage.get_schema(), proto_raw_picture),
    ],
    "proto-tf": [(TF, "protobuf", fox.FrameTransforms.get_schema(), proto_transforms), PROTO_CAMERA],
    "proto-video": [ODOM, (CAMERA, "protobuf", fox.CompressedVideo.get_schema(), proto_video)],
    "proto-timeless": [(*what[:3], untimed(what[3])) for what in (ODOM, PROTO_CAMERA)],
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
