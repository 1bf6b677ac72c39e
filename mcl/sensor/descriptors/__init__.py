"""Channels: what is measured in a picture. One file per channel; `CHANNELS` knows them by name."""

from __future__ import annotations

from .channel import Channel
from .registry import BROKEN, CHANNELS, OUR_NAMES, describe, load_channels

__all__ = ["BROKEN", "CHANNELS", "OUR_NAMES", "Channel", "describe", "load_channels"]
