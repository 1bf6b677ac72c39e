from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))  # the helpers are those of a script, and import each other

NEEDED = ("foxglove", "rosbags", "websockets", "resource")
if any(importlib.util.find_spec(name) is None for name in NEEDED):
    collect_ignore = ["test_fuzz.py"]
