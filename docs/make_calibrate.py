"""The pictures of calibrate.md: .venv/bin/python docs/make_calibrate.py (needs the extra `plots`)."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import cv2

from maurice_datasets.demos import demo_paths

sys.path.insert(0, str(Path(__file__).parents[1]))
sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from benchmarks.thesis.calibration_drive import TrialPlan, calibration_drive
from helpers.trials import write_trials  # both found by that path

OUT = Path(__file__).parent / "pictures"
COMMAND = [sys.executable, "-c", "from maurice_viz.cli.main import main; main()", "calibrate"]


def calibrate(*args: str | Path) -> None:
    subprocess.run([*COMMAND, *map(str, args)], check=True, capture_output=True)


def keep(drawn: Path, name: str) -> None:
    """Write a picture packed as tightly as PNG allows."""
    image = cv2.imread(str(drawn))
    assert image is not None
    cv2.imwrite(str(OUT / name), image, [cv2.IMWRITE_PNG_COMPRESSION, 9])
    print(OUT / name, (OUT / name).stat().st_size // 1000, "kB")


def main() -> None:
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        write_trials(folder / "trials.csv", calibration_drive(0, TrialPlan(41, 41)))
        calibrate("motion", folder / "trials.csv", "-o", folder)
        calibrate("noise", demo_paths(0).survey, "-o", folder / "noise.png")
        for number in ("05", "10"):
            (drawn,) = folder.glob(f"figure-{number}-*.png")
            keep(drawn, f"calibrate-figure-{number}.png")
        keep(folder / "noise.png", "calibrate-noise.png")


if __name__ == "__main__":
    main()
