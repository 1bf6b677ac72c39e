"""The names of layouts, apart from what they are made of: the command line needs no Rerun to list them."""

LAYOUT_NAMES = ("overview", "inside-a-step", "explain", "compare", "traces")
