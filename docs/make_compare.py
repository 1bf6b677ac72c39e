"""Make the picture of docs/explain.md with the real viewer: .venv/bin/python docs/make_compare.py.

Needs a software Vulkan driver (apt-get install mesa-vulkan-drivers libvulkan1).
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np

from maurice_viz.viewer.snapshot import headless_viewer

PICTURE = Path(__file__).parent / "pictures" / "compare-three.png"
COMMAND = [sys.executable, "-c", "from maurice_viz.cli.main import main; main()"]
CARRIED = 66  # a step soon after the robot was carried away


def maurice(folder: str, *args: str) -> None:
    subprocess.run([*COMMAND, *args], cwd=folder, check=True, capture_output=True)


def main() -> None:
    presets = [f"--preset={preset}" for preset in ("thesis", "refined", "robust")]
    with tempfile.TemporaryDirectory() as folder:
        maurice(folder, "simulate", "kidnapped", "-o", "carried")
        maurice(folder, "compare", "carried/session.log", *presets, "-o", "three.rrd")
        with headless_viewer(Path(folder) / "three.rrd") as viewer:
            png = viewer.picture("step", CARRIED)
    image = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR)
    assert image is not None
    cv2.imwrite(str(PICTURE), image, [cv2.IMWRITE_PNG_COMPRESSION, 9])
    print(PICTURE)


if __name__ == "__main__":
    main()
