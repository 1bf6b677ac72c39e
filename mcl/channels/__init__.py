"""Channels: what is measured in a picture. One file a channel; `CHANNELS` knows them by name."""

from __future__ import annotations

from collections.abc import Mapping

from .channel import Channel
from .color import Color
from .edges import Edges

CHANNELS: Mapping[str, Channel] = {channel.name: channel for channel in (Color(), Edges())}

__all__ = ["CHANNELS", "Channel"]
