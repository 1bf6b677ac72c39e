"""Bags of every kind, written on the spot; skipped where the extra that reads them is not installed."""

from __future__ import annotations

import pytest

pytest.importorskip("rosbags", reason="the extra ros is not installed")
