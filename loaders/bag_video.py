"""Video in bags, which is not decoded here: what to do instead.

Its pictures build upon each other, while ours are read one at a time and some never.
"""

from __future__ import annotations

from collections.abc import Sequence

from .bag_messages import known_type
from .bag_source import Topic

TRANSPORTS = {  # image_transport's names for what decodes them
    "foxglove.CompressedVideo": "foxglove",
    "ffmpeg_image_transport_msgs/FFMPEGPacket": "ffmpeg",
}


def video_advice(topics: Sequence[Topic]) -> str:
    """Say how the first topic of video becomes pictures; "" where there is none."""
    for topic in topics:
        transport = TRANSPORTS.get(known_type(topic.type))
        if transport and topic.count:
            decoded = f"{topic.name.rpartition('/')[0]}/decoded"
            ways = f"-p in_transport:={transport} -p out_transport:=raw"
            names = f"-r in/{transport}:={topic.name} -r out:={decoded}"
            command = f"ros2 run image_transport republish --ros-args {ways} {names}"
            return (
                f"{topic.name} is video, which is not decoded here: run `{command}` "
                "and `ros2 bag record -a` while `ros2 bag play` plays the bag, and open the new one"
            )
    return ""
