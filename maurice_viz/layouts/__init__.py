"""Where panels stand on a screen, by name. Views come from `panels`; nothing is drawn or computed here.

story               the first screen: what happened, where, what was seen, and when; traces: one number per
                    update over the session
compare             two to four runs side by side
registry            all layouts of a recording, as tabs of one blueprint
one_run             overview, inside-a-step, explain, sensors: one run at a glance, from the inside, and why
drive               a drive by itself, without a filter
"""

# names on their own: the command line lists them without importing Rerun
from __future__ import annotations

INSIDE, COMPARE = "inside-a-step", "compare"
LAYOUT_NAMES = ("story", "overview", INSIDE, "explain", "sensors", COMPARE, "traces")
LIGHT_NAMES = ("story", "traces")  # with --detail light: all of their panels are filled
RECORDED_LAYOUT_NAMES = ("overview", "traces")  # with --as-recorded
DETAILS = ("full", "events", "light")
