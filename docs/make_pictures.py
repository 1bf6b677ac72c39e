"""Make the pictures of the documentation with the real viewer: .venv/bin/python docs/make_pictures.py.

Needs a software Vulkan driver (apt-get install mesa-vulkan-drivers libvulkan1).
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np

from maurice_datasets.maurice import demo_paths
from maurice_viz.snapshot import headless_viewer

HERE = Path(__file__).parent / "pictures"
COMMAND = [sys.executable, "-c", "from maurice_viz.entry import main; main()"]
ASTRAY, BACK = 38, 56  # steps of the demo that docs/tutorial.md tells of


def record(folder: Path, *args: str) -> Path:
    out = folder / f"{args[0].strip('-')}.rrd"
    subprocess.run([*COMMAND, *args, "--save", str(out)], check=True, capture_output=True)
    return out


def keep(name: str, png: bytes) -> None:
    """Write a picture packed as tightly as PNG allows."""
    image = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR)
    assert image is not None
    cv2.imwrite(str(HERE / name), image, [cv2.IMWRITE_PNG_COMPRESSION, 9])
    print(HERE / name)


def main() -> None:
    HERE.mkdir(exist_ok=True)
    session = demo_paths(0).session
    with tempfile.TemporaryDirectory() as folder:
        both = record(Path(folder), "demo")
        one = record(Path(folder), "replay", str(session), "--feature", "blended")
        with headless_viewer(both) as viewer:
            keep("compare.png", viewer.picture("step", ASTRAY))
        with headless_viewer(one) as viewer:
            keep("single.png", viewer.picture("step", BACK))
            for name, slot in (("predict", 0), ("weight", 2), ("resample", 3)):
                keep(f"phase-{name}.png", viewer.picture("phase", 6 * BACK + slot))


if __name__ == "__main__":
    main()
