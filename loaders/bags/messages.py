"""The contents of ROS and Foxglove messages: times, poses in the plane, clouds, frames, pictures as RGB.

A message is any object with the fields of its type as attributes. Quaternions are x, y, z, w by name, z is
up, and a pose in the plane is the position without z and the yaw.
"""

from __future__ import annotations

import base64
import binascii
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from maurice_mcl.values import F64, U8

from ..errors import PictureError
from ..files.pictures import decode_picture, decode_pixels, eight_bits, expect_size
from ..reading.plane import Plane, unit_rotation

ODOMETRY = "nav_msgs/Odometry"
ODOMETRIES = frozenset((ODOMETRY, "foxglove.Odometry"))
POSE_WITH_COVARIANCE = "geometry_msgs/PoseWithCovarianceStamped"  # what localizers publish
PICTURES = frozenset(
    ("sensor_msgs/Image", "sensor_msgs/CompressedImage", "foxglove.RawImage", "foxglove.CompressedImage")
)
VIDEOS = frozenset(("foxglove.CompressedVideo", "ffmpeg_image_transport_msgs/FFMPEGPacket"))
POSES = frozenset(
    (
        *(*ODOMETRIES, POSE_WITH_COVARIANCE),
        *("geometry_msgs/PoseStamped", "geometry_msgs/TransformStamped"),
        *("geometry_msgs/Pose2D", "geometry_msgs/Pose", "turtlesim/Pose", "foxglove.PoseInFrame"),
    )
)
TRANSFORMS = frozenset(
    ("tf2_msgs/TFMessage", "tf/tfMessage", "foxglove.FrameTransform", "foxglove.FrameTransforms")
)
TEXT = "std_msgs/String"
NUMBERS = frozenset(
    (
        *("std_msgs/Float32", "std_msgs/Float64", "std_msgs/Bool", "sensor_msgs/Range"),
        *(f"std_msgs/{kind}{bits}" for kind in ("Int", "UInt") for bits in (8, 16, 32, 64)),
    )
)
SCANS = frozenset(("sensor_msgs/LaserScan", "foxglove.LaserScan"))
GRID = "nav_msgs/OccupancyGrid"
CLOUDS = frozenset(("geometry_msgs/PoseArray", "nav2_msgs/ParticleCloud", "foxglove.PosesInFrame"))

IN_XY = Plane()
STAMPS = (("sec", ("nanosec", "nsec")), ("seconds", ("nanos",)))  # ROS and JSON, protobuf


MESSAGE_ERRORS = (ArithmeticError, AttributeError, LookupError, TypeError, ValueError)  # of invalid messages


class MessageError(ValueError):
    """The content of a message is invalid."""


def known_type(name: str) -> str:
    """Return the name used here for a type: Foxglove's own for its types written as ROS messages."""
    return name.replace("foxglove_msgs/", "foxglove.")


def stamp_ns(message: Any) -> int | None:
    """Return the time stamp of a message in ns; None when it has none, or zero."""
    if hasattr(message, "transforms"):
        return stamp_ns(message.transforms[0]) if len(message.transforms) else None
    stamp = getattr(message, "timestamp", None)
    if hasattr(message, "header"):
        stamp = getattr(message.header, "stamp", None)
    for seconds, names in STAMPS:
        if hasattr(stamp, seconds):
            rest = next((getattr(stamp, name) for name in names if hasattr(stamp, name)), 0)
            return (int(getattr(stamp, seconds)) * 10**9 + int(rest)) or None
    return None


def pose_of(message: Any, plane: Plane = IN_XY) -> F64:
    """Return the pose (3,) x_m, y_m, heading_rad of a message of `POSES`. MessageError when it is invalid."""
    if hasattr(message, "theta"):
        return _checked([message.x, message.y, message.theta])
    return plane.pose(matrix_in(message))


def speeds_of(message: Any) -> F64:
    """Return the speeds (3,) of odometry: forward and left in m/s, turning in rad/s. MessageError."""
    twist = message.twist
    while hasattr(twist, "twist"):
        twist = twist.twist
    return _checked([twist.linear.x, twist.linear.y, twist.angular.z])


def matrix_in(message: Any) -> F64:
    """Return the homogeneous matrix (4, 4) of a message of a pose in space."""
    while hasattr(message, "pose"):
        message = message.pose
    return matrix_of(message)


def matrix_of(placed: Any) -> F64:
    """Return the homogeneous matrix (4, 4) of a pose or a transform."""
    placed = getattr(placed, "transform", placed)
    at = placed.position if hasattr(placed, "position") else placed.translation
    turned = placed.orientation if hasattr(placed, "orientation") else placed.rotation
    matrix = np.eye(4)
    matrix[:3, :3] = _rotation(turned)
    matrix[:3, 3] = [at.x, at.y, at.z]
    if not np.isfinite(matrix).all():
        raise MessageError("found a pose with NaN or infinity, expected numbers")
    return matrix


def cloud_of(message: Any) -> tuple[F64, F64 | None]:
    """Return the poses (N, 3) of a cloud, and the weights (N,) where the message has any."""
    if hasattr(message, "particles"):
        weights = np.array([particle.weight for particle in message.particles], np.float64)
        return _poses([particle.pose for particle in message.particles]), weights
    return _poses(message.poses), None


@dataclass(frozen=True, slots=True, eq=False)
class Link:
    """One transform: the pose of a frame in its parent."""

    parent: str
    child: str
    matrix: F64  # (4, 4) child to parent
    stamp_ns: int | None


def links_of(message: Any) -> list[Link]:
    """Return the transforms of a message of `TRANSFORMS`; leading slashes, as ROS 1 had them, are dropped."""
    parts = message.transforms if hasattr(message, "transforms") else [message]
    return [_link(part) for part in parts]


def _link(part: Any) -> Link:
    parent = part.parent_frame_id if hasattr(part, "parent_frame_id") else part.header.frame_id
    names = (str(parent).lstrip("/"), str(part.child_frame_id).lstrip("/"))
    return Link(*names, matrix_of(part), stamp_ns(part))


def _poses(placed: Sequence[Any]) -> F64:
    values = np.array(
        [
            (p.position.x, p.position.y, p.orientation.x, p.orientation.y, p.orientation.z, p.orientation.w)
            for p in placed
        ],
        np.float64,
    ).reshape(-1, 6)
    x, y, z, w = values[:, 2:].T
    heading = np.arctan2(2 * (w * z + x * y), w * w + x * x - y * y - z * z)
    poses = np.column_stack([values[:, :2], heading])
    if not np.isfinite(poses).all():
        raise MessageError("found a pose with NaN or infinity in a cloud, expected numbers")
    return poses


def _rotation(q: Any) -> F64:
    x, y, z, w = float(q.x), float(q.y), float(q.z), float(q.w)
    length = math.sqrt(x * x + y * y + z * z + w * w)
    if not length > 1e-6:
        raise MessageError(f"found a quaternion of length {length:g}, expected 1; was it left unset?")
    return unit_rotation(w / length, x / length, y / length, z / length)


def _checked(values: Sequence[float]) -> F64:
    pose = np.array(values, np.float64)
    if not np.isfinite(pose).all():
        raise MessageError("found a pose with NaN or infinity, expected numbers")
    return pose


# The tree of coordinate frames, as far as the transforms so far describe it.

DEEPEST = 100  # links from a frame to the root; more is a cycle


class FrameTree:
    """The latest pose of each frame in its parent."""

    def __init__(self, links: Iterable[Link] = ()) -> None:
        self._links: dict[str, Link] = {}
        self._moving: set[str] = set()
        for link in links:
            self.add(link)

    def add(self, link: Link) -> None:
        """Add one transform."""
        if not np.array_equal(self._links.get(link.child, link).matrix, link.matrix):
            self._moving.add(link.child)
        self._links[link.child] = link

    def chain(self, frame: str, child: str) -> list[Link] | None:
        """Return the links from a frame down to one below it, the lowest first; None when unknown."""
        links: list[Link] = []
        while child != frame:
            link = self._links.get(child)
            if link is None or len(links) > DEEPEST:
                return None
            links.append(link)
            child = link.parent
        return links

    def above(self, frame: str) -> list[str]:
        """Return the frames above one, the nearest first."""
        names: list[str] = []
        while (link := self._links.get(frame)) is not None and len(names) <= DEEPEST:
            frame = link.parent
            names.append(frame)
        return names

    def __len__(self) -> int:
        return len(self._links)

    def news(self, links: Sequence[Link], frame: str, child: str) -> tuple[int | None, F64] | None:
        """Add transforms; return time (ns or None) and pose (4, 4) of a frame that they change, or None.

        Of several that move the lowest counts: a localizer's, above the odometry's, is stamped ahead.
        """
        for link in links:
            self.add(link)
        chain = self.chain(frame, child) or []
        moving = [link for link in chain if link.child in self._moving]
        new = [link for link in links if link in (moving[:1] or chain)]
        matrix = self.place(frame, child) if new else None
        return None if matrix is None else (new[0].stamp_ns, matrix)

    def place(self, frame: str, child: str) -> F64 | None:
        """Return the matrix (4, 4) of a frame in one above it; None when unknown."""
        chain = self.chain(frame, child)
        if chain is None:
            return None
        matrix = np.eye(4)
        for link in chain:
            matrix = link.matrix @ matrix
        return matrix


# The time of a message: its own stamp or, where stamps are of no use, the recording time.

AGREE_S = 1.0  # two sensors whose stamps differ by more are on different clocks
Stamps = Sequence[tuple[int | None, int]]  # of a topic's first messages: the stamp or None, time recorded


def use_recorded(first: Mapping[str, Stamps]) -> str:
    """Return why recording times must be used; "" when the stamps of the messages will do."""
    lag_s = {}
    for topic, stamps in first.items():
        if not stamps:
            continue
        if any(stamp is None for stamp, _ in stamps):
            return f"messages of {topic} carry no time"
        if len(stamps) > 1 and len({stamp for stamp, _ in stamps}) == 1 < len({log for _, log in stamps}):
            return f"the times that messages of {topic} carry stand still"
        lag_s[topic] = ((stamps[0][0] or 0) - stamps[0][1]) / 1e9
    if not lag_s:
        return ""
    low, high = min(lag_s, key=lambda t: lag_s[t]), max(lag_s, key=lambda t: lag_s[t])
    if lag_s[high] - lag_s[low] > AGREE_S:
        return f"the clocks of {low} and {high} are {lag_s[high] - lag_s[low]:.3f} s apart"
    return ""


def clock_ns(first: Mapping[str, Stamps]) -> int | None:
    """Return what takes recording times to the clock of the stamps, as of a simulation; 0 where it is one.

    None where recording times must be used.
    """
    if use_recorded(first):
        return None
    lags_ns = [stamp - log for stamps in first.values() for stamp, log in stamps if stamp is not None]
    return lags_ns[0] if lags_ns and abs(lags_ns[0]) > AGREE_S * 1e9 else 0


_AS_IT_IS = -1
_COLORS = {"rgb": (3, _AS_IT_IS), "bgr": (3, cv2.COLOR_BGR2RGB), "rgba": (4, cv2.COLOR_RGBA2RGB)}
_COLORS |= {"bgra": (4, cv2.COLOR_BGRA2RGB), "mono": (1, cv2.COLOR_GRAY2RGB)}
_COLORS |= {"bayer_rggb": (1, cv2.COLOR_BayerRGGB2RGB), "bayer_bggr": (1, cv2.COLOR_BayerBGGR2RGB)}
_COLORS |= {"bayer_gbrg": (1, cv2.COLOR_BayerGBRG2RGB), "bayer_grbg": (1, cv2.COLOR_BayerGRBG2RGB)}
PLAIN = {  # encoding: channels, bytes per channel, OpenCV's conversion to RGB
    f"{name}{8 * size}": (channels, size, code)
    for name, (channels, code) in _COLORS.items()
    for size in (1, 2)
}
PLAIN |= {same: PLAIN[f"{name}8"] for same, name in (("8UC1", "mono"), ("8UC3", "bgr"), ("8UC4", "bgra"))}
PLAIN |= dict.fromkeys(("yuv422", "uyvy"), (2, 1, cv2.COLOR_YUV2RGB_UYVY))
PLAIN |= dict.fromkeys(("yuv422_yuy2", "yuyv"), (2, 1, cv2.COLOR_YUV2RGB_YUY2))
DEPTH = ("16UC1", "32FC1", "16SC1", "32SC1", "64FC1")


def picture_of(message: Any) -> U8:
    """Return the picture (H, W, 3) RGB of a message, raw or compressed. PictureError when it has none."""
    data = bytes_of(message.data)
    if hasattr(message, "encoding"):
        return raw_picture(data, message)
    form = str(getattr(message, "format", ""))
    if "compressedDepth" in form:
        raise PictureError(f"found a depth picture ({form!r}), expected a color or gray one")
    return _compressed_picture(data, form)


def _compressed_picture(data: bytes, form: str) -> U8:
    """Decode by the format that compressed_image_transport writes: "bayer_rggb8; jpeg compressed bgr8".

    Before the semicolon stands what was compressed. A Bayer pattern is compressed as it is; "compressed rgb8"
    are colors in the order that a decoder takes for blue, green, red.
    """
    encoding, _, how = (part.strip() for part in form.partition(";"))
    channels, size, code = PLAIN.get(encoding, (0, 1, _AS_IT_IS))
    if encoding.startswith("bayer"):
        pixels = decode_pixels(data, cv2.IMREAD_UNCHANGED)
        if pixels.ndim == 2:
            pixels = eight_bits(pixels) if pixels.dtype == np.uint16 else pixels
            return np.asarray(cv2.cvtColor(pixels, code), np.uint8)
    image = decode_picture(data, deep=size == 2)
    return np.ascontiguousarray(image[..., ::-1]) if channels >= 3 and "compressed rgb" in how else image


def raw_picture(data: bytes, message: Any) -> U8:
    """Convert a raw picture to RGB (H, W, 3); 16 bits per channel become 8, Bayer patterns are demosaiced."""
    encoding = str(message.encoding)
    if encoding not in PLAIN:
        what = "depth, not color" if encoding in DEPTH else f"none of {', '.join(PLAIN)}"
        raise PictureError(f"found a picture with encoding {encoding!r}, which is {what}")
    channels, size, code = PLAIN[encoding]
    rows = _rows(data, message, channels * size)
    if size == 2:
        order = ">u2" if getattr(message, "is_bigendian", 0) else "<u2"
        pixels = eight_bits(rows.view(order))
    else:
        pixels = rows
    shape = (int(message.height), int(message.width), channels)
    pixels = np.ascontiguousarray(pixels.reshape(shape if channels > 1 else shape[:2]))
    try:
        return pixels if code == _AS_IT_IS else np.asarray(cv2.cvtColor(pixels, code), np.uint8)
    except cv2.error:
        size_px = f"{message.width} x {message.height}"
        raise PictureError(f"found a picture of {size_px} pixels, too small for {encoding!r}") from None


def _rows(data: bytes, message: Any, pixel: int) -> U8:
    height, width, step = int(message.height), int(message.width), int(message.step)
    if min(height, width) < 1:
        raise PictureError(f"found a picture of {width} x {height} pixels, expected some")
    expect_size(width, height)
    if step < width * pixel or len(data) < step * (height - 1) + width * pixel:
        fault = f"found {len(data)} bytes and rows of {step} bytes"
        raise PictureError(f"{fault}, expected {width} x {height} pixels of {pixel} bytes")
    step = step if height > 1 else width * pixel  # of a single row, anything may be written
    whole = np.zeros(step * height, np.uint8)
    part = np.frombuffer(data, np.uint8)[: step * height]
    whole[: len(part)] = part
    return np.ascontiguousarray(whole.reshape(height, step)[:, : width * pixel])


def bytes_of(data: Any) -> bytes:
    """Return a message's bytes, which JSON writes as base64. PictureError when they are invalid."""
    if not isinstance(data, str):
        return bytes(data)
    try:
        return base64.b64decode(data, validate=True)
    except (binascii.Error, ValueError):
        raise PictureError("found broken base64, expected a picture") from None
