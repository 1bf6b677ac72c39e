"""Bags of every kind, written on the spot; skipped where the extra that reads them is not installed."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import pytest

pytest.importorskip("rosbags", reason="the extra ros is not installed")

_spec = importlib.util.spec_from_file_location("bag_making", Path(__file__).with_name("bag_making.py"))
assert _spec is not None
assert _spec.loader is not None
sys.modules["bag_making"] = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(sys.modules["bag_making"])
