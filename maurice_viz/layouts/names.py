"""Names of layouts and details on their own: the command line lists them without importing Rerun."""

from __future__ import annotations

LAYOUT_NAMES = ("overview", "inside-a-step", "explain", "compare", "traces")
RECORDED_LAYOUT_NAMES = ("overview", "traces")  # with --as-recorded
DETAILS = ("full", "events", "light")
