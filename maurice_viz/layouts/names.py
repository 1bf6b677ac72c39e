"""Names of layouts and details, apart from what they mean: the command line lists them without Rerun."""

from __future__ import annotations

LAYOUT_NAMES = ("overview", "inside-a-step", "explain", "compare", "traces")
RECORDED_LAYOUT_NAMES = ("overview", "traces")  # with --as-recorded
DETAILS = ("full", "events", "light")
