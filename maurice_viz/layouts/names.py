"""Names of layouts and details, apart from what they mean: the command line lists them without Rerun."""

LAYOUT_NAMES = ("overview", "inside-a-step", "explain", "compare", "traces")
DETAILS = ("full", "events", "light")
